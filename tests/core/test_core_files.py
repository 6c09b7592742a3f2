"""Files that are written appear whole or not at all, whatever ends the writing; pipes are written through."""

import errno
import os
import re
import signal
import stat
import subprocess
import sys
import threading
import time

import numpy as np
import pytest

from plumbob import AttitudeTrack, ImuData, Recording, convert, find_format, load_session
from plumbob import files as formats
from plumbob.cli import common
from plumbob.cli.main import main
from plumbob.core.errors import DecodeError, ParameterError
from plumbob.core.files import MAX_TEXT, replacing, write_text
from plumbob.data.cards import CalibrationCard, NoiseCard, TriadCalibration, TriadNoise, open_card
from plumbob.door.calibrate import read_plan
from plumbob.files.mcap import repair
from plumbob.files.mcap.writer import RecordingPart
from plumbob.files.profile import load_profile
from plumbob.files.text import read_spans
from plumbob.live.sources import CaptureSource
from plumbob.reporting.calibration import calibrated
from plumbob.reporting.content import Figure
from plumbob.reporting.drawing import picture
from plumbob.rotations import IDENTITY, Frame, North
from tests.helpers import full_disk
from tests.helpers.commandline import ok, refused

BEFORE = b"what was there before"


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def card():
    triad = TriadCalibration(matrix=np.eye(3), bias=np.zeros(3), unit_in="m/s2", unit_out="m/s2")
    return CalibrationCard(device="unit 7", date="2026-11-21", method="six faces", acc=triad)


def noise_card():
    return NoiseCard("unit 7", "data sheet", gyr=TriadNoise([1e-4] * 3, [1e-5] * 3, [0.0] * 3))


def imu():
    return ImuData(t=np.arange(200) * 0.01, gyr=np.random.default_rng(0).normal(size=(200, 3)))


def track():
    return AttitudeTrack(t=np.arange(200) * 0.01, q_nb=np.tile(IDENTITY, (200, 1)), frame=Frame.NED, north=North.TRUE)


def written(path, **how):
    """Write what the file's name asks for."""
    return WRITERS[path.name](path, **how)


def both():
    return Recording(imu=imu(), track=track(), name="a")


WRITERS = {
    "card.json": lambda path, **how: card().save(path, **how),
    "noise.json": lambda path, **how: noise_card().save(path, **how),
    "a.parquet": lambda path, **how: formats.write(path, imu(), **how),
    "a.csv": lambda path, **how: formats.write(path, imu(), **how),
    "page.html": lambda path, **how: calibrated(card(), {}).write_html(path, **how),
    "a.png": lambda path, **how: picture(path, [Figure("", lambda canvas: None, height=1.0)], **how),
    "a.tum": lambda path, **how: convert(both(), path, **how),
    "a.txt": lambda path, **how: convert(both(), path, **how),
    "a.mcap": lambda path, **how: convert(both(), path, **how),
}


@pytest.mark.parametrize("name", WRITERS)
def test_what_was_there_is_replaced_where_that_is_asked_for_and_kept_on_a_full_disk(tmp_path, name):
    """One rule, and one sentence from every writer."""
    path = tmp_path / name
    path.write_bytes(BEFORE)
    with pytest.raises(ParameterError, match=rf"{name} exists already and is not replaced\. Name another .*--force"):
        written(path)
    with full_disk(), pytest.raises(DecodeError, match=rf"{name}.* cannot be written: .*Nothing was changed"):
        written(path, overwrite=True)
    assert (path.read_bytes(), names(tmp_path)) == (BEFORE, [name])
    written(path, overwrite=True)
    assert path.stat().st_size > 256  # more than `full_disk` left room for


def test_what_came_into_being_meanwhile_is_kept_and_a_disk_without_links_will_do(tmp_path, monkeypatch):
    path = tmp_path / "a.txt"
    with pytest.raises(ParameterError, match="exists already"), replacing(path) as temporary:
        temporary.write_bytes(b"ours")
        path.write_bytes(BEFORE)
    assert (path.read_bytes(), names(tmp_path)) == (BEFORE, ["a.txt"])
    path.unlink()
    monkeypatch.setattr(os, "link", lambda *_: (_ for _ in ()).throw(OSError(errno.EPERM, "no links here")))
    assert write_text(path, "ours").read_bytes() == b"ours"
    assert names(tmp_path) == ["a.txt"]


