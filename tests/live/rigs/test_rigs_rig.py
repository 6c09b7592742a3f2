"""What a rig says on the wire is what its sensors measured, and every fault on the way is known."""

import math
from dataclasses import replace

import numpy as np
import pytest

from plumbob.core import flags
from plumbob.live.rigs.faults import KINDS
from plumbob.live.rigs.rig import PLANS, RigUnit, make_rig, plan_for
from plumbob.protocols.checksum import of_rows
from plumbob.protocols.decode import decode, triads_of, unit_temperature
from plumbob.protocols.format_toml import find_format, parse_format, rig_names
from plumbob.rotations import Frame, euler_zyx_from_quat, quat_multiply, quat_rotate
from plumbob.simulation import scenario
from tests.helpers import beside

SHORT = {"buoy": 20.0, "fin": 4.0, "trackball": 20.0, "arm": 6.0, "rod": 10.0, "ring": 8.0, "teach": 5.0}
CLIPPED = {"gyr": flags.GYR_CLIPPED, "acc": flags.ACC_CLIPPED, "mag": flags.MAG_CLIPPED}


def rig_of(name, *, seed=3, duration=None, **more):
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
    rig = rig_of(name)
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
    assert rig_of("buoy", duration=2.0).stream() == rig_of("buoy", duration=2.0).stream()
    assert rig_of("buoy", duration=2.0).stream() != rig_of("buoy", duration=2.0, seed=4).stream()


def test_clock_and_counter_tell_each_frame_and_a_fast_clock_runs_away():
    rig = rig_of("fin", duration=140.0)  # past 65536 frames, where the counter wraps
    frames, _ = decoded(rig)
    assert np.array_equal(frames.columns["clock"], np.arange(len(rig)) * 2000)  # 500 Hz in µs
    assert np.array_equal(frames.columns["counter"], np.arange(len(rig)) % 65536)
    frames, _ = decoded(rig_of("buoy", clock_error=4e-5))
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
    frames, _ = decoded(rig_of("buoy"))
    absent = (frames.flags[""] & flags.MAG_ABSENT) != 0
    assert absent.mean() == pytest.approx(0.25, abs=1e-3)
    assert np.array_equal(absent, frames.columns["mag_new"] == 0)
    frames, _ = decoded(rig_of("trackball"))
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
    rig = rig_of("arm", unit="calibrated", duration=30.0)
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
    rig = rig_of("rod", duration=1.0)
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
    rig = rig_of("buoy", duration=30.0, faults={kind: 0.06})
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
    clean, rig = rig_of("buoy"), rig_of("buoy", faults={"flip": 0.05})
    a, b = (np.frombuffer(r.stream(), dtype=np.uint8) for r in (clean, rig))
    assert np.flatnonzero(a != b).tolist() == [f.at for f in rig.faults]
    assert np.bitwise_count(a ^ b).sum() == len(rig.faults)
    alone = rig_of("buoy", faults={"flip": 0.05}).faults
    both = rig_of("buoy", faults={"flip": 0.05, "noise": 0.05}).faults
    assert {f.frame for f in alone} == {f.frame for f in both if f.kind == "flip"}


def test_a_reset_clock_and_a_leaping_counter_show_in_the_frames():
    rig = rig_of("buoy", faults={"reset": 0.002, "jump": 0.002}, seed=5)
    frames, _ = decoded(rig)
    assert {f.kind for f in rig.faults} == {"reset", "jump"}
    resets = np.flatnonzero(np.diff(frames.columns["clock"]) < 0) + 1
    leaps = np.diff(frames.columns["counter"]) - 1
    assert resets.tolist() == [f.frame for f in rig.faults if f.kind == "reset"]
    assert (frames.columns["clock"][resets] == 0).all()
    told = {f.frame: f.count for f in rig.faults if f.kind == "jump"}
    assert {int(i) + 1: int(leaps[i]) for i in np.flatnonzero(leaps)} == told


def test_an_unplugged_port_costs_a_second_of_frames():
    rig = rig_of("buoy", faults={"unplug": 0.001})
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
    rig = rig_of("teach", unit="calibrated", duration=8.0)
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
