"""Files that are written appear whole or not at all, whatever ends the writing; pipes are written through."""

import os
import re
import resource
import signal
import stat
import subprocess
import sys
import threading
from contextlib import contextmanager

import numpy as np
import pytest

from plumbob import certificate, io
from plumbob._files import MAX_TEXT, replacing, write_text
from plumbob.cards import CalibrationCard, NoiseCard, TriadCalibration, TriadNoise, open_card
from plumbob.cli import common
from plumbob.cli.main import main
from plumbob.data import AttitudeTrack, ImuData
from plumbob.errors import DecodeError, ParameterError
from plumbob.io.profile_toml import load_profile
from plumbob.io.text_labels import read_spans
from plumbob.page.drawing import png
from plumbob.pipeline.capture import CaptureSource
from plumbob.pipeline.exports import export
from plumbob.pipeline.rate_table import read_plan
from plumbob.pipeline.session_toml import load_session
from plumbob.rigs import find_format
from plumbob.rotations import IDENTITY, Frame, North

ROOM = 256  # bytes: less than any file below has
BEFORE = b"what was there before"


@contextmanager
def full_disk():
    """Let no file of this process grow beyond `ROOM` bytes: the write that would is refused, as on a full disk."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    before = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (ROOM, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
        signal.signal(signal.SIGXFSZ, before)


def left(folder):
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


WRITERS = {
    "card.json": lambda path: card().save(path),
    "noise.json": lambda path: noise_card().save(path),
    "a.parquet": lambda path: io.write(path, imu()),
    "a.csv": lambda path: io.write(path, imu()),
    "page.html": lambda path: certificate.write_html(path, card(), {}, title="unit 7", facts={}),
    "a.png": lambda path: png(path, lambda figure: None, height=1.0),
}
EXPORTS = ("a.tum", "a.txt", "a.mcap")


@pytest.mark.parametrize("name", WRITERS)
def test_a_full_disk_leaves_what_was_there(tmp_path, name):
    path = tmp_path / name
    path.write_bytes(BEFORE)
    with full_disk(), pytest.raises(DecodeError, match=rf"{name}.* cannot be written: .*Nothing was changed"):
        WRITERS[name](path)
    assert path.read_bytes() == BEFORE
    assert left(tmp_path) == [name]
    WRITERS[name](path)
    assert path.stat().st_size > ROOM


@pytest.mark.parametrize("name", EXPORTS)
def test_a_full_disk_leaves_no_part_of_an_export(tmp_path, name):
    recording = io.Recording(imu=imu(), track=track(), name="a")
    with full_disk(), pytest.raises(DecodeError, match=rf"{name} cannot be written"):
        export(tmp_path / name, recording)
    assert left(tmp_path) == []


@pytest.fixture(scope="module")
def stream(tmp_path_factory):
    """Two seconds of a rig's bytes, once decoded: a compiled kernel is a file that a full disk would not keep."""
    path = tmp_path_factory.mktemp("stream") / "fin.bin"
    assert main(["emulate", "fin", "--duration", "2s", "--write", str(path)]) == 0
    assert main(["decode", str(path), "--format", "fin", "--out", str(path.with_suffix(".csv"))]) == 0
    return path


@pytest.mark.parametrize("name", ["table.csv", "table.json", "table.parquet"])
def test_a_full_disk_leaves_no_cut_table(tmp_path, stream, name, capsys):
    path = tmp_path / name
    with full_disk():
        assert main(["decode", str(stream), "--format", "fin", "--out", str(path)]) == 1
    assert re.search(rf"{name} cannot be written: .*File too large", capsys.readouterr().err)
    assert left(tmp_path) == []


def test_a_full_disk_leaves_no_cut_stream(tmp_path, capsys):
    with full_disk():
        assert main(["emulate", "fin", "--duration", "2s", "--write", str(tmp_path / "fin.bin")]) == 1
    assert "fin.bin cannot be written: File too large." in capsys.readouterr().err
    assert left(tmp_path) == []


def test_ctrl_c_leaves_what_was_there(tmp_path):
    path = tmp_path / "a.txt"
    path.write_bytes(BEFORE)
    with pytest.raises(KeyboardInterrupt), replacing(path) as temporary:
        temporary.write_bytes(b"half of")
        raise KeyboardInterrupt
    assert (path.read_bytes(), left(tmp_path)) == (BEFORE, ["a.txt"])


WAITS = """
import sys, time
from pathlib import Path
from plumbob._files import replacing_all
with replacing_all(Path(sys.argv[1]), Path(sys.argv[2])) as (one, other):
    one.write_text("half"), other.write_text("half")
    print("writing", flush=True)
    time.sleep(60)
"""


def test_sigterm_ends_the_process_and_leaves_what_was_there(tmp_path):
    paths = [tmp_path / "a.txt", tmp_path / "b.txt"]
    paths[0].write_bytes(BEFORE)
    with subprocess.Popen([sys.executable, "-c", WAITS, *map(str, paths)], stdout=subprocess.PIPE) as child:
        assert child.stdout.readline() == b"writing\n"
        child.terminate()
        assert child.wait(30) == -signal.SIGTERM
    assert (paths[0].read_bytes(), left(tmp_path)) == (BEFORE, ["a.txt"])


def test_files_that_belong_together_change_together(tmp_path):
    """A profile and its table, of which the second meets the full disk: the first keeps its old content as well."""
    io.write(tmp_path / "a.csv", imu())
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    with full_disk(), pytest.raises(DecodeError):
        io.write(tmp_path / "a.csv", track())
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_a_link_a_mode_and_a_long_name_are_kept(tmp_path):
    own = tmp_path / ("n" * 251 + ".txt")  # 255 bytes, the longest that Linux allows
    write_text(own, "one")
    own.chmod(0o600)
    link = tmp_path / "link"
    link.symlink_to(own.name)
    write_text(link, "two")
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
    assert (got, left(tmp_path)) == ([b"through"], ["pipe"])
    code = "from plumbob._files import write_text; write_text('/dev/stdout', 'through')"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, check=True).stdout == b"through"
    with (tmp_path / "own").open("wb") as own:  # the shell's > own: a rename would leave its content to nobody
        subprocess.run([sys.executable, "-c", code], stdout=own, check=True)
    assert (tmp_path / "own").read_bytes() == b"through"


def test_a_card_replaces_only_a_card_of_its_kind(tmp_path):
    path = tmp_path / "unit.json"
    card().save(path)
    before = path.read_bytes()
    with pytest.raises(ParameterError, match=r"unit\.json is a calibration card, not a noise card"):
        noise_card().save(path)
    assert path.read_bytes() == before
    card().save(path)
    path.write_text("{")  # torn: nothing to keep
    noise_card().save(path)
    with pytest.raises(ParameterError, match="is a noise card, not a calibration card"):
        card().save(path)


def test_allan_says_so_before_the_analysis(tmp_path, capsys):
    card().save(tmp_path / "unit.json")
    numbers = tmp_path / "absent.txt"  # refused before it is looked for
    assert main(["allan", str(numbers), "--card", str(tmp_path / "unit.json")]) == 1
    assert "is a calibration card, not a noise card" in capsys.readouterr().err


READERS = {
    "a calibration card": CalibrationCard.load,
    "any card": open_card,
    "a session": load_session,
    "a format": lambda path: find_format(str(path)),
    "a profile": load_profile,
    "parameters": lambda path: dict(common.pairs(str(path))),
    "a plan": read_plan,
    "a table of spans": read_spans,
    "a capture": lambda path: CaptureSource(str(path), find_format("fin"), "").open(),
}


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