def test_what_a_killed_process_left_is_removed_and_what_a_living_one_writes_is_not(tmp_path):
    path = tmp_path / "a.txt"
    with subprocess.Popen([sys.executable, "-c", WAITS, path, tmp_path / "b.txt"], stdout=subprocess.PIPE) as child:
        assert child.stdout.readline() == b"writing\n"
        (temporary,) = (one for one in names(tmp_path) if one.startswith(".a.txt"))
        assert re.fullmatch(r"\.a\.txt\.plumbob-[0-9a-f]{8}\.tmp", temporary)  # whose it is, and of which file
        write_text(path, "ours")
        assert temporary in names(tmp_path)
        child.kill()
    write_text(path, "ours again", overwrite=True)
    assert path.read_text() == "ours again"
    assert temporary not in names(tmp_path)
    assert [one for one in names(tmp_path) if one.startswith(".b.txt")]  # until a b.txt is written


@pytest.fixture(scope="module")
def stream(tmp_path_factory):
    """Two seconds of a rig's bytes, once decoded: a compiled kernel is a file that a full disk would not keep."""
    path = tmp_path_factory.mktemp("stream") / "fin.bin"
    ok("emulate", "fin", "--duration", "2s", "--write", path)
    ok("decode", path, "--format", "fin", "--out", path.with_suffix(".csv"))
    return path


@pytest.mark.parametrize("name", ["table.csv", "table.parquet", "fin.bin"])
def test_a_full_disk_leaves_no_cut_table_and_no_cut_stream(tmp_path, stream, name):
    made = ["decode", stream, "--format", "fin", "--out"] if "table" in name else ["emulate", "fin", "--write"]
    with full_disk():
        line = refused(*made, tmp_path / name, *(() if "table" in name else ("--duration", "2s")))
    assert re.search(rf"{name}.* cannot be written: .*File too large", line)
    assert names(tmp_path) == []


WAITS = """
import sys, time
from pathlib import Path
from plumbob.core.files import replacing_all
with replacing_all(Path(sys.argv[1]), Path(sys.argv[2])) as (one, other):
    one.write_text("half"), other.write_text("half")
    print("writing", flush=True)
    time.sleep(60)
"""


class Dropping:
    """What drops the error of a signal that comes in it, as callbacks of imports do."""

    def __init__(self, number):
        self.number = number

    def __del__(self):
        signal.raise_signal(self.number)


def dropped(number):
    Dropping(number)
    time.sleep(5.0)


@pytest.mark.usefixtures("hang_up_ends")
@pytest.mark.parametrize("come", [signal.raise_signal, dropped])
@pytest.mark.parametrize(
    ("number", "name"), [(signal.SIGINT, "Ctrl-C"), (signal.SIGTERM, "SIGTERM"), (signal.SIGHUP, "SIGHUP")]
)
def test_a_signal_in_the_middle_leaves_what_was_there_and_a_sentence(tmp_path, monkeypatch, capsys, number, name, come):
    """After the first chunk of a conversion; the exit code is what a shell says of a process that a signal ended."""
    formats.write(tmp_path / "a.parquet", imu())
    out = tmp_path / "a.mcap"
    out.write_bytes(BEFORE)
    monkeypatch.setattr(RecordingPart, "write", lambda *_: come(number))
    monkeypatch.setattr(sys, "unraisablehook", lambda _: None)
    assert main(["convert", str(tmp_path / "a.parquet"), str(out), "--force"]) == 128 + number
    assert capsys.readouterr().err == f"plumbob convert: ended by {name}; not written: {out}.\n"
    assert (out.read_bytes(), names(tmp_path)) == (BEFORE, ["a.mcap", "a.parquet"])
    assert signal.getsignal(number) == (signal.default_int_handler if number == signal.SIGINT else signal.SIG_DFL)


def test_a_signal_between_two_names_waits_for_the_second(tmp_path, monkeypatch):
    """A table and its profile: Ctrl-C once the first has its name."""
    rename = os.link

    def interrupted(*names):
        rename(*names)
        os.kill(os.getpid(), signal.SIGINT)

    monkeypatch.setattr(os, "link", interrupted)
    with pytest.raises(KeyboardInterrupt):
        formats.write(tmp_path / "a.csv", imu())
    assert names(tmp_path) == ["a.csv", "a.profile.toml"]


def test_files_that_belong_together_change_together(tmp_path):
    """A profile and its table, of which the second meets the full disk: the first keeps its old content as well."""
    formats.write(tmp_path / "a.csv", imu())
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    with full_disk(), pytest.raises(DecodeError):
        formats.write(tmp_path / "a.csv", track(), overwrite=True)
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_a_link_a_mode_and_a_long_name_are_kept(tmp_path):
    own = tmp_path / ("n" * 251 + ".txt")  # 255 bytes, the longest that Linux allows
    write_text(own, "one")
    own.chmod(0o600)
    link = tmp_path / "link"
    link.symlink_to(own.name)
    write_text(link, "two", overwrite=True)
    assert link.is_symlink()
    assert own.read_text() == "two"
    assert stat.S_IMODE(own.stat().st_mode) == 0o600


