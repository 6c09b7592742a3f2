"""Rigs with other noise, parts, temperatures, a high-pass, and references with errors of their own."""

import math
import os
import select
import socket
import termios
import threading
import time
from dataclasses import replace
from io import BytesIO

import numpy as np
import pytest

import plumbob
from plumbob import record
from plumbob.core import flags
from plumbob.core.errors import CalibrationError, DecodeError, ParameterError, ShapeError
from plumbob.core.units import deg
from plumbob.data.cards import NoiseCard, TriadNoise
from plumbob.live.emulated import unit_file
from plumbob.live.rigs.faults import KINDS
from plumbob.live.rigs.firmware import FlashLog, Processor, run_firmware
from plumbob.live.rigs.rig import PLANS, RigUnit, make_rig, plan_for
from plumbob.live.rigs.serving import FilePort, PtyPort, TcpPort, UdpPort, serve
from plumbob.protocols.checksum import of_rows
from plumbob.protocols.decode import decode, triads_of, unit_temperature
from plumbob.protocols.format_toml import find_format, parse_format, rig_names
from plumbob.protocols.ring import read_ring
from plumbob.rotations import Frame, euler_zyx_from_quat, quat_angle, quat_conjugate, quat_multiply, quat_rotate
from plumbob.simulation import scenario
from plumbob.simulation.signals import Polynomial
from tests.helpers import beside

LOUD = NoiseCard("unit 7", "Allan analysis", gyr=TriadNoise(n_rpsd=[0.1] * 3, b=[0.0] * 3, k_rpsd=[0.0] * 3))


def emulated(name, tmp_path, **how):
    """Frames, and truth of a rig's first unit, by `plumbob.emulate`."""
    out, truth = tmp_path / f"{name}.bin", tmp_path / "truth.parquet"
    plumbob.emulate(name, **{"seed": 2, "duration": 5.0, **how}, write=out, truth=truth, overwrite=True)
    first = PLANS[name].units[0].prefix
    return decode(out.read_bytes(), find_format(name))[0][name], plumbob.read(unit_file(truth, first))


def test_a_noise_card_is_what_the_units_have(tmp_path):
    plain, made = (
        make_rig(PLANS["fin"], find_format("fin"), seed=1, duration=20.0, noise=card).units[""] for card in (None, LOUD)
    )
    np.testing.assert_array_equal(made.noise.gyr.n_rpsd, LOUD.gyr.n_rpsd)
    assert not np.array_equal(plain.noise.gyr.n_rpsd, LOUD.gyr.n_rpsd)
    np.testing.assert_array_equal(made.module.gyr.bias, plain.module.gyr.bias)
    scatter = np.diff(made.imu.gyr, axis=0).std(axis=0) / math.sqrt(2.0)  # of neighbours: white noise alone
    np.testing.assert_allclose(scatter[2], 0.1 * math.sqrt(500.0), rtol=0.1)  # x and y are clipped at 100 °/s
    LOUD.save(tmp_path / "card.json")
    frames, truth = emulated("fin", tmp_path, noise=tmp_path / "card.json")
    assert any("noise of gyr from the card of unit 7" in str(note) for note in truth.notes)
    assert len(frames) == 2500


def test_a_card_may_be_for_one_unit_of_several():
    rig = make_rig(PLANS["arm"], find_format("arm"), seed=1, duration=2.0, noise={"u3": LOUD})
    assert [one for one, unit in rig.units.items() if unit.noise.gyr.n_rpsd[0] == 0.1] == ["u3"]
    every = make_rig(PLANS["arm"], find_format("arm"), seed=1, duration=2.0, noise=LOUD)
    assert all(unit.noise.gyr.n_rpsd[0] == 0.1 for unit in every.units.values())
    rod = make_rig(PLANS["rod"], find_format("rod"), seed=1, duration=2.0, noise=LOUD)
    assert [unit.noise.gyr.n_rpsd[0] for unit in rod.units.values()] == [0.1, 0.0]  # a reference keeps what it has


def test_a_rig_may_have_other_parts(tmp_path):
    frames, _ = emulated("arm", tmp_path, sensors="arm:turn", scenario="static", duration=30.0, unit="calibrated")
    scatter = triads_of(frames, "u2")["mag"].std(axis=0)
    np.testing.assert_allclose(scatter, 1.0, rtol=0.3)  # µT, of 300 samples and counts; the rig's own have 0.5
    with pytest.raises(ParameterError, match="mpu6000 has no mag, which the frame of buoy has; add such a part"):
        emulated("buoy", tmp_path, sensors="mpu6000")
    with pytest.raises(ParameterError, match="rig buoy has its own frame; leave --frame out"):
        emulated("buoy", tmp_path, frame="ENU")
    frames, _ = emulated("rod", tmp_path, sensors="ideal", unit="calibrated")
    assert np.isfinite(frames.columns["ref.heading"]).all()


