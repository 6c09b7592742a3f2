"""The firmware of each system, built for the host, reads emulated chips and sends what the encoder makes of them."""

import os
import re
import shutil
import subprocess
import threading
import tomllib
from pathlib import Path

import numpy as np
import pytest

import plumbob
from plumbob.core import flags
from plumbob.protocols.decode import decode
from plumbob.protocols.encode import encode
from plumbob.protocols.format_toml import find_format
from plumbob.protocols.unpack import field_values
from plumbob.reporting.catalogue import start
from tests.helpers import beside

FIRMWARE = Path(__file__).parents[2] / "firmware"
CC = next(filter(shutil.which, ("cc", "gcc", "clang")), None)
pytestmark = pytest.mark.skipif(not (CC and shutil.which("make")), reason="no C compiler, or no make, on this machine")

SYSTEMS = tomllib.loads(beside(__file__, "systems.toml"))
FAULTS = tomllib.loads(beside(__file__, "faults.toml"))


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """Folder of the programs, built by the Makefile: warnings are errors, with sanitizers."""
    folder = tmp_path_factory.mktemp("firmware")
    done = subprocess.run(
        ["make", "-s", "-j2", f"CC={CC}", f"BUILD={folder}"], cwd=FIRMWARE, capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stderr) == (0, "")
    return folder


def powered(folder, system, script, *, clock=0):
    """Bytes that a program sends for a script, and what it says besides: lines of time, what, and of what."""
    done = subprocess.run(
        [folder / system], input=script.encode(), capture_output=True, check=False,
        env={**os.environ, "FIRMWARE_CLOCK": str(clock)},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-2000:].decode()
    return done.stdout, [line.split() for line in done.stderr.decode().splitlines()]


