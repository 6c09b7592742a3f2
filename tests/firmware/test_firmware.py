"""The firmware of each system, built for the host, reads emulated chips and sends what the encoder makes of them."""

import os
import re
import shutil
import subprocess
import threading
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

FIRMWARE = Path(__file__).parents[2] / "firmware"
CC = next(filter(shutil.which, ("cc", "gcc", "clang")), None)
pytestmark = pytest.mark.skipif(not (CC and shutil.which("make")), reason="no C compiler, or no make, on this machine")

HMC = "set {0} 0a 483433\n0 set {0} 09 01"
CHIPS = {  # by system: its chips as they are wired, and what they say before the first sample
    "fin": "chip yaw spi 11 0 8080 replies ff ff\nchip swing spi 14 3 5000 registers ff ff\n"
    "0 set yaw 00 080000ff\n0 set swing 00 ad1d92",  # what the ADXRS453 says in its self-test
    "buoy": "chip imu spi 11 0 1000 registers ff 3a\nchip compass spi 14 3 8000 bursts ff ff\n"
    f"0 set imu 75 68\n0 {HMC.format('compass')}",
    "buoy_i2c": "chip imu i2c 68 0 400 registers ff 3a\nchip compass i2c 1e 0 400 registers ff ff\n"
    f"0 set imu 75 68\n0 {HMC.format('compass')}",
    "trackball": "chip gyro i2c 68 0 400 registers ff 1a\n0 set gyro 00 69",  # bit 0 of the identity is not one
    "arm": "chip switch i2c 70 0 400 switch ff ff\n" + "\n".join(
        f"chip imu{i} i2c 68 0 400 registers {i} 3a\nchip compass{i} i2c 1e 0 400 registers {i} ff\n"
        f"0 set imu{i} 75 68\n0 {HMC.format(f'compass{i}')}" for i in range(6)),
    "rod": "chip unit spi 11 3 2000 words ff ff",
}  # fmt: skip
BYTES = {  # where the chips' bytes stand in a frame: chip, address, what comes before them there, place, how many
    "fin": [("yaw", "00", "", 8, 4), ("swing", "08", "", 12, 6)],
    "buoy": [("imu", "3a", "01", 9, 14), ("compass", "03", "", 23, 6)],
    "trackball": [("gyro", "1a", "01", 8, 8)],
    "arm": [(f"imu{i}", "3a", "01", 8 + 20 * i, 14) for i in range(6)]
    + [(f"compass{i}", "03", "", 22 + 20 * i, 6) for i in range(6)],
    "rod": [("unit", "04", "", 8, 16), ("unit", "02", "", 24, 2), ("unit", "16", "", 26, 2), (None, "", "", 28, 26)],
}  # fmt: skip
PERIOD = {"fin": 2_000, "buoy": 10_000, "trackball": 100_000, "arm": 100_000, "rod": 10_000}  # us
SETTINGS = {  # of the options that the formats have: ranges, gain, filters below half of the frames' rate
    "fin": {"swing": {0x11: 0x02, 0x10: 0x03}},  # 160 Hz, no high-pass; measure, with temperature
    "buoy": {
        "imu": {0x1A: 3, 0x1B: 0 << 3, 0x1C: 1 << 3},
        "compass": {0x01: 1 << 5},
    },  # 42 Hz, 250 deg/s, 4 g; 1.3 gauss
    "trackball": {"gyro": {0x16: 0 << 3 | 6, 0x3E: 3}},  # 250 deg/s, 5 Hz; awake
    "arm": {"imu5": {0x1A: 6, 0x1B: 0 << 3, 0x1C: 1 << 3}, "compass5": {0x01: 1 << 5}},
    "rod": {"unit": {0x38: 0x04, 0x39: 0x03, 0x37: 0x01, 0x35: 0x80}},  # the upper byte first; 300 deg/s, 8 taps
}


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
        self.period = PERIOD[self.name]
        self.ticks = self.first() + self.period * np.arange(count)  # us since the power came
        self.columns = columns(self.form, count, (clock + self.ticks) % 2**32)
        self.frames = encode(self.form, self.columns)
        self.events = [
            (tick - 400, line) for tick, frame in zip(self.ticks, self.frames, strict=True) for line in self.says(frame)
        ]

    def says(self, frame):
        """What the chips get for a frame."""
        for chip, address, before, at, size in BYTES[self.name]:
            data = before + frame[at : at + size].tobytes().hex()
            yield f"bytes {data}" if chip is None else f"set {chip} {address} {data}"

    def first(self):
        """When the first frame is due, by the counter and clock of one that comes later."""
        ready = "".join(f"500000 {line}\n" for line in self.says(np.ones(130, np.uint8)))
        sent, _ = powered(self.folder, self.system, f"{CHIPS[self.system]}\n{ready}900000 end\n")
        return int.from_bytes(sent[4:8], "little") - int.from_bytes(sent[2:4], "little") * self.period

    def before(self, tick, line):
        """Let something happen just before a sample is read."""
        self.events.append((self.ticks[tick] - 300, line))

    def run(self):
        """Bytes, and the log."""
        script = [f"{time} {line}" for time, line in sorted(self.events, key=lambda event: event[0])]
        script = [CHIPS[self.system], *script, f"{self.ticks[-1] + self.period // 2} end", ""]
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
            expected[list((absent or {}).get(f"{unit}.{kind}".removeprefix("."), ()))] = np.nan
            invalid = units[unit].flags & getattr(flags, f"{kind.upper()}_INVALID") != 0
            said = np.where(invalid[:, np.newaxis], np.nan, getattr(units[unit], kind))
            np.testing.assert_array_equal(said, expected[there], f"{unit} {kind}")