def test_pipes_and_the_standard_output_are_written_through(tmp_path):
    pipe, got = tmp_path / "pipe", []
    os.mkfifo(pipe)
    reader = threading.Thread(target=lambda: got.append(pipe.read_bytes()))
    reader.start()
    write_text(pipe, "through")
    reader.join(30)
    assert (got, names(tmp_path)) == ([b"through"], ["pipe"])
    code = "from plumbob.core.files import write_text; write_text('/dev/stdout', 'through')"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, check=True).stdout == b"through"
    with (tmp_path / "own").open("wb") as own:  # the shell's > own: a rename would leave its content to nobody
        subprocess.run([sys.executable, "-c", code], stdout=own, check=True)
    assert (tmp_path / "own").read_bytes() == b"through"


@pytest.mark.parametrize("name", ["a.parquet", "a.mcap"])
def test_what_is_no_file_on_a_disk_is_kept_from_writers_that_seek(tmp_path, name):
    """They remove what they could not write: once a pipe, and /dev/full as root."""
    pipe = tmp_path / name
    os.mkfifo(pipe)
    WRITERS["a.mcap"](sound := tmp_path / "sound.mcap")
    for write in (WRITERS[name], lambda path, **how: repair(sound, path, **how)):
        with pytest.raises(DecodeError, match=rf"{name} cannot be written: it is a pipe or a device"):
            write(pipe, overwrite=True)
    assert (pipe.is_fifo(), names(tmp_path)) == (True, [name, "sound.mcap"])


def test_a_card_replaces_only_a_card_of_its_kind(tmp_path):
    path, other = tmp_path / "unit.json", tmp_path / "other.json"
    card().save(other)  # a noise card beside a recording is refused before the recording is looked for
    card().save(path)
    before = path.read_bytes()
    with pytest.raises(ParameterError, match=r"unit\.json is a calibration card, not a noise card"):
        noise_card().save(path, overwrite=True)
    assert path.read_bytes() == before
    card().save(path, overwrite=True)
    path.write_text("{")  # torn: nothing to keep
    noise_card().save(path, overwrite=True)
    with pytest.raises(ParameterError, match="is a noise card, not a calibration card"):
        card().save(path, overwrite=True)
    assert "is a calibration card, not a noise card" in refused(
        "allan", tmp_path / "absent.txt", "--card", other, "--force"
    )


READERS = {
    "a calibration card": CalibrationCard.load, "any card": open_card, "a session": load_session,
    "a format": lambda path: find_format(str(path)), "a profile": load_profile,
    "parameters": lambda path: dict(common.pairs(str(path))), "a plan": read_plan, "a table of spans": read_spans,
    "a capture": lambda path: CaptureSource(str(path), find_format("fin"), "").open(),
}  # fmt: skip


@pytest.mark.parametrize("what", READERS)
def test_only_regular_files_of_a_sane_size_are_read(tmp_path, what):
    """A device without an end, a pipe that nobody writes to, a folder, a file of a terabyte: one sentence at once."""
    device, pipe, folder, huge, gone = (tmp_path / f"{name}.toml" for name in ("zero", "pipe", "dir", "huge", "gone"))
    device.symlink_to("/dev/zero")
    os.mkfifo(pipe)
    folder.mkdir()
    huge.touch()
    os.truncate(huge, MAX_TEXT + 1)
    refusals = [(device, "not a regular file"), (pipe, "not a regular file"), (folder, "is a folder")]
    refusals += [(gone, "does not exist")] + ([(huge, "such a file has")] if what != "a capture" else [])
    for path, told in refusals:
        with pytest.raises(DecodeError, match=rf"{path.name} .*{told}") as caught:
            READERS[what](path)
        assert str(caught.value).count(str(path)) == 1


@pytest.mark.parametrize("strike", [1, 2, 3])
def test_a_signal_just_before_signals_are_held_back_leaves_nothing(tmp_path, monkeypatch, strike):
    """Before the temporary is created, before it takes its name, and before it is removed."""
    every, entered = signal.valid_signals, []

    def struck():
        entered.append(1)
        if len(entered) == strike:
            raise KeyboardInterrupt
        return every()

    monkeypatch.setattr(signal, "valid_signals", struck)  # asked for as signals are about to be held back
    with pytest.raises(KeyboardInterrupt), replacing(tmp_path / "a.txt") as temporary:
        temporary.write_text("whole")
    assert names(tmp_path) == (["a.txt"] if strike == 3 else [])