@pytest.mark.parametrize(
    ("name", "prefix", "lsb"),
    # size of a count: mpu6000 1/340 K, adxrs290 0.1 K, mpu3050 1/280 K, adis16355 0.1453 K
    [("buoy", "", 1 / 340), ("fin", "", 0.1), ("trackball", "", 1 / 280), ("arm", "u4", 1 / 340), ("rod", "", 0.1453),
     ("ring", "", 1 / 340), ("teach", "u2", 1 / 340)],
)  # fmt: skip
def test_frames_say_how_a_rig_warms_up(name, prefix, lsb, tmp_path):
    rate = PLANS[name].rate
    frames, truth = emulated(name, tmp_path, temp_c="20 degC", warm_up="15 K, 2 s")
    t = np.arange(len(frames)) / rate
    expected = 20.0 + 15.0 * (1.0 - np.exp(-t / 2.0))
    assert np.abs(unit_temperature(frames, prefix) - expected).max() <= 0.5 * lsb * 1.001
    assert expected[-1] - expected[0] > 10.0
    np.testing.assert_allclose(truth.imu.temp_c, expected, atol=1e-5)


def test_temperature_may_be_any_signal_and_moves_the_bias(tmp_path):
    frames, truth = emulated("trackball", tmp_path, temp_c=Polynomial((25.0, 2.0)), duration=10.0)
    assert unit_temperature(frames)[-1] == pytest.approx(25.0 + 2.0 * 9.9, abs=0.01)
    plain = make_rig(PLANS["rod"], find_format("rod"), seed=1, duration=2.0)
    warm = make_rig(PLANS["rod"], find_format("rod"), seed=1, duration=2.0, temp_c=45.0)
    moved = warm.units[""].truth.bias_b - plain.units[""].truth.bias_b
    np.testing.assert_allclose(moved, 20.0 * np.tile(warm.units[""].module.gyr.bias_per_k, (200, 1)), atol=1e-12)
    assert len(truth.imu) == 100


def test_a_high_pass_takes_what_is_steady_and_forgets_a_turn(tmp_path):
    frames, _ = emulated("fin", tmp_path, scenario="static", high_pass="0.5 Hz", duration=20.0)
    gyr = triads_of(frames)["gyr"]
    assert np.abs(gyr.mean(axis=0)).max() < deg(0.02)  # the largest offset of the ADXRS290 is 9 °/s
    plain, _ = emulated("fin", tmp_path, scenario="static", duration=20.0)
    assert np.abs(triads_of(plain)["gyr"].mean(axis=0)).max() > deg(0.5)
    rig = make_rig(PLANS["rod"], find_format("rod"), seed=1, duration=2.0, high_pass=0.5)
    assert [unit.module.gyr.high_pass for unit in rig.units.values()] == [0.5, None]


def heading_off(said, true):
    return np.remainder(said - true + math.pi, 2.0 * math.pi) - math.pi


@pytest.mark.parametrize(("name", "heading", "tilt"), [("rod", 0.2, 0.03), ("ring", 0.8, 0.2)])
def test_references_err_by_what_is_stated(name, heading, tilt):
    off = []
    for seed in range(24):
        rig = make_rig(PLANS[name], find_format(name), seed=seed, duration=1.0, unit="calibrated")
        frames, _ = decode(rig.stream(), rig.form)
        said = [frames[name].columns[f"ref.{key}"] for key in ("heading", "pitch", "roll")]
        true = euler_zyx_from_quat(rig.units["ref"].truth.q_nb)
        off.append([heading_off(one[50], true[50, k]) for k, one in enumerate(said)])
    rms = np.sqrt(np.square(off).mean(axis=0))
    np.testing.assert_allclose(rms, deg(np.array([heading, tilt, tilt])), rtol=0.58)  # 24 runs: 4 standard deviations


def test_a_perfect_reference_says_the_truth_to_half_a_count(tmp_path):
    frames, _ = emulated("ring", tmp_path, reference="ideal", duration=143.0)
    true = euler_zyx_from_quat(plumbob.read(tmp_path / "truth-ref.parquet").track.q_nb)
    for k, key in enumerate(("heading", "pitch", "roll")):
        assert np.abs(heading_off(frames.columns[f"ref.{key}"], true[:, k])).max() <= deg(0.005) * 1.001
    said = frames.columns["ref.heading"]
    assert said.min() >= 0.0  # as the compass counts, from 0° to 360°
    assert said.max() > deg(350.0)
    with pytest.raises(ParameterError, match="buoy has no reference beside its units"):
        emulated("buoy", tmp_path, reference="ideal")


def test_a_disturbed_compass_is_absent_while_the_frame_is_sound():
    """The compass says its own length, sum and digits; the frame around it stays."""
    rig = make_rig(PLANS["ring"], find_format("ring"), seed=1, duration=1.0)
    assert (rig.frames[:, 29:33] == [0x68, 13, 0, 0x84]).all()  # RI-705: 14 bytes, of which the header is not counted
    assert (rig.frames[:, 30:42].sum(axis=1) % 256 == rig.frames[:, 42]).all()
    rows = rig.frames.copy()
    rows[5, 30] = 12
    rows[6, 35] ^= 1
    frames = decode(with_check(rows), rig.form)[0]["ring"]
    assert np.flatnonzero(np.isnan(frames.columns["ref.heading"])).tolist() == [5, 6]
    assert not np.isnan(triads_of(frames)["gyr"]).any()


