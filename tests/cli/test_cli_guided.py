"""Guided captures from the command line: over a recording, and live on an emulated buoy."""

import io as text_io
import json
import os
import shlex
import signal
import subprocess
import time
from types import SimpleNamespace

import numpy as np
import pytest

from plumbob import CalibrationCard, files
from plumbob.live.guide.board import Board, board_lines
from plumbob.live.guide.guide import AxisTurn, Moment, Progress
from tests.helpers.commandline import PLUMBOB, answer, emulated, typed

TIMEOUT = 120


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Raw bytes and recordings of a buoy that was turned through everything, laid on all sides, and left alone."""
    where = tmp_path_factory.mktemp("guided")
    for name, words in {
        "tumble": "tumble",
        "ring": "levelring",
        "faces": "faces --set edges=true,dwell=2.5",
        "rest": "static --duration 25s",
    }.items():
        typed(f"emulate buoy --seed 3 --scenario {words} --write {name}.bin --truth {name}.parquet", cwd=where)
    return where


def live(kind):
    return f"calibrate {kind} --live --format buoy --device 'buoy 7' --out {kind}.json --force"


@pytest.mark.parametrize(("kind", "capture"), [("mag", "tumble"), ("accel", "faces"), ("gyro", "rest")])
def test_a_live_capture_ends_by_itself_when_it_is_good(folder, kind, capture):
    done = typed(f"{live(kind)} --from {capture}.bin --json", cwd=folder)
    told = json.loads(done.stdout)
    assert told["guide"]["done"]
    assert told["guide"]["elapsed_s"] < files.read(folder / f"{capture}.parquet").imu.t[-1] - 1.0
    assert "enough: the capture is good" in done.stderr
    assert "\033" not in done.stderr  # no terminal, no drawing
    card = CalibrationCard.load(folder / f"{kind}.json")
    assert card.device == "buoy 7"
    # a magnetometer that was turned fast is fitted by its length alone, which is fair at best
    assert next(iter(card.parts.values())).quality.grade == ("fair" if kind == "mag" else "good")
    if kind == "mag":
        true = CalibrationCard.load(folder / "tumble.card.json").mag
        np.testing.assert_allclose(card.mag.bias, true.bias, rtol=0, atol=5.0 * card.mag.bias_sd.max())


def test_a_ring_is_refused_live_and_recorded_and_its_bytes_are_kept(folder):
    refusal = answer(f"{live('mag')} --from ring.bin --raw ring.mcap", cwd=folder, code=1)
    assert refusal["refused"][0]["kind"] == "level-ring"
    assert answer("verify ring.mcap", cwd=folder)["whole"]
    sent = files.read(folder / "ring.parquet").imu
    assert answer("info ring.mcap", cwd=folder)["sensors"]["time"]["samples"] == len(sent)
    told = typed("calibrate mag tumble.parquet --guide", cwd=folder).stdout
    assert "s  enough: the capture is good" in told and "missing      nothing" in told
    told = answer("calibrate mag ring.parquet --guide", cwd=folder, code=1)
    assert (told["refused"][0]["kind"], told["guide"]["done"]) == ("level-ring", False)
    assert "tilt it" in told["guide"]["next"]


def interrupted(words, line, cwd, *marks):
    """Exit code and last words of a live capture that gets Ctrl-C at the first line with one of these marks."""
    words = [*PLUMBOB, *shlex.split(words), "--port", str(line)]
    with subprocess.Popen(words, cwd=cwd, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as child:
        told = ""
        while not any(mark in told for mark in marks):
            told = child.stderr.readline()
            assert told
        os.kill(child.pid, signal.SIGINT)
        said = child.communicate(timeout=TIMEOUT)[1]
    return child.returncode, said


def test_interrupted_it_makes_what_there_is_and_bytes_of_another_format_are_noticed(tmp_path):
    with emulated(tmp_path, "--scenario tumble --speed 4") as line:
        code, _ = interrupted(live("mag"), line, tmp_path, *(f"{count} of 18" for count in range(12, 17)))
    assert code == 0
    assert CalibrationCard.load(tmp_path / "mag.json").mag.quality.regions < 18
    with emulated(tmp_path, "--speed 20") as line:
        words = live("gyro").replace("buoy --", "trackball --")
        code, said = interrupted(words, line, tmp_path, "is it the right format")
    assert (code, "no sample arrived over the line" in said) == (1, True), said


def test_a_line_that_comes_back_goes_on(tmp_path):
    with emulated(tmp_path, "--scenario tumble --faults unplug=0.05% --speed 10") as line:
        done = typed(f"{live('mag')} --port {line} --json", cwd=tmp_path)
    assert ["lost" in done.stderr, "reopened" in done.stderr, json.loads(done.stdout)["guide"]["done"]] == [True] * 3


@pytest.mark.parametrize("turns", ["", "--turns 'x 90deg, y 90deg, z 90deg, x -90deg, y -90deg, z -90deg'"])
def test_turns_from_stop_to_stop_are_guided_live_and_a_wrong_one_is_said_at_once(tmp_path, turns):
    words = f"{live('gyro').replace('buoy --', 'fin --')} --method stops --time count"
    with emulated(tmp_path, "--scenario stops --speed 5 --truth true.parquet", "fin") as line:
        done = typed(f"{words} --port {line} {turns} --json", cwd=tmp_path)
    assert json.loads(done.stdout)["guide"]["done"] and "next: turn it about its z axis by about 90°" in done.stderr
    gyr, true = (CalibrationCard.load(tmp_path / name).gyr for name in ("gyro.json", "true.card.json"))
    np.testing.assert_allclose(gyr.matrix, true.matrix, rtol=0, atol=4.0 * gyr.matrix_sd.max())
    told = answer("calibrate gyro true.parquet --guide --method stops --turns 'y -90deg'", cwd=tmp_path, code=1)
    assert any("should be -90°" in moment["text"] for moment in told["guide"]["timeline"])


FILLED = np.isin(np.arange(18), [0, 2, 6, 10])
UNDER_WAY = Progress(
    elapsed=12.3, filled=FILLED, direction=6, still_for=0.0, next_step="turn it", turn=AxisTurn(0, 0.8), goal=14,
    predicted="heading ±1.2° (1 sd)", grade="fair", share=4 / 18, warnings=("too fast: slower",), done=False,
)  # fmt: skip


def test_board_is_drawn_over_itself_on_a_terminal_only(monkeypatch):
    monkeypatch.setattr(time, "monotonic", iter(np.arange(0.0, 100.0)).__next__)
    screen, pipe = text_io.StringIO(), text_io.StringIO()
    screen.isatty = lambda: True
    for out in (screen, pipe):
        board = Board("calibrate mag", SimpleNamespace(timeline=(Moment(1.0, "+x seen, 1 of 18"),)), out)
        board.show(UNDER_WAY)
        board.show(UNDER_WAY)
        board.erase()
    lines = len(board_lines("calibrate mag", UNDER_WAY))
    assert screen.getvalue().count("\a") == 1
    assert screen.getvalue().count(f"\033[{lines}F\033[J") == 2
    assert pipe.getvalue() == "    1.0 s  +x seen, 1 of 18\n   12.3 s  next: turn it\n"
