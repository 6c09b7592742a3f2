"""Guided captures by hand, on a rate table, and the static test."""

import functools
import json
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from plumbob import AttitudeTrack, North, apply_card
from plumbob.calibration.acc import calibrate_accel
from plumbob.calibration.calibrate_gyro import (
    Plateau,
    calibrate_by_hand,
    calibrate_table,
    fit_gyro,
    found_plateaus,
)
from plumbob.calibration.calibrate_mag import calibrate_mag
from plumbob.calibration.calibration import Capture, capture, card_of
from plumbob.calibration.fit import CaptureRefusedError
from plumbob.calibration.mount import mount_by_poses, mount_by_reference
from plumbob.core.constants import G0
from plumbob.core.errors import CalibrationError, DecodeError, FrameError, ParameterError
from plumbob.core.units import deg, dps
from plumbob.door.calibrate import read_plan
from plumbob.papers.static_test import static_test
from plumbob.rotations import Frame, change_frame, quat_conjugate, quat_multiply, quat_rotate, rotvec_from_quat
from plumbob.simulation import EulerMotion, Module, Scenario, TriadErrors, simulate
from plumbob.simulation.signals import Moves, constant
from tests.helpers import is_plain
from tests.helpers.refusals import reason_kinds, reasons

# Axes of the accelerometer are those of the case, because its poses do not show a turn of them.
UNIT = Module(
    "unit",
    "test",
    gyr=TriadErrors(
        white_rpsd=dps(0.005),
        bias=dps(np.array([1.5, -2.0, 0.7])),
        scale=[0.01, -0.01, 0.02],
        misalignment=[[0.0, 0.01, -0.005], [0.008, 0.0, 0.012], [-0.01, 0.004, 0.0]],
    ),
    acc=TriadErrors(white_rpsd=4e-3, bias=[0.2, -0.3, 0.1], scale=[0.01, -0.02, 0.015]),
    mag=TriadErrors(
        white_sd=0.2,
        hard_iron=[13.0, -24.0, 10.0],
        scale=[0.03, -0.02, 0.05],
        misalignment=[[0.0, 0.02, 0.01], [-0.02, 0.0, 0.03], [0.01, -0.01, 0.0]],
    ),
)


@pytest.fixture(scope="module")
def simulated():
    return simulate("poses", frame=Frame.NED, sensors=UNIT, unit="random", seed=1, number=18, rate=50.0, move=2.0)


@pytest.fixture(scope="module")
def whole(simulated) -> Capture:
    return capture(simulated.imu, triads=("acc",), if_present=("gyr", "mag"))


@pytest.fixture(scope="module")
def fits(whole):
    return calibrate_by_hand(whole, strength=50.0)


def triads_of(card):
    """What a card's file says of each triad."""
    return {name: json.loads(card.text())[name] for name in ("gyr", "acc", "mag")}


def help_of(on):
    """What a capture's card says of the sensors that help the magnetometer."""
    return {"gyr_calibrated": on.calibrated("gyr"), "acc_calibrated": on.calibrated("acc")}


def test_every_planted_error_is_found(simulated, fits):
    assert list(fits) == ["acc", "gyr", "mag"]
    for name, fit in fits.items():
        found, truth = fit.calibration, getattr(simulated.calibration, name)
        off = np.r_[found.bias - truth.bias, (found.matrix - truth.matrix).ravel()]
        assert (np.abs(off) <= 5.0 * np.sqrt(np.diag(found.covariance)) + 1e-12).all(), name


def test_each_is_found_with_the_card_of_those_before_which_is_replaced_and_not_applied_twice(whole, fits):
    """The same bits as one kind after the other, each given the card of the last."""
    card, steps = None, {}
    for name, fit in (
        ("acc", lambda on: calibrate_accel(on.imu)),
        ("gyr", lambda on: fit_gyro(on, "auto")),
        ("mag", lambda on: calibrate_mag(on.imu, strength=50.0, **help_of(on))),
    ):
        on = capture(whole.imu, triads=(name,), base=card)
        steps[name] = fit(on)
        card = card_of(on, {name: steps[name]})
    assert triads_of(card) == triads_of(card_of(whole, fits))
    assert steps["gyr"].remarks == fits["gyr"].remarks
    again = capture(whole.imu, triads=("acc",), if_present=("gyr", "mag"), base=card_of(whole, fits))
    assert np.array_equal(again.imu.mag, whole.imu.mag)
    assert triads_of(card_of(again, calibrate_by_hand(again, strength=50.0))) == triads_of(card_of(whole, fits))