def test_a_mounting_may_differ_from_the_declared_one():
    angles = []
    for seed in range(30):
        rig = make_rig(PLANS["ring"], find_format("ring"), seed=seed, duration=0.1, mount_error=deg(0.5))
        body, ref = rig.units[""].truth.q_nb, rig.units["ref"].truth.q_nb
        turn = quat_multiply(quat_conjugate(body), ref)
        assert np.abs(turn - turn[0]).max() < 1e-12  # it stays as it is
        angles.append(quat_angle(body[0], ref[0]))
        assert "mounted" in rig.units["ref"].truth.source and "mounted" not in rig.units[""].truth.source
    # three axes of 0.5° each: root mean square √3 · 0.5°; 30 runs of 3 axes, 4 standard deviations
    assert math.sqrt(np.mean(np.square(angles))) == pytest.approx(math.sqrt(3.0) * deg(0.5), rel=4.0 / math.sqrt(180.0))
    arm = make_rig(PLANS["arm"], find_format("arm"), seed=1, duration=1.0, mount_error=deg(1.0))
    declared = {one.prefix: np.array(one.q_bs) for one in PLANS["arm"].units}
    bodies = [quat_multiply(unit.truth.q_nb[0], quat_conjugate(declared[key])) for key, unit in arm.units.items()]
    assert min(quat_angle(bodies[0], one) for one in bodies[1:]) > deg(0.1)  # no reference: every unit


@pytest.mark.parametrize(("name", "most"), [("ring", 5.0), ("rod", 1.0)])
def test_a_session_reads_the_reference_and_the_truth_stays_true(name, most, tmp_path):
    """A recording's track is what the reference said; the truth file is what was so."""
    _, truth = emulated(name, tmp_path, unit="calibrated")
    (tmp_path / "s.toml").write_text(
        f'kind = "plumbob session"\nversion = 1\n[source]\nkind = "file"\npath = "{name}.bin"\n'
        f'[format]\nname = "{name}"\n[imu]\nframe = "NED"\n[reference]\nunit = "ref"\nnorth = "magnetic"\n'
    )
    record(tmp_path / "s.toml", out=tmp_path / "r.mcap")
    read = plumbob.read(tmp_path / "r.mcap")
    made = make_rig(PLANS[name], find_format(name), seed=2, duration=5.0, unit="calibrated").units["ref"]
    assert read.track.frame is Frame.NED
    off = np.abs(heading_off(euler_zyx_from_quat(read.track.q_nb), made.angles))
    assert off.max() < deg(0.01)  # half a count of the wire
    true = plumbob.read(tmp_path / "truth-ref.parquet").track.q_nb
    assert np.abs(true - made.truth.q_nb).max() < 1e-6
    assert deg(0.02) < quat_angle(read.track.q_nb, true).max() < deg(most)
    q_bs = np.array(PLANS[name].units[1].q_bs)
    assert quat_angle(quat_multiply(truth.track.q_nb, q_bs), true).max() < 1e-6


FORM = find_format("buoy_attitude")
BARE = replace(FORM, messages=(replace(FORM.messages[0], fields=FORM.messages[0].fields[1:]),))
WHITE = TriadNoise(n_rpsd=[0.1] * 3, b=[0.0] * 3, k_rpsd=[0.0] * 3)
DEPTH = """
kind = "plumbob format"
version = 1
name = "mine"
title = "Mine"
byte_order = "little"
frame = { sync = "55 AA", length = 6 }
field = [{ name = "depth", type = "f32", unit = "m" }]
"""


def rig(name="buoy", duration=2.0, **how):
    return make_rig(PLANS[name], find_format(name), seed=1, duration=duration, **how)


def own(rate, **how):
    form = parse_format(DEPTH)
    plan = plan_for(form, scenario("buoy"), sensors="ideal", frame=Frame.NED, rate=rate)
    return make_rig(plan, form, seed=1, duration=1.0, **how)


def firmware(rows=200, **how):
    return run_firmware(rig("buoy_attitude").units[""].imu[:rows], **how)


def card_of(name, seed):
    return make_rig(PLANS[name], find_format(name), seed=seed, duration=1.0).units[""].calibration


CASES = [
    (lambda: own(None), ParameterError, "give a rate"),
    (lambda: own(50.0), ParameterError, "no field that a simulation can fill"),
    (lambda: find_format("mpu9999"), ParameterError, r"'mpu9999' is not a known device.* Rigs are arm, buoy"),
    (lambda: rig(faults={"length": 0.1}), ParameterError, "fault length needs a length"),
    (lambda: rig(faults={"fip": 0.1}), ParameterError, "there is no fault 'fip'; known: unplug"),
    (lambda: rig(faults={"flip": 2.0}), ParameterError, "0 to 1, but it is 2"),
    (lambda: rig("teach", mount_error=0.02), ParameterError, "--set mount_angle"),
    (lambda: rig("ring", mount_error=-1.0), ParameterError, "mount_error must be 0 to 180°"),
    (lambda: rig("arm", noise={"u9": NoiseCard("u", "t", gyr=WHITE)}), ParameterError, "no measuring unit 'u9'"),
    (lambda: rig("fin", noise=NoiseCard("unit 8", "t", acc=WHITE)), ParameterError, r"has acc, but adxrs290\+adxrs453"),
    (lambda: rig(calibration=card_of("buoy", 1)), ParameterError, "sends samples as they are"),
    (lambda: firmware(rows=40), ParameterError, "before a frame"),
    # 11.25 ms of each 10 ms
    (lambda: firmware(processor=Processor(clock_hz=4e6)), ParameterError, "too slow"),
    (lambda: firmware(calibration=card_of("buoy_attitude", 6)), CalibrationError, "the card is for device"),
    (lambda: FlashLog(size=4096), ParameterError, "two sectors or more"),
    (lambda: FlashLog().write(bytes(33)), ShapeError, "33 bytes are not a multiple"),
    (lambda: read_ring(bytes(4096), FORM), DecodeError, "no record of buoy_attitude is in the 4096 bytes"),
    (lambda: read_ring(FlashLog().image, FORM), DecodeError, "which are blank, as an erased chip is"),
    (lambda: read_ring(b"", BARE), DecodeError, "cannot be a log's record"),
]