def columns(form, count, clock, seed=8):
    """Counts drawn within a quarter of what each field holds, as values; statuses as of a chip that is well."""
    rng, made = np.random.default_rng(seed), {}
    for f in form.messages[0].fields:
        if f.role in {"counter", "clock"}:
            counts = np.arange(count) % 65536 if f.role == "counter" else clock
        elif f.role == "status":
            counts = np.full(count, f.value or 0)
        else:
            low, high = f.range or f.clip or f.limits
            counts = rng.integers(low // 4, high // 4, count)
        if not (f.derived or f.fixed):
            made[f.name] = field_values(f, counts) if f.physical else counts
    return made


class Bench:
    """A system with its samples: `frames` as the encoder makes them, when each is due, and the script for the chips."""

    def __init__(self, folder, system, count, *, clock=0):
        self.folder, self.system, self.clock = folder, system, clock
        self.name = system.removesuffix("_i2c")
        self.form = find_format(self.name).bind()
        self.parts, self.period = SYSTEMS[system]["bytes"], SYSTEMS[system]["period"]
        lines = SYSTEMS[system]["chips"].splitlines()
        self.chips = "\n".join(line.format(i=i) for line in lines for i in range(6 if "{i}" in line else 1))
        self.ticks = self.first() + self.period * np.arange(count)  # us since the power came
        self.columns = columns(self.form, count, (clock + self.ticks) % 2**32)
        self.frames = encode(self.form, self.columns)
        self.events = [
            (tick - 400, line) for tick, frame in zip(self.ticks, self.frames, strict=True) for line in self.says(frame)
        ]

    def says(self, frame):
        """What the chips get for a frame."""
        for chip, address, before, at, size in self.parts:
            data = before + frame[at : at + size].tobytes().hex()
            yield f"set {chip} {address} {data}" if chip else f"bytes {data}"

    def first(self):
        """When the first frame is due, by the counter and clock of one that comes later."""
        ready = "".join(f"500000 {line}\n" for line in self.says(np.ones(130, np.uint8)))
        sent, _ = powered(self.folder, self.system, f"{self.chips}\n{ready}900000 end\n")
        return int.from_bytes(sent[4:8], "little") - int.from_bytes(sent[2:4], "little") * self.period

    def before(self, tick, line):
        """Let something happen just before a sample is read."""
        self.events.append((self.ticks[tick] - 300, line))

    def run(self):
        """Bytes, and the log."""
        script = [f"{time} {line}" for time, line in sorted(self.events, key=lambda event: event[0])]
        script = [self.chips, *script, f"{self.ticks[-1] + self.period // 2} end", ""]
        return powered(self.folder, self.system, "\n".join(script), clock=self.clock)

    def values(self, kind):
        """What is planted of a triad, by unit, (N, 3)."""
        return {
            name.removesuffix(f"{kind}.x").removesuffix("."): np.stack([self.columns[name[:-1] + a] for a in "xyz"], 1)
            for name in self.columns if name.endswith(f"{kind}.x") and not name.startswith("ref.")
        }  # fmt: skip


def session_of(system, folder, source=""):
    """Session as `plumbob start` writes it, of a shorter rest; `source` in place of its serial port."""
    start(system, folder, port=str(folder / "port"))
    text = re.sub('rest = "[0-9]+ s"', 'rest = "0.02 s"', (folder / f"{system}.toml").read_text())
    text = re.sub('kind = "serial"\nport.*\nbaud.*\n', source, text) if source else text
    (folder / f"{system}.toml").write_text(text)
    return folder / f"{system}.toml"


def recorded(system, sent, folder, monkeypatch):
    """What the system's session makes of bytes: its samples by unit."""
    (folder / "sent.bin").write_bytes(sent)
    session = session_of(system, folder, 'kind = "file"\npath = "sent.bin"\n')
    monkeypatch.chdir(folder)
    path = plumbob.record(session).recording["path"]
    return plumbob.read_array(path).units if system == "arm" else {"": plumbob.read(path).imu}


def require_samples(bench, units, lost=(), absent=None):
    """Every sample that was planted but for those that are lost; absent ones are missing, or said to be invalid."""
    there = np.setdiff1d(np.arange(len(bench.ticks)), lost)
    for imu in units.values():
        np.testing.assert_array_equal(imu.t_ns - imu.t_ns[0], 1000 * (bench.ticks - bench.ticks[there[0]])[there])
    for kind in ("gyr", "acc", "mag"):
        for unit, values in bench.values(kind).items():
            expected = values.copy()
            expected[slice(*(absent or {}).get(f"{unit}.{kind}".removeprefix("."), [0]))] = np.nan
            invalid = units[unit].flags & getattr(flags, f"{kind.upper()}_INVALID") != 0
            triad = getattr(units[unit], kind)  # None where it has no number at all
            said = np.where(invalid[:, np.newaxis], np.nan, np.full(values.shape, np.nan) if triad is None else triad)
            np.testing.assert_array_equal(said, expected[there], f"{unit} {kind}")


@pytest.mark.parametrize("system", SYSTEMS)
def test_the_counts_of_the_chips_reach_the_session_to_the_bit(built, system, tmp_path, monkeypatch):
    bench = Bench(built, system, 30)
    sent, log = bench.run()
    assert sent == bench.frames.tobytes()
    require_samples(bench, recorded(bench.name, sent, tmp_path, monkeypatch))
    written = {(line[2], line[3]): int(line[4], 16) for line in log if line[1] == "write"}
    for chip, values in SYSTEMS[system]["settings"].items():
        assert {at: written[chip, at] for at in values} == values
    assert [line[1:] for line in log if line[1] == "lamp"] == [["lamp", "1"], ["lamp", "0"]]


@pytest.mark.parametrize("fault", FAULTS)
def test_a_chip_that_fails_costs_its_samples_and_gives_no_wrong_one(built, fault, tmp_path, monkeypatch):
    case = FAULTS[fault]
    bench = Bench(built, case["system"], case.get("samples", 20))
    for tick, line in case["events"].items():
        bench.before(int(tick), line)
    sent, _ = bench.run()
    lost = [*range(*case.get("lost", [0]))]
    counters = decode(sent, bench.form).frames[bench.name].columns["counter"]
    assert np.setdiff1d(np.arange(len(bench.ticks)), counters).tolist() == lost
    require_samples(bench, recorded(bench.name, sent, tmp_path, monkeypatch), lost, case.get("absent"))


def test_a_reference_that_is_silent_or_damaged_is_absent_and_found_again(built):
    bench = Bench(built, "rod", 20)
    place = bench.events.index((bench.ticks[10] - 400, f"bytes {bench.frames[10, 28:54].tobytes().hex()}"))
    time, line = bench.events[place]
    bench.events[place] = (time, line[:20] + "aa55" + line[24:46])  # what begins a packet, within one that is cut off
    del bench.events[place + 8]  # none comes
    columns = decode(bench.run()[0], bench.form).frames["rod"].columns
    for name in ("ref.roll", "ref.gyr.z", "gyr.x"):
        expected = bench.columns[name].copy()
        expected[[10, 12] if "ref" in name else []] = np.nan
        np.testing.assert_array_equal(columns[name], expected)


def test_counter_and_clock_go_round(built, tmp_path, monkeypatch):
    """65 600 frames, and 2^32 us within them; where the processor is away the counter goes on by what it missed."""
    bench = Bench(built, "fin", 65_600, clock=2**32 - 60_000_000)
    sent, _ = bench.run()
    assert sent == bench.frames.tobytes()
    last = bench.frames[65_500:].tobytes()
    (imu,) = recorded("fin", last, tmp_path, monkeypatch).values()
    np.testing.assert_array_equal(imu.t_ns - imu.t_ns[0], 2_000_000 * np.arange(100))
    bench = Bench(built, "buoy", 20, clock=2**32 - 150_000)
    bench.events.append((bench.ticks[10] + 5000, "stall 31000"))
    columns = decode(bench.run()[0], bench.form).frames["buoy"].columns
    assert columns["counter"].tolist() == [*range(11), *range(13, 20)]
    late = columns["clock"].astype(np.int64) - bench.columns["clock"][columns["counter"]]
    assert (
        np.flatnonzero(late).tolist() == [11] and 0 < late[11] < bench.period
    )  # sample 13, read as soon as it could be


def test_a_board_waits_for_its_chip_and_starts_it_again(built):
    bench = Bench(built, "trackball", 40)
    bench.events += [(0, "silent gyro 1"), (1_150_000, "silent gyro 0")]
    bench.before(20, "silent gyro 1")
    bench.before(35, "silent gyro 0")
    sent, log = bench.run()
    counters = decode(sent, bench.form).frames["trackball"].columns["counter"]
    starts = [int(line[0]) for line in log if line[1:4] == ["write", "gyro", "3e"]]
    assert counters[0] == 0 and len(starts) == 2
    assert 1_150_000 < starts[0] < 1_350_000 < bench.ticks[35] - 300 < starts[1]
    assert [line[2] for line in log if line[1] == "lamp"] == ["1", "0", "1", "0"]


def test_a_board_on_a_port_is_recorded_by_the_session_that_is_started(built, tmp_path, monkeypatch):
    bench = Bench(built, "fin", 500)
    monkeypatch.setenv("FIRMWARE_PACE", "1")
    line, port = os.openpty()
    (tmp_path / "port").symlink_to(os.ttyname(port))
    session, boards = session_of("fin", tmp_path), []

    def power():
        script = [f"{time} {text}" for time, text in bench.events]
        boards.append(subprocess.Popen([built / "fin"], stdin=subprocess.PIPE, stdout=line, stderr=subprocess.DEVNULL))
        script = "\n".join([bench.chips, *script, f"{bench.ticks[-1] + 900} end", ""])
        threading.Thread(target=boards[0].communicate, args=(script.encode(),)).start()

    monkeypatch.chdir(tmp_path)
    done = plumbob.record(session, duration="2 s", opened=power)
    np.testing.assert_array_equal(plumbob.read(done.recording["path"]).imu.gyr, bench.values("gyr")[""])
    assert plumbob.replay(done.recording["path"], check=True).comparison.equal