def test_what_the_recording_lacks_is_left_out(whole):
    assert list(calibrate_by_hand(replace(whole, imu=replace(whole.imu, mag=None)))) == ["acc", "gyr"]
    alone = replace(whole.imu, mag=None, gyr=None)
    assert list(calibrate_by_hand(replace(whole, imu=alone))) == ["acc"]
    with pytest.raises(CalibrationError, match="has no acc"):
        capture(replace(whole.imu, acc=None), triads=("acc",), if_present=("gyr", "mag"))


def turned_to_one_side(imu):
    return replace(imu, acc=np.tile([0.0, 0.0, -9.8], (len(imu), 1)))


def late_magnet(imu):
    """A magnet that is put beside the unit halfway."""
    return replace(imu, mag=imu.mag + np.where(imu.t[:, np.newaxis] > 0.5 * imu.t[-1], [30.0, 0.0, 0.0], 0.0))


def rates_of_another_hour(imu):
    return replace(imu, gyr=imu.gyr[::-1])


@pytest.mark.parametrize(("change", "kinds", "start", "advice"), [
    (turned_to_one_side, {"too-few-regions"}, "accelerometer: no pose", "so it comes first."),
    (rates_of_another_hour, None, "gyroscope: ", "'plumbob calibrate accel' alone would do"),
    pytest.param(
        late_magnet,
        {"magnet-moved", "outliers"},
        "magnetometer: ",
        "'plumbob calibrate accel', then 'gyro', would do",
        marks=pytest.mark.skipif(is_plain(), reason="a quarter of a minute as plain Python"),
    ),
])  # fmt: skip
def test_a_triad_that_cannot_be_calibrated_refuses_all(whole, change, kinds, start, advice):
    """The reasons name it, and what would do."""
    found = reasons(calibrate_by_hand, replace(whole, imu=change(whole.imu)))
    assert kinds is None or {reason.kind for reason in found} & kinds
    assert found[0].text.startswith(start)
    assert advice in "".join(reason.advice for reason in found)


NOMINAL = dps(np.array([50.0, 100.0, 200.0]))
COUPLING = dps(np.array([[0.05, -0.03, 0.02], [0.04, 0.06, -0.05], [-0.02, 0.03, 0.07]])) / G0
GYR = TriadErrors(
    bias=dps(np.array([3.0, -12.0, 1.0])), scale=(0.02, -0.01, 0.005),
    misalignment=((0.0, 0.004, -0.006), (-0.003, 0.0, 0.005), (0.002, 0.007, 0.0)), g_sensitivity=COUPLING,
    white_rpsd=dps(0.005), full_scale=dps(250.0),
)  # fmt: skip
HEADER = "from_s,to_s,rate_x_dps,rate_y_dps,rate_z_dps"


def turned_by_table(**changes):
    unit = Module("unit", "test", gyr=changes.pop("gyr", GYR), acc=TriadErrors(white_rpsd=1e-3))
    return simulate("ratetable", frame=Frame.NED, sensors=unit, unit="random", seed=4, hold=4.0, **changes)


@pytest.fixture(scope="module")
def made():
    return turned_by_table()


@pytest.fixture(scope="module")
def session(made):
    return capture(made.imu, triads=("gyr",))


@pytest.fixture(scope="module")
def planned(session):
    plateaus, remarks = found_plateaus(session.imu, NOMINAL)
    assert len(plateaus) == 42 and not remarks
    return plateaus


@pytest.fixture(scope="module")
def fitted(session, planned):
    return calibrate_table(session, planned)