@pytest.mark.parametrize(("make", "error", "match"), CASES)
def test_what_cannot_be_is_refused(make, error, match):
    with pytest.raises(error, match=match):
        make()


LONG = 30.0


class Reader(threading.Thread):
    """Reads a terminal behind a link until told to stop; opens it again when it goes away."""

    def __init__(self, path):
        super().__init__(daemon=True)
        self.path, self.data, self.times, self.opened = path, b"", [], 0
        self.done = threading.Event()

    def run(self):
        while not self.done.is_set():
            try:
                fd = os.open(self.path, os.O_RDWR | os.O_NOCTTY)
            except OSError:
                time.sleep(0.002)
                continue
            self.opened += 1
            try:
                while self._take(fd):
                    pass
            finally:
                os.close(fd)

    def _take(self, fd):
        if not select.select([fd], [], [], 0.05)[0]:
            return not self.done.is_set()
        try:
            data = os.read(fd, 65536)
        except OSError:
            return False
        self.data += data
        if data:
            self.times.append(time.monotonic())
        return bool(data)


@pytest.fixture
def line(tmp_path):
    port = PtyPort(tmp_path / "line")
    reader = Reader(str(tmp_path / "line"))
    reader.start()
    yield port, reader
    reader.done.set()
    reader.join(LONG)


def rig_of(duration, **faults):
    return make_rig(PLANS["buoy"], find_format("buoy"), seed=2, duration=duration, faults=faults)


@pytest.mark.parametrize("speed", [1.0, 10.0])
def test_a_terminal_keeps_the_pace_of_its_speed(line, speed):
    port, reader = line
    rig = rig_of(2.0 * speed)
    served = serve(rig, port, speed=speed, stop=threading.Event())
    port.close()
    reader.done.set()
    reader.join(LONG)
    assert (served.sent, served.lost, served.unheard) == (round(200 * speed), 0, 0)
    assert reader.data == rig.stream()
    took = reader.times[-1] - reader.times[0]
    assert 1.95 < took < 3.9 + 1e-9 * served.latest_ns  # the last frame is due 1.99 s after the first
    assert not os.path.lexists(reader.path)


def test_a_stop_ends_it_soon(line):
    port, _ = line
    stop = threading.Event()
    threading.Timer(0.3, stop.set).start()
    start = time.monotonic()
    served = serve(rig_of(100.0), port, speed=1.0, stop=stop)
    assert time.monotonic() - start < LONG
    assert served.sent < 9_000
    port.close()


def test_as_fast_as_wanted_nothing_is_lost_and_a_replug_is_another_terminal(line):
    port, reader = line
    rig = rig_of(40.0, unplug=0.001, flip=0.01)
    names, seen = [port.name], []
    served = serve(rig, port, speed=None, stop=threading.Event(), on_fault=seen.append)
    names.append(port.name)
    port.close()
    reader.done.set()
    reader.join(LONG)
    unplugged = [f for f in rig.faults if f.kind == "unplug"]
    assert unplugged
    assert tuple(seen) == rig.faults
    assert reader.opened >= 1 + len(unplugged)
    assert reader.data == rig.stream()
    assert served.lost == sum(f.count for f in unplugged)
    assert served.sent + served.lost == len(rig)


def test_in_real_time_the_port_is_away_for_its_second(line):
    """At five times real time, a fifth of it; who opens the new terminal late misses frames, and they are counted."""
    port, reader = line
    rig = rig_of(10.0, unplug=0.002)
    away = [f for f in rig.faults if f.kind == "unplug"]
    assert away
    served = serve(rig, port, speed=5.0, stop=threading.Event())
    port.close()
    reader.done.set()
    reader.join(LONG)
    assert served.sent + served.lost + served.unheard == len(rig)
    assert served.lost == sum(f.count for f in away)
    assert np.diff(reader.times).max() >= 0.99 / 5.0
    frames = decode(reader.data, rig.form)[0]["buoy"]
    assert len(frames) == served.sent


def test_stalled_frames_come_late_but_all_of_them_and_without_a_reader_it_waits():
    rig = rig_of(3.0, stall=0.03)
    out = BytesIO()
    served = serve(rig, FilePort(out, "-"), speed=20.0, stop=threading.Event())
    assert any(f.kind == "stall" for f in rig.faults)
    assert (rig.damage.send_ns - rig.due_ns).max() == 500_000_000
    assert (np.diff(rig.damage.send_ns) >= 0).all()
    assert out.getvalue() == rig.stream()
    assert served.sent == 300
    port, stop = PtyPort(), threading.Event()
    threading.Timer(0.1, stop.set).start()
    assert serve(rig_of(1.0), port, speed=None, stop=stop).sent == 0
    port.close()