@pytest.mark.parametrize("system", CHIPS)
def test_the_counts_of_the_chips_reach_the_session_to_the_bit(built, system, tmp_path, monkeypatch):
    bench = Bench(built, system, 30)
    sent, log = bench.run()
    assert sent == bench.frames.tobytes()
    require_samples(bench, recorded(bench.name, sent, tmp_path, monkeypatch))
    written = {(line[2], int(line[3], 16)): int(line[4], 16) for line in log if line[1] == "write"}
    for chip, values in SETTINGS[bench.name].items():
        assert {at: written[chip, at] for at in values} == values
    assert [line[1:] for line in log if line[1] == "lamp"] == [["lamp", "1"], ["lamp", "0"]]


def silent(chip, until=13):
    """What happens before samples 10 to `until`: a chip does not answer."""
    return {10: f"silent {chip} 1", until: f"silent {chip} 0"}


THREE = range(10, 13)
FAULTS = {  # system, what happens before which sample, samples that are lost, and what is absent in which
    "no acknowledgement": ("buoy_i2c", silent("imu"), THREE, {}),
    "wire of the IMU pulled": ("buoy", silent("imu"), THREE, {}),
    "IMU has nothing new": ("buoy", {10: "set imu 3a 00"}, [10], {}),
    "field not measured yet": ("buoy", {10: "set compass 09 00", 11: "set compass 09 01"}, [], {"mag": [10]}),
    "compass silent, asked again after 1 s": ("buoy", silent("compass"), [], {"mag": range(10, 111)}),
    "gyroscope without acknowledgement": ("trackball", silent("gyro"), THREE, {}),
    "gyroscope has nothing new": ("trackball", {10: "set gyro 1a 00"}, [10], {}),
    "one of six compasses silent": ("arm", silent("compass2"), [], {"u3.mag": THREE}),
    "one of six IMUs silent": ("arm", silent("imu1"), THREE, {}),
    "wire of the yaw gyroscope pulled": ("fin", silent("yaw"), [], {"gyr": THREE}),
    "yaw gyroscope says invalid": ("fin", {10: "set yaw 00 10000084"}, [], {"gyr": [10]}),  # its PLL and self-test fail
    "wire of the other gyroscope pulled": ("fin", silent("swing"), THREE, {}),
    "wire of the unit pulled": ("rod", silent("unit"), [], {"gyr": THREE, "acc": THREE}),
    "words that are not new": ("rod", {10: "set unit 04 " + 16 * "11"}, [], {"gyr": [10], "acc": [10]}),  # ND is 0
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_chip_that_fails_costs_its_samples_and_gives_no_wrong_one(built, fault, tmp_path, monkeypatch):
    system, events, lost, absent = FAULTS[fault]
    bench = Bench(built, system, 120 if "1 s" in fault else 20)
    for tick, line in events.items():
        bench.before(tick, line)
    sent, _ = bench.run()
    frames = decode(sent, bench.form).frames[bench.name]
    assert set(range(len(bench.ticks))) - set(frames.columns["counter"]) == set(lost)
    require_samples(bench, recorded(bench.name, sent, tmp_path, monkeypatch), list(lost), absent)


def test_a_reference_that_is_silent_or_damaged_is_absent_and_found_again(built):
    bench = Bench(built, "rod", 20)
    place = bench.events.index((bench.ticks[10] - 400, f"bytes {bench.frames[10, 28:54].tobytes().hex()}"))
    time, line = bench.events[place]
    bench.events[place] = (time, line[:20] + "aa55" + line[24:])  # what begins a packet, within a packet
    del bench.events[place + 4]  # none comes
    columns = decode(bench.run()[0], bench.form).frames["rod"].columns
    for name in ("ref.roll", "ref.gyr.z", "gyr.x"):
        expected = bench.columns[name].copy()
        expected[[10, 11] if "ref" in name else []] = np.nan
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
        script = "\n".join([CHIPS["fin"], *script, f"{bench.ticks[-1] + 900} end", ""])
        threading.Thread(target=boards[0].communicate, args=(script.encode(),)).start()

    monkeypatch.chdir(tmp_path)
    done = plumbob.record(session, duration="2 s", opened=power)
    np.testing.assert_array_equal(plumbob.read(done.recording["path"]).imu.gyr, bench.values("gyr")[""])
    assert plumbob.replay(done.recording["path"], check=True).comparison.equal