def test_the_card_is_the_perfect_one_within_what_it_claims_and_makes_the_rates_right(made, session, planned, fitted):
    found = calibrate_table(session, planned, mounting=0.0).calibration
    perfect = made.calibration.gyr
    for name, sd in (("bias", found.bias_sd), ("matrix", found.matrix_sd), ("g_sensitivity", found.g_sensitivity_sd)):
        # 21 numbers: 4.5 standard deviations leave 1 chance in 7000
        assert (np.abs(getattr(found, name) - getattr(perfect, name)) < 4.5 * sd).all(), name
    # 0.005 °/s/√Hz over the 3 s that are left of 4 s: 0.0029 °/s
    assert found.bias_sd.max() < dps(0.0029) / np.sqrt(42) * 1.5
    assert found.temp_ref_c == 25.0
    applied = apply_card(card_of(session, {"gyr": fitted}), made.imu)
    for plateau in planned:
        inside = (applied.t >= plateau.start) & (applied.t < plateau.stop)
        # 6 standard deviations of the mean of 3 s and of the fit
        np.testing.assert_allclose(applied.gyr[inside].mean(axis=0), plateau.rate, rtol=0, atol=6.0 * dps(0.0029))


def test_what_is_missing_or_clipped_is_refused_and_can_be_left_out(made, session):
    clipped = turned_by_table(gyr=TriadErrors(bias=GYR.bias, white_rpsd=dps(0.005), full_scale=dps(150.0)))
    whole = capture(clipped.imu, triads=("gyr",))
    planned, _ = found_plateaus(whole.imu, dps(np.array([50.0, 100.0, 150.0])))
    assert reason_kinds(calibrate_table, whole, planned)[0] == "clipping"
    planned, remarks = found_plateaus(whole.imu, dps(np.array([50.0, 100.0])))
    assert len(planned) == 30 and len(remarks) == 12 and "is left out" in remarks[0]
    assert calibrate_table(whole, planned).calibration.quality.samples == 30
    half = capture(made.imu, triads=("gyr",), span=(0.0, made.imu.t[-1] / 4.0))
    for analyse, error, words in (
        (lambda: calibrate_table(half, found_plateaus(half.imu, NOMINAL)[0]), CaptureRefusedError, "few.*about x or y"),
        (lambda: found_plateaus(session.imu, [2.0, 3.0]), CaptureRefusedError, "rates found are, in °/s"),
        (lambda: calibrate_table(session, [Plateau(9e3, 9001.0, np.zeros(3))]), ParameterError, "holds no sample"),
    ):
        with pytest.raises(error, match=words):
            analyse()


def test_a_plan_says_rates_and_specific_force(tmp_path, session, planned, fitted):
    path = tmp_path / "plan.csv"
    rows = [(plateau.start, plateau.stop, *np.degrees(plateau.rate).tolist()) for plateau in planned]
    path.write_text("\n".join((HEADER, *(", ".join(map(repr, row)) for row in rows))) + "\n")
    read = calibrate_table(session, read_plan(path)).calibration
    np.testing.assert_allclose(read.bias, fitted.calibration.bias, rtol=1e-12)
    path.write_text(f"{HEADER},acc_x_g,acc_y_g,acc_z_g\n0,5,0,0,90,0.0,0.5,-1\n")
    (one,) = read_plan(path)
    np.testing.assert_allclose(one.rate, [0.0, 0.0, np.pi / 2.0], rtol=1e-15)
    np.testing.assert_allclose(one.force, [0.0, 0.5 * G0, -G0], rtol=1e-15)
    assert (one.start, one.stop) == (0.0, 5.0)


@pytest.mark.parametrize(("text", "words"), [
    (f"{HEADER}\n0,5,0,0,9\n5,9,0,0,fast\n", "line 3: rate_z_dps must be a number, but it is 'fast'"),
    (f"{HEADER}\n0,5,0,0\n", "line 2: rate_z_dps must be a number, but it is"),
    (f"{HEADER}\n0,5,0,0,9,4\n", "line 2: a column too many"),
    (f"{HEADER}\n5,5,0,0,9\n", "line 2: numbers must be finite, and from_s before to_s"),
    (f"{HEADER}\n0,5,0,0,nan\n", "line 2: numbers must be finite"),
    ("from_s,to_s,rate_x,rate_y,rate_z\n", "line 1: the columns must be from_s, to_s, rate_x_dps"),
    (f"{HEADER},acc_x_g\n", "line 1: .*all or none of acc_x_g"),
    ("", "line 1: .* they are none"),
    ("\udcff\udcfe", "not UTF-8 text"),
])  # fmt: skip
def test_a_bad_plan_is_refused_by_its_line(tmp_path, text, words):
    path = tmp_path / "plan.csv"
    path.write_bytes(text.encode(errors="surrogateescape"))
    with pytest.raises(DecodeError, match=words):
        read_plan(path)