def test_what_nobody_hears_is_counted():
    rig = rig_of(2.0)
    port = PtyPort()
    fd = os.open(port.name, os.O_RDWR | os.O_NOCTTY)
    threading.Timer(0.8, os.close, (fd,)).start()  # 0.5 s may be for opening it
    served = serve(rig, port, speed=2.0, stop=threading.Event())
    assert served.unheard > 0
    assert served.sent + served.unheard == len(rig)
    port.close()


@pytest.mark.parametrize(("sets_up", "takes"), [(False, 0.2), (True, 0.8)])
def test_a_reader_that_empties_the_line_in_opening_it_misses_nothing(sets_up, takes):
    """As pyserial does: what is sent between the two would be lost; who has begun may be stalled for longer."""
    rig, port, stop = rig_of(2.0), PtyPort(), threading.Event()
    sender = threading.Thread(target=serve, args=(rig, port), kwargs={"speed": 20.0, "stop": stop})
    sender.start()
    fd = os.open(port.name, os.O_RDWR | os.O_NOCTTY)
    if sets_up:
        modes = termios.tcgetattr(fd)
        modes[6][termios.VMIN] = 0
        termios.tcsetattr(fd, termios.TCSANOW, modes)
    time.sleep(takes)
    termios.tcflush(fd, termios.TCIFLUSH)
    got = b""
    while len(got) < len(rig.stream()) and select.select([fd], [], [], LONG)[0]:
        got += os.read(fd, 65536)
    sender.join(LONG)
    os.close(fd)
    port.close()
    assert got == rig.stream()


