"""Rigs with other noise, parts, temperatures, a high-pass, and references with errors of their own."""

import math
from dataclasses import replace

import numpy as np
import pytest

import plumbob
from plumbob import record
from plumbob.core.errors import CalibrationError, DecodeError, ParameterError, ShapeError
from plumbob.core.units import deg
from plumbob.data.cards import NoiseCard, TriadNoise
from plumbob.live.emulated import unit_file
from plumbob.live.rigs.firmware import FlashLog, Processor, run_firmware
from plumbob.live.rigs.rig import PLANS, make_rig, plan_for
from plumbob.protocols.checksum import of_rows
from plumbob.protocols.decode import decode, triads_of, unit_temperature
from plumbob.protocols.format_toml import find_format, parse_format
from plumbob.protocols.ring import read_ring
from plumbob.rotations import Frame, euler_zyx_from_quat, quat_angle, quat_conjugate, quat_multiply
from plumbob.simulation import scenario
from plumbob.simulation.signals import Polynomial

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
    check = of_rows("crc16-ccitt-false", rows[:, 2:-2])
    rows[:, -2], rows[:, -1] = check & 0xFF, check >> 8
    frames = decode(rows.tobytes(), rig.form)[0]["ring"]
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
    (lambda: firmware(take="median"), ParameterError, "take must be one of"),
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