def test_what_the_card_so_far_means_is_said(made, session, planned, fitted):
    warm = replace(made.calibration, gyr=replace(made.calibration.gyr, bias_per_k=np.full(3, 1e-4)))
    based = calibrate_table(capture(made.imu, triads=("gyr",), base=warm), planned)
    uncoupled = calibrate_table(session, planned, model="12")
    for words, fit, times in (
        ("polynomial of temperature is gone", based, 1),
        ("accelerometer is not calibrated", based, 0),
        ("accelerometer is not calibrated", fitted, 1),
        ("accelerometer is not calibrated", uncoupled, 0),
    ):
        assert sum(words in str(remark) for remark in fit.remarks) == times


IRON = 8.0  # µT along the unit's nose
LEVEL = 50.0 * np.cos(deg(50.0))  # level part of the simulator's field, µT


def on_table(frame=Frame.NED, *, seed=1, acc=None, mag=None, **settings):
    unit = Module("unit", "test", gyr=TriadErrors(), acc=acc or TriadErrors(), mag=mag or TriadErrors())
    return simulate("table36", frame=frame, sensors=unit, unit="random", seed=seed, rate=20.0, **settings)


@pytest.fixture(scope="module")
def iron():
    return on_table(mag=TriadErrors(hard_iron=[IRON, 0.0, 0.0]), tilt=0.0)


def test_iron_along_the_nose_deviates_a_level_compass_as_the_triangle_says_and_so_does_json(iron):
    test = static_test(iron.imu, reference=iron.truth, calibration=iron.calibration)
    assert test.spans.shape == (36, 2)
    heading = deg(10.0) * np.arange(36)
    # the level field in the body is H (cos ψ, −sin ψ) + (h, 0), and the compass reads the angle back from it
    reads = np.arctan2(LEVEL * np.sin(heading), LEVEL * np.cos(heading) + IRON)
    deviation = np.angle(np.exp(1j * (reads - heading)))
    np.testing.assert_allclose(test.errors("before")[:, 0], deviation, atol=1e-12)
    np.testing.assert_allclose(test.errors("before")[:, 1:], 0.0, atol=1e-12)
    np.testing.assert_allclose(test.errors("after"), 0.0, atol=1e-12)
    worst = np.arcsin(IRON / LEVEL)  # where field and iron make a right angle; of 36 headings one is within 5° of it
    assert 0.98 * worst < test.before.stats["yaw"].max_abs <= worst
    told = test.summary()
    assert (len(told["rests"]), told["rests"][9]["reference_deg"]["yaw"]) == (36, pytest.approx(90.0))
    worst = max(abs(rest["before_deg"]["yaw"]) for rest in told["rests"])
    assert told["summary"]["yaw"]["max_before_deg"] == pytest.approx(worst)
    (yaw,) = [line.split() for line in test.text().splitlines() if line.startswith("yaw ")]
    assert yaw[1] == f"{worst:.2f}"


@pytest.mark.parametrize("frame", list(Frame))
def test_a_perfect_card_leaves_nothing_on_the_slant_table_in_any_frame(frame):
    acc = TriadErrors(bias=[0.3, -0.2, 0.4], scale=[0.02, -0.03, 0.01])
    made = on_table(frame, acc=acc, mag=TriadErrors(hard_iron=[4.0, -6.0, 3.0], scale=[0.1, -0.1, 0.05]))
    test = static_test(made.imu, reference=made.truth, calibration=made.calibration)
    np.testing.assert_allclose(test.errors("after"), 0.0, atol=1e-12)
    assert (np.abs(test.errors("before")).max(axis=0) > deg(1.0)).all()


