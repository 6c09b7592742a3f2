"""Guided captures from the command line: over a recording, and live on an emulated buoy."""

import io as text_io
import json
import os
import signal
import subprocess
import time
from contextlib import contextmanager

import numpy as np
import pytest

from plumbob import files
from plumbob.calibration.guide.guide import Moment, Progress, Turn
from plumbob.cli.capture import Board, board_lines
from plumbob.cli.main import main
from plumbob.data.cards import CalibrationCard
from tests.helpers.commandline import PLUMBOB, call

TIMEOUT = 120


def plumbob(*words, cwd, code=0):
    done = call(*words, cwd=cwd)
    assert done.returncode == code, (words, done.returncode, done.stdout, done.stderr)
    return done


@contextmanager
def buoy(folder, *words):
    """Emulated buoy behind a pseudo-terminal; gives the link to its line."""
    command = [*PLUMBOB, "emulate", "buoy", "--seed", "3", "--link", "line", *words]
    with subprocess.Popen(command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as child:
        try:
            assert child.stdout.readline().startswith("/dev/")
            yield "line"
        finally:
            child.terminate()


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Raw bytes and recordings of a buoy that was turned through everything, laid on all sides, and left alone."""
    where = tmp_path_factory.mktemp("guided")
    for name, words in {
        "tumble": ("tumble",),
        "ring": ("levelring",),
        "faces": ("faces", "--set", "edges=true,dwell=2.5"),
        "rest": ("static", "--duration", "25s"),
    }.items():
        raw = ("--write", f"{name}.bin", "--truth", f"{name}.parquet")
        plumbob("emulate", "buoy", "--seed", "3", "--scenario", *words, *raw, cwd=where)
    return where


def live(kind, *words):
    return (
        "calibrate",
        kind,
        "--live",
        "--format",
        "buoy",
        "--device",
        "buoy 7",
        "--out",
        f"{kind}.json",
        "--force",
        *words,
    )


@pytest.mark.parametrize(("kind", "capture"), [("mag", "tumble"), ("accel", "faces"), ("gyro", "rest")])
def test_a_live_capture_ends_by_itself_when_it_is_good(folder, kind, capture):
    done = plumbob(*live(kind, "--from", f"{capture}.bin", "--json"), cwd=folder)
    told = json.loads(done.stdout)
    assert told["guide"]["done"]
    assert told["guide"]["elapsed_s"] < files.read(folder / f"{capture}.parquet").imu.t[-1] - 1.0
    assert "enough: the capture is good" in done.stderr
    assert "\033" not in done.stderr  # no terminal, no drawing
    card = CalibrationCard.load(folder / f"{kind}.json")
    assert card.device == "buoy 7"
    # a magnetometer that was turned fast is fitted by its length alone, which is fair at best
    assert next(iter(card.parts.values())).quality.grade == ("fair" if kind == "mag" else "good")


def test_a_card_that_was_made_live_is_near_the_truth(folder):
    plumbob(*live("mag", "--from", "tumble.bin"), cwd=folder)
    found, true = (CalibrationCard.load(folder / name).mag for name in ("mag.json", "tumble.card.json"))
    np.testing.assert_allclose(found.bias, true.bias, rtol=0, atol=5.0 * found.bias_sd.max())


def test_a_ring_is_refused_live_too_and_its_bytes_are_kept(folder):
    done = plumbob(*live("mag", "--from", "ring.bin", "--raw", "ring.mcap"), cwd=folder, code=1)
    assert "level-ring" in done.stderr
    assert "tilt it" in done.stderr
    plumbob("verify", "ring.mcap", cwd=folder)
    sent = files.read(folder / "ring.parquet").imu
    assert f"{len(sent)} samples" in plumbob("info", "ring.mcap", cwd=folder).stdout


def test_interrupted_it_makes_what_there_is(tmp_path):
    with buoy(tmp_path, "--scenario", "tumble", "--speed", "2") as line:
        words = live("mag", "--port", line)
        with subprocess.Popen([*PLUMBOB, *words], cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                              text=True) as child:  # fmt: skip
            told = ""
            while not any(f"{count} of 18" in told for count in range(12, 17)):
                told = child.stderr.readline()
                assert told
            os.kill(child.pid, signal.SIGINT)
            child.communicate(timeout=TIMEOUT)
    assert child.returncode == 0
    assert CalibrationCard.load(tmp_path / "mag.json").mag.quality.regions < 18


def test_a_line_that_comes_back_goes_on(tmp_path):
    faults = ("--faults", "unplug=0.05%", "--speed", "10")
    with buoy(tmp_path, "--scenario", "tumble", *faults) as line:
        done = plumbob(*live("mag", "--port", line), cwd=tmp_path)
    assert "lost" in done.stderr
    assert "reopened" in done.stderr
    assert "enough" in done.stderr


def test_bytes_of_another_format_are_noticed(tmp_path):
    with buoy(tmp_path, "--speed", "20") as line:
        words = [*PLUMBOB, *live("gyro", "--port", line)]
        words[words.index("buoy")] = "trackball"
        with subprocess.Popen(words, cwd=tmp_path, stderr=subprocess.PIPE, text=True) as child:
            told = ""
            while "is it the right format" not in told:
                told = child.stderr.readline()
                assert told
            os.kill(child.pid, signal.SIGINT)
            assert "no sample arrived over the line" in child.communicate(timeout=TIMEOUT)[1]
    assert child.returncode == 1


def test_a_recording_tells_how_its_capture_went(folder, capsys):
    assert main(["calibrate", "mag", str(folder / "tumble.parquet"), "--guide"]) == 0
    told = capsys.readouterr().out
    assert "s  enough: the capture is good" in told
    assert "missing      nothing" in told


def test_a_recording_that_is_refused_tells_what_it_lacks(folder, capsys):
    assert main(["calibrate", "mag", str(folder / "ring.parquet"), "--guide", "--json"]) == 1
    told = json.loads(capsys.readouterr().out)
    assert told["refused"][0]["kind"] == "level-ring"
    assert not told["guide"]["done"]
    assert "tilt it" in told["guide"]["next"]


WRONG = {
    "no kind": (("--live",), 2, "--live follows a KIND"),
    "kind after": (("--live", "mag"), 2, "--live follows a KIND"),
    "nothing": (("mag",), 1, "name the recording"),
    "no line": (("mag", "--live", "--out", "a.json"), 1, "either a session file, or --port"),
    "no card": (("mag", "--live", "--port", "/dev/null", "--format", "buoy"), 1, "needs --out"),
    "no folder": (("mag", "--live", "--port", "/dev/null", "--format", "buoy", "--out", "no/a.json"), 1, "no/a.json"),
    "no unit": (("mag", "--live", "--port", "/dev/null", "--format", "buoy", "--out", "a.json"), 1, "--device"),
    "no triad": (
        ("mag", "--live", "--port", "/dev/null", "--format", "trackball", "--device", "x", "--out", "a.json"), 1,
        "the line has no mag, only gyr",
    ),
    "no guide": (("gyro", "--live", "--method", "hand", "--port", "x", "--out", "a.json"), 1, "guides a rest only"),
    "a time": (("mag", "--live", "--to", "5s", "--out", "a.json"), 1, "--to belong to recordings"),
    "not live": (("mag", "a.parquet", "--port", "/dev/null"), 1, "--live"),
}  # fmt: skip


@pytest.mark.parametrize("case", WRONG)
def test_what_would_spoil_a_capture_is_refused_before_it_begins(case, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    words, code, told = WRONG[case]
    try:
        assert main(["calibrate", *words]) == code
    except SystemExit as end:
        assert end.code == code
    assert told in capsys.readouterr().err


FILLED = np.isin(np.arange(18), [0, 2, 6, 10])
UNDER_WAY = Progress(
    elapsed=12.3, filled=FILLED, direction=6, still_for=0.0, next_step="turn it", turn=Turn(0, 0.8), goal=14,
    predicted="heading ±1.2° (1 sd)", grade="fair", share=4 / 18, warnings=("too fast: slower",), done=False,
)  # fmt: skip


def test_board_under_way():
    assert board_lines("calibrate mag", UNDER_WAY) == [
        "",
        "calibrate mag, 12 s; Ctrl-C ends it with what there is",
        "",
        "   +z       across z       −z       +x upward, +y to the right",
        "   ■         · ■ ▣         ·        4 of 18 seen",
        " · · ○       ·   ■       · · ·      ■ seen  · missing",
        "   ·         · · ·         ·        ▣ here  ○ next",
        "",
        "now      moving",
        "next     turn it",
        "so far   heading ±1.2° (1 sd), fair as far as it goes",
        "WARNING  too fast: slower",
    ]


class Terminal(text_io.StringIO):
    def isatty(self):
        return True


class Told:
    timeline = (Moment(1.0, "+x seen, 1 of 18"),)


def test_board_is_drawn_over_itself_on_a_terminal_only(monkeypatch):
    monkeypatch.setattr(time, "monotonic", iter(np.arange(0.0, 100.0)).__next__)
    screen, pipe = Terminal(), text_io.StringIO()
    for out in (screen, pipe):
        board = Board("calibrate mag", Told(), out)
        board.show(UNDER_WAY)
        board.show(UNDER_WAY)
        board.erase()
    lines = len(board_lines("calibrate mag", UNDER_WAY))
    assert screen.getvalue().count("\a") == 1
    assert screen.getvalue().count(f"\033[{lines}F\033[J") == 2
    assert pipe.getvalue() == "    1.0 s  +x seen, 1 of 18\n   12.3 s  next: turn it\n"