def test_a_reader_that_stalls_at_the_end_gets_the_rest():
    """For longer than a line may take that vanishes, before and between its reads."""
    port, data = PtyPort(), bytes(range(256)) * 12
    fd = os.open(port.name, os.O_RDWR | os.O_NOCTTY)
    termios.tcflush(fd, termios.TCIFLUSH)
    assert port.heard()
    assert port.send([data]) == 1
    closing = threading.Thread(target=port.close)
    closing.start()
    got = b""
    for _ in range(2):
        time.sleep(1.2)
        got += os.read(fd, len(data) // 2)
    closing.join(LONG)
    os.close(fd)
    assert got == data


@pytest.mark.parametrize("leaves", [True, False], ids=["leaves", "stays"])
def test_nobody_waits_for_a_reader_that_leaves_or_once_stopped(leaves):
    stop = threading.Event()
    port = PtyPort(stop=stop)
    fd = os.open(port.name, os.O_RDWR | os.O_NOCTTY)
    termios.tcflush(fd, termios.TCIFLUSH)
    assert port.send([bytes(100)]) == 1
    closing = threading.Thread(target=port.close)
    closing.start()
    if leaves:
        os.close(fd)
    else:
        stop.set()
    closing.join(LONG)
    assert not closing.is_alive()
    if not leaves:
        os.close(fd)


def test_a_link_does_not_replace_a_file(tmp_path):
    (tmp_path / "log.bin").write_bytes(b"precious")
    with pytest.raises(ParameterError, match="would destroy it"):
        PtyPort(tmp_path / "log.bin")
    assert (tmp_path / "log.bin").read_bytes() == b"precious"


def test_tcp_serves_one_reader_to_the_last_byte():
    rig, port, got = rig_of(20.0), TcpPort("127.0.0.1", 0), []

    def read():
        with socket.create_connection(("127.0.0.1", int(port.name.rpartition(":")[2])), timeout=LONG) as caller:
            while data := caller.recv(65536):
                got.append(data)

    reader = threading.Thread(target=read)
    reader.start()
    serve(rig, port, speed=None, stop=threading.Event())
    port.close()
    reader.join(LONG)
    assert b"".join(got) == rig.stream()


def test_udp_sends_a_frame_in_a_datagram():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as inbox:
        inbox.bind(("127.0.0.1", 0))
        inbox.settimeout(LONG)
        rig, port = rig_of(0.5), UdpPort("127.0.0.1", inbox.getsockname()[1])
        serve(rig, port, speed=None, stop=threading.Event())
        port.close()
        assert [inbox.recv(2048) for _ in range(50)] == rig.payloads(0, 50)


def test_noise_of_a_million_bytes_passes_through_a_terminal(line):
    port, reader = line
    rig = rig_of(20.0, burst=0.001)
    assert len(rig.stream()) > 1_000_000
    serve(rig, port, speed=None, stop=threading.Event())
    port.close()
    reader.done.set()
    reader.join(LONG)
    assert reader.data == rig.stream()
    found, counts = decode(reader.data, rig.form)
    assert len(found["buoy"]) == len(rig)
    assert counts.junk == 1_000_000 * len(rig.faults)


SHORT = {"buoy": 20.0, "fin": 4.0, "trackball": 20.0, "arm": 6.0, "rod": 10.0, "ring": 8.0, "teach": 5.0}
CLIPPED = {"gyr": flags.GYR_CLIPPED, "acc": flags.ACC_CLIPPED, "mag": flags.MAG_CLIPPED}


def rig_named(name, *, seed=3, duration=None, **more):
    return make_rig(PLANS[name], find_format(name), seed=seed, duration=duration or SHORT[name], **more)


def decoded(rig, data=None):
    found, counts = decode(rig.stream() if data is None else data, rig.form)
    return found[rig.form.messages[0].name], counts


def test_every_rig_has_a_plan_and_a_frame_whose_rate_agree():
    assert set(PLANS) == set(rig_names()) == {*SHORT, "buoy_attitude"}
    for name, plan in PLANS.items():
        assert find_format(name).framing.rate == plan.rate
        least = plan.rate * find_format(name).framing.length * 10  # start bit, eight bits, stop bit
        assert find_format(name).framing.baud > least


@pytest.mark.parametrize("name", SHORT)
def test_bytes_decode_to_what_the_sensors_measured(name):
    """Half a count is the most that rounding may cost; here sensor and wire count alike, so that nothing is."""
    rig = rig_named(name)
    frames, counts = decoded(rig)
    assert len(frames) == len(rig) == round(SHORT[name] * PLANS[name].rate)
    assert (counts.junk, counts.pending) == (0, 0)
    sizes = {f.name: abs(f.scale) for f in rig.form.messages[0].fields if f.physical}
    for prefix, unit in rig.units.items():
        found = triads_of(frames, prefix)
        assert found or unit.angles is not None  # a compass says its angles alone
        for triad, values in found.items():
            want = getattr(unit.imu, triad)
            assert np.array_equal(np.isnan(values), np.isnan(want))
            one = next(f for f in sizes if f.startswith(f"{prefix}.{triad}." if prefix else f"{triad}."))
            clipped = (unit.imu.flags & CLIPPED[triad]) != 0
            assert np.array_equal(clipped, (frames.flags[prefix] & CLIPPED[triad]) != 0)
            assert np.nanmax(np.abs(values - want)[~clipped]) <= 0.5 * sizes[one]


def test_one_seed_one_stream_and_another_another():
    assert rig_named("buoy", duration=2.0).stream() == rig_named("buoy", duration=2.0).stream()
    assert rig_named("buoy", duration=2.0).stream() != rig_named("buoy", duration=2.0, seed=4).stream()


def test_clock_and_counter_tell_each_frame_and_a_fast_clock_runs_away():
    rig = rig_named("fin", duration=140.0)  # past 65536 frames, where the counter wraps
    frames, _ = decoded(rig)
    assert np.array_equal(frames.columns["clock"], np.arange(len(rig)) * 2000)  # 500 Hz in µs
    assert np.array_equal(frames.columns["counter"], np.arange(len(rig)) % 65536)
    frames, _ = decoded(rig_named("buoy", clock_error=4e-5))
    ideal = np.arange(2000) * 10_000.0
    assert np.abs(frames.columns["clock"] - ideal * (1.0 + 4e-5)).max() <= 0.5 + 1e-6  # µs, rounded once


@pytest.mark.parametrize(("name", "options", "field", "ticks"), [
    # 10 ms at 100 Hz: in units of 0.1 ms (Xsens), of 39.0625 us (Bosch), of 1 ns (VectorNav), of 0.79 us down
    ("xbus_mtdata2", {}, "time", 100),
    ("bmi270", {}, "clock", 256),
    ("vectornav_imu", {}, "time", 10_000_000),
    ("ahrs400", {"rr": "200", "gr": "4"}, "time", -10_000 / 0.79),
])  # fmt: skip
def test_a_clock_counts_the_ticks_of_its_device(name, options, field, ticks):
    form = find_format(name).bind(options)
    plan = plan_for(form, scenario("buoy"), sensors="mpu6000+hmc5983", frame=Frame.NED, rate=100.0)
    frames, _ = decoded(make_rig(plan, form, seed=1, duration=1.0))
    width = next(one.width for one in form.message().fields if one.name == field)
    expected = np.rint(np.arange(100) * ticks).astype(np.int64) & ((1 << min(width, 63)) - 1)
    assert np.array_equal(frames.columns[field], expected)


def test_the_magnetometer_is_absent_where_it_has_nothing_new_and_temperature_goes_into_the_frame():
    """75 Hz of the preset in frames of 100 Hz: three of four rows."""
    frames, _ = decoded(rig_named("buoy"))
    absent = (frames.flags[""] & flags.MAG_ABSENT) != 0
    assert absent.mean() == pytest.approx(0.25, abs=1e-3)
    assert np.array_equal(absent, frames.columns["mag_new"] == 0)
    frames, _ = decoded(rig_named("trackball"))
    assert np.abs(unit_temperature(frames) - 25.0).max() <= 0.5 / 280  # K-3050: 280 LSB/°C


def test_a_rate_beyond_the_range_is_clipped_on_the_wire():
    """Twist of 20° and swing of 30° at 1 Hz peak at 126 and 121 °/s on x and y; the ADXRS290 ends at 100 [Ou2017]."""
    fast = replace(PLANS["fin"], scenario=scenario("fin", frequency=1.0))
    rig = make_rig(fast, find_format("fin"), seed=1, duration=2.0, unit="calibrated")
    frames, _ = decoded(rig)
    gyr = triads_of(frames)["gyr"]
    assert np.degrees(np.abs(gyr[:, :2]).max()) == pytest.approx(100.0, abs=1e-9)
    assert ((frames.flags[""] & flags.GYR_CLIPPED) != 0).any()


def test_a_field_beyond_the_range_has_its_own_count():
    """Of 50 µT, dipping 50°, 38 point down and 32 North; 6000 counts per gauss end at 2047/6000 gauss, 34 µT."""
    plan = replace(PLANS["buoy"], scenario=scenario("static"), duration=2.0)
    weak = find_format("buoy")
    fields = tuple(replace(f, counts=6000.0) if f.triad == "mag" else f for f in weak.messages[0].fields)
    fine = replace(weak, messages=(replace(weak.messages[0], fields=fields),))
    frames, _ = decoded(make_rig(plan, fine, seed=1, unit="calibrated"))
    new = frames.columns["mag_new"] == 1
    mag = triads_of(frames)["mag"][new]
    assert np.isnan(mag[:, 2]).all() and not np.isnan(mag[:, :2]).any()
    assert ((frames.flags[""][new] & flags.MAG_CLIPPED) != 0).all()


def test_opposite_units_of_the_arm_measure_opposite_axes():
    """u4 against x, u5 against y, u6 against z; the mean of opposite readings is their bias, not the motion."""
    rig = rig_named("arm", unit="calibrated", duration=30.0)
    frames, _ = decoded(rig)
    mag = {u: triads_of(frames, u)["mag"].mean(axis=0) for u in rig.units}
    for (plus, minus), axis in zip((("u1", "u4"), ("u2", "u5"), ("u3", "u6")), range(3), strict=True):
        half = 0.5 * (mag[plus][axis] - mag[minus][axis])
        assert abs(half) > 10.0
        assert abs(mag[plus][axis] + mag[minus][axis]) < 0.3  # µT; 300 samples of 0.5 µT scatter, two of them: 6 sd


def test_the_rods_reference_says_the_same_attitude_in_its_own_axes():
    """Its y axis is the body's x axis, both z axes point down [Li2012]."""
    rig = make_rig(PLANS["rod"].with_reference("ideal"), find_format("rod"), seed=3, duration=10.0)
    body, ref = rig.units[""].truth.q_nb, rig.units["ref"].truth.q_nb
    q_bs = np.array(PLANS["rod"].units[1].q_bs)
    assert np.abs(quat_multiply(body, q_bs) - ref).max() < 1e-9
    assert np.abs(quat_rotate(q_bs, [0.0, 1.0, 0.0]) - [1.0, 0.0, 0.0]).max() < 1e-12
    assert np.abs(quat_rotate(q_bs, [0.0, 0.0, 1.0]) - [0.0, 0.0, 1.0]).max() < 1e-12
    frames, _ = decoded(rig)
    said = np.stack([frames.columns[f"ref.{name}"] for name in ("heading", "pitch", "roll")], axis=1)
    off = np.remainder(said - euler_zyx_from_quat(ref) + math.pi, 2.0 * math.pi) - math.pi
    assert np.abs(off).max() <= 0.5 * math.pi / 32768 * (1 + 1e-9)


def with_check(rows):
    """Frames whose own check was made after the damage inside."""
    check = of_rows("crc16-ccitt-false", rows[:, 2:-2])
    rows[:, -2], rows[:, -1] = check & 0xFF, check >> 8
    return rows.tobytes()


def test_a_damaged_or_silent_inner_packet_is_absent_while_the_frame_is_sound():
    rig = rig_named("rod", duration=1.0)
    rows = rig.frames.copy()
    rows[5, 28 + 3] ^= 1  # the byte sum of the inner packet does not fit
    rows[7, 28:54] = 0
    frames, counts = decoded(rig, with_check(rows))
    assert (len(frames), counts.junk) == (100, 0)
    assert np.flatnonzero(frames.columns["ref.ahrs500ga.check"] == 0).tolist() == [5]
    assert np.flatnonzero(frames.columns["ref.ahrs500ga.sync0"] == 0).tolist() == [7]
    for name in ("ref.roll", "ref.heading", "ref.gyr.x"):
        assert np.flatnonzero(np.isnan(frames.columns[name])).tolist() == [5, 7]
    assert (frames.flags["ref"][[5, 7]] & flags.GYR_ABSENT).all()
    assert not any(np.isnan(triads_of(frames)[triad]).any() for triad in ("gyr", "acc"))


MINE = beside(__file__, "mine.toml")


def test_a_format_of_ones_own_is_fed_with_the_triads_it_has_and_a_wrong_length_costs_its_frame():
    form = parse_format(MINE)
    plan = plan_for(form, scenario("buoy"), sensors="ideal", frame=Frame.NED, rate=50.0)
    rig = make_rig(plan, form, seed=1, duration=4.0)
    frames, _ = decoded(rig)
    acc = triads_of(frames)["acc"]
    assert np.abs(acc - rig.units[""].imu.acc).max() < 1e-5  # float32 of 1 g: 6e-8 × 9.8 m/s², and more in waves
    assert len(frames) == 200
    plan = plan_for(form, scenario("static"), sensors="mpu6000", frame=Frame.NED, rate=50.0)
    rig = make_rig(plan, form, seed=1, duration=40.0, faults={"length": 0.05})
    frames, _ = decoded(rig)
    assert len(rig) - 2 * len(rig.faults) <= len(frames) <= len(rig) - len(rig.faults)


LINE = [k for k in KINDS if k not in ("unplug", "stall", "reset", "jump", "length", "burst")]


@pytest.mark.parametrize("kind", LINE)
def test_faults_found_are_the_faults_logged(kind):
    """At most one undamaged frame may be lost for each fault; a loss of the frame itself is the fault."""
    rig = rig_named("buoy", duration=30.0, faults={kind: 0.06})
    faults = rig.faults
    assert 100 < len(faults) < 300  # 6 % of 3000
    frames, counts = decoded(rig)
    hit = np.zeros(len(rig), dtype=bool)
    hit[[f.frame for f in faults]] = kind != "noise"
    seen = np.zeros(len(rig), dtype=bool)
    seen[frames.columns["counter"]] = True
    assert (~seen & ~hit).sum() <= len(faults)
    assert not (seen & hit).any() or kind in ("add",)  # a byte added behind the check leaves the frame whole
    assert counts.received == len(rig.stream())
    assert all(rig.stream()[f.at :] for f in faults)


def test_the_log_says_where_a_bit_is_wrong_and_one_kind_of_fault_leaves_the_others_where_they_are():
    clean, rig = rig_named("buoy"), rig_named("buoy", faults={"flip": 0.05})
    a, b = (np.frombuffer(r.stream(), dtype=np.uint8) for r in (clean, rig))
    assert np.flatnonzero(a != b).tolist() == [f.at for f in rig.faults]
    assert np.bitwise_count(a ^ b).sum() == len(rig.faults)
    alone = rig_named("buoy", faults={"flip": 0.05}).faults
    both = rig_named("buoy", faults={"flip": 0.05, "noise": 0.05}).faults
    assert {f.frame for f in alone} == {f.frame for f in both if f.kind == "flip"}


def test_a_reset_clock_and_a_leaping_counter_show_in_the_frames():
    rig = rig_named("buoy", faults={"reset": 0.002, "jump": 0.002}, seed=5)
    frames, _ = decoded(rig)
    assert {f.kind for f in rig.faults} == {"reset", "jump"}
    resets = np.flatnonzero(np.diff(frames.columns["clock"]) < 0) + 1
    leaps = np.diff(frames.columns["counter"]) - 1
    assert resets.tolist() == [f.frame for f in rig.faults if f.kind == "reset"]
    assert (frames.columns["clock"][resets] == 0).all()
    told = {f.frame: f.count for f in rig.faults if f.kind == "jump"}
    assert {int(i) + 1: int(leaps[i]) for i in np.flatnonzero(leaps)} == told


def test_an_unplugged_port_costs_a_second_of_frames():
    rig = rig_named("buoy", faults={"unplug": 0.001})
    assert len(rig.faults) >= 1
    assert all(f.count == 100 for f in rig.faults if f.frame + 100 < len(rig))  # 1 s at 100 Hz
    assert len(rig.stream()) == 31 * (len(rig) - sum(f.count for f in rig.faults))


def test_units_of_a_plan_ride_on_one_motion():
    twins = replace(PLANS["buoy"], units=(RigUnit("mpu6000+hmc5983"), RigUnit("mpu6000+hmc5983", "u2")))
    rig = make_rig(twins, find_format("buoy"), seed=2, duration=2.0)
    assert np.array_equal(rig.units[""].truth.q_nb, rig.units["u2"].truth.q_nb)
    assert not np.array_equal(rig.units[""].imu.gyr, rig.units["u2"].imu.gyr)
    assert rig.units[""].imu.meta.device != rig.units["u2"].imu.meta.device


def test_units_of_the_machine_that_is_taught_ride_on_its_links_and_its_settings_reach_them():
    """A pure turn about j1, the vertical: u1 turns with it, and so does every link behind it."""
    chained = PLANS["teach"].scenario
    rig = rig_named("teach", unit="calibrated", duration=8.0)
    assert list(rig.units) == [one.unit for one in chained.chain.segments if one.unit]
    made = rig.chain
    vertical = [quat_rotate(made.bodies[f"link{k}"].q_nb, made.bodies[f"link{k}"].rate_b)[:, 2] for k in (1, 2, 3)]
    for one in vertical[1:]:  # j2 and j3 turn about level axes, and add nothing about the vertical
        np.testing.assert_allclose(one, vertical[0], atol=1e-12)
    frames, _ = decoded(rig)
    np.testing.assert_allclose(-triads_of(frames, "u1")["gyr"][:, 2].mean(), vertical[0].mean(), atol=2e-3)
    plain, off = (
        make_rig(replace(PLANS["teach"], scenario=one), find_format("teach"), seed=2, duration=2.0).chain
        for one in (PLANS["teach"].scenario, replace(PLANS["teach"].scenario, settings={"mount_angle": "5 deg"}))
    )
    assert plain.mounts == {one.unit: one.mount for one in plain.chain.segments if one.unit}
    assert all(off.mounts[name].q_bs != plain.mounts[name].q_bs for name in plain.mounts)
    assert {one.unit: one.mount for one in off.true_chain.segments if one.unit} == off.mounts