def test_noise_is_averaged_over_a_rest():
    sd = 0.02
    made = on_table(acc=TriadErrors(white_sd=[sd] * 3), tilt=0.0)
    pitch = static_test(made.imu, reference=made.truth, calibration=made.calibration).errors("after")[:, 1]
    samples = 12 * 4  # of a rest of 3 s at 20 Hz at least 48 are in blocks of 1/4 s that lie wholly in it
    # 3 sd: the rms of 36 has a relative sd of 0.12
    assert np.sqrt(np.mean(pitch**2)) < 1.36 * sd / 9.80665 / np.sqrt(samples)


def test_a_constant_heading_between_the_two_is_removed_where_asked_and_untold_rests_are_left_out(iron):
    turned = replace(iron.truth, north=North.FREE)
    free = static_test(iron.imu, reference=turned, calibration=iron.calibration)
    assert np.isnan(free.errors("after")[:, 0]).all() and "arbitrary zero" in free.text()
    aligned = static_test(iron.imu, reference=turned, calibration=iron.calibration, align=("heading",))
    np.testing.assert_allclose(aligned.errors("after")[:, 0], 0.0, atol=1e-12)
    assert any("was removed" in str(remark) for remark in aligned.remarks)
    known = (iron.truth.t > 20.0) & (iron.truth.t < 60.0)  # 10 cycles of 4 s
    part = AttitudeTrack(
        t=iron.truth.t[known], q_nb=iron.truth.q_nb[known], frame=iron.truth.frame, north=iron.truth.north
    )
    assert len(static_test(iron.imu, reference=part, calibration=iron.calibration).spans) == 10


def test_magnetic_and_true_headings_meet_by_a_declination(iron):
    made = on_table(declination=deg(5.0))
    moving = simulate("tumble", frame=Frame.NED, sensors="ideal", unit="random", seed=1)
    # a recording that does not know its declination has magnetic headings
    magnetic = made.imu.corrected(meta=replace(made.imu.meta, declination=None))
    test = static_test(magnetic, reference=made.truth, calibration=made.calibration, declination=deg(5.0))
    np.testing.assert_allclose(test.errors("after"), 0.0, atol=1e-12)
    for imu, truth, card, error, words in (
        (magnetic, made.truth, made.calibration, FrameError, "declination"),
        (moving.imu, moving.truth, moving.calibration, CaptureRefusedError, "^too-few"),
        (iron.imu, iron.truth, moving.calibration, CalibrationError, "card is for device"),
    ):
        with pytest.raises(error, match=words):
            static_test(imu, reference=truth, calibration=card)


Q_BS = np.array([0.5, -0.7, 0.1, 0.4])
Q_BS = Q_BS / np.linalg.norm(Q_BS)
MOUNTING_UNIT = Module(
    "unit", "test", gyr=TriadErrors(white_rpsd=dps(0.005), bias=dps(1.0)), acc=TriadErrors(white_rpsd=4e-3)
)


class Raising(Scenario):
    """Level for 5 s, then moved by yaw, pitch and roll in 3 s each, with 5 s of rest after each move."""

    moves = ((0.0, deg(30.0), 0.0),)

    @property
    def duration(self):
        return 5.0 + 8.0 * len(self.moves)

    def motion(self, rng, duration):
        start = 5.0 + 8.0 * np.arange(len(self.moves))
        return EulerMotion(Frame.NED, Moves(start, np.full(start.size, 3.0), self.moves) + constant((0.5, 0.0, 0.0)))


class Turning(Raising):
    moves = ((deg(25.0), deg(30.0), 0.0),)


class Wandering(Raising):
    moves = ((0.0, deg(30.0), 0.0), (0.0, -deg(30.0), deg(25.0)))


class Returning(Raising):
    moves = ((0.0, deg(30.0), 0.0), (0.0, -deg(30.0), 0.0))


@functools.cache
def raised(scenario=Raising, frame=Frame.NED, seed=2):
    """Simulation of a body, and the capture of a unit that is mounted on it by Q_BS."""
    sim = simulate(scenario(), frame=frame, sensors=MOUNTING_UNIT, unit="random", seed=seed)
    turned = {name: quat_rotate(quat_conjugate(Q_BS), getattr(sim.imu, name)) for name in ("gyr", "acc")}
    return sim, capture(sim.imu.corrected(meta=sim.imu.meta, **turned), triads=())


def error(found):
    return rotvec_from_quat(quat_multiply(found.mount.q_bs, quat_conjugate(Q_BS)))


def kind_of(unit, **options):
    """Why a capture gives no mounting."""
    return reason_kinds(mount_by_poses, unit, frame=Frame.NED, **options)[0]


@pytest.mark.parametrize("frame", Frame)
@pytest.mark.parametrize("scenario", [Raising, Returning])
def test_rests_are_found_and_give_the_planted_mounting(frame, scenario):
    sim, unit = raised(scenario, frame)
    found = mount_by_poses(unit, frame=frame)
    assert (np.abs(error(found)) < 4.5 * found.mount.sd).all()
    # 0.004 m/s²/√Hz over 4 s and more of rest: 0.002 m/s², a hundredth of a degree
    assert found.mount.sd.max() < 3.0 * deg(0.012)
    applied = apply_card(card_of(unit, {}, mounted=found), unit.imu)
    tilt = quat_rotate(quat_conjugate(sim.truth.q_nb), G0 * frame.up)
    still = slice(0, 450)
    np.testing.assert_allclose(applied.acc[still].mean(axis=0), tilt[still].mean(axis=0), rtol=0, atol=6.0 * 0.002)
    last = slice(-400, None)
    np.testing.assert_allclose(applied.acc[last].mean(axis=0), tilt[last].mean(axis=0), rtol=0, atol=12.0 * 0.002)


def test_spans_and_turns_are_seen():
    _, unit = raised(Wandering)
    found = mount_by_poses(unit, frame=Frame.NED, level=(0.0, 5.0), raised=(8.0, 13.0))
    assert (np.abs(error(found)) < 4.5 * found.mount.sd).all()
    assert kind_of(unit) == "no-motion"  # three poses: which is raised?
    assert kind_of(unit, level=(5.5, 7.5), raised=(8.0, 13.0)) == "not-still"
    assert kind_of(unit, level=(0.0, 5.0), raised=(90.0, 99.0)) == "not-still"
    _, unit = raised(Turning)
    assert kind_of(unit) == "no-motion"
    blind = replace(unit, imu=replace(unit.imu, gyr=None))
    found = mount_by_poses(blind, frame=Frame.NED)  # a turn about the vertical does not harm what forces say
    assert (np.abs(error(found)) < 4.5 * found.mount.sd).all()
    assert any("no gyroscope checked" in str(remark) for remark in found.remarks)


def test_what_is_refused_and_what_is_remarked():
    sim, unit = raised()
    blind = replace(unit, imu=replace(unit.imu, acc=None))
    remarks = {
        key: " ".join(map(str, mount_by_poses(unit, frame=Frame.NED, level_only=key).remarks)) for key in (False, True)
    }
    assert "heading was not measured" in remarks[True] and "not calibrated" in remarks[False]
    assert kind_of(capture(unit.imu[:450], triads=())) == "no-motion"
    assert kind_of(capture(unit.imu[550:750], triads=())) == "not-still"
    assert kind_of(unit, level=(0.0, 4.0), raised=(1.0, 4.5)) == "ill-conditioned"
    poses, reference = partial(mount_by_poses, frame=Frame.NED), lambda t, **by: mount_by_reference(replace(t, **by), t)
    for mount, given, options, error, words in (
        (poses, unit, {"raised": (8.0, 13.0), "level_only": True}, ParameterError, "leave out one"),
        (poses, unit, {"raised": (8.0, 13.0)}, ParameterError, "belong together"),
        (poses, blind, {}, ParameterError, "no acc"),
        (reference, sim.truth, {"north": North.FREE}, FrameError, "arbitrary zero"),
        (reference, sim.truth, {"north": North.MAGNETIC}, FrameError, "magnetic north"),
    ):
        with pytest.raises(error, match=words):
            mount(given, **options)


@pytest.mark.parametrize("frame", Frame)
def test_a_reference_in_any_frame_gives_the_mounting(frame):
    sim, _ = raised(Returning)
    ours = sim.truth.with_attitude(quat_multiply(sim.truth.q_nb, Q_BS))
    theirs = sim.truth.with_attitude(change_frame(sim.truth.q_nb, to=frame, from_=Frame.NED), frame=frame)
    assert np.abs(error(mount_by_reference(ours, theirs))).max() < 1e-12
