"""The fin paper [Ou2017]: attitude of a bionic fin by three MEMS gyroscopes, and their noise by Allan variance.

The paper's method takes the mean of a rest off the rates of a unit as it left the line; ours adds a card by six turns
against stops, which gyroscopes alone allow. Its Allan plot is read by lines of fixed slope; ours is a likelihood. Rates
go through the bytes of the rig ``fin``; swims over seeds and records of many are simulated directly.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Final

import numpy as np

import plumbob as pb
from plumbob.papers.studies import ANGLES, PlotCurve, Study, errors_deg, largest, rms

PARTS: Final = "adxrs290+adxrs453"
RATE: Final = 500.0  # [Ou2017] step 8: samples per second, Hz
COUNT: Final = 110_000  # samples of its record
LOOKS: Final = 4  # instants of a swim at which the error is compared with what is claimed, the last its end
LATE: Final = (0.0, 0.0, 0.004)  # of each axis, s: the group delay that the ADXRS453's sheet states
SWIM: Final = {"swing": math.radians(30.0), "twist": math.radians(20.0), "frequency": 0.5, "lag": math.radians(90.0)}
"""What speed, swing and twist of the three motors make of the fin, rad and Hz: assumed; the drawing has no numbers."""
LENGTH: Final = COUNT / RATE
SIGMA: Final = 0.664  # what the printed flat is divided by for B: √(2 ln 2/π) to three digits
LIVE: Final = '\n[imu]\nframe = "NED"\n[estimate]\nfilter = "integrate"\ninit = "level"\n'
"""Of a session that estimates while it records: quaternion integration from a level start."""
CORNERS: Final = (0.011, 0.5)  # of a high-pass, Hz: the ADXRS290's lowest, and one within the swimming
TEMPCO: Final = np.array([0.004, -0.006, 0.004])
"""Bias per kelvin that is assumed for x, y and z, °/s/K: no sheet at hand states one."""
REST: Final = "20 s"  # how long the unit rests before it swims
ARC_SECOND: Final = float(pb.units.deg(1.0)) / 3600.0
UNITS: Final = dict.fromkeys("QNB", ARC_SECOND)
"""Units in which Table 1 fits together: seconds of arc, °/h at 1 s, and °/h."""
READ_AT: Final = {"Q": math.sqrt(3.0), "N": 1.0, "B": math.sqrt(3.0)}
"""Averaging time of each ± of the paper, s; B of 453z has that of Q."""
AXES: Final = ("290x", "290y", "453z")
PRINTED: Final = {"Q": (0.125, 0.132, 0.107), "N": (4.766, 6.509, 15.066), "B": (1.138, 2.585, 57.056)}
"""Table 1, its B as a flat."""
THREE: Final = {"Q": 4.4, "N": 60.0 * 0.9, "B": 51.5}
"""Three regimes that 220 s show on every axis, in the units of Table 1."""
FACTORS: Final = (500, 750, 866, 1581)  # samples of 1, 1.5, √3 and √10 s


def percent_error(tau: float) -> float:
    """Share of a deviation at the averaging time tau, s, that may be wrong [Ou2017] (7)."""
    return 1.0 / math.sqrt(2.0 * (LENGTH / tau - 1.0))  # [Ou2017] (7)


def gyr(imu: Any) -> Any:
    """Rates (N, 3), °/s."""
    return pb.units.to_dps(np.asarray(imu.gyr))


def integrate(imu: Any, start: Any = "level") -> Any:
    """Attitude by quaternion integration."""
    return pb.Filter("integrate", frame="NED", init=start).process(imu)


def swim_errors(made: Any, bias: Any) -> Any:
    """Largest errors (3,) of yaw, pitch and roll of a swim, with a bias, rad/s, taken off."""
    imu = made.imu
    return largest(errors_deg(integrate(imu.corrected(meta=imu.meta, gyr=imu.gyr - bias)), made.truth))


def stops_card(seed: int, rest: Any) -> Any:
    """Card of a drawn unit by six quarter turns that end within ±0.5°, and by a rest as it will be used."""
    turned: Any = pb.simulate("stops", frame="NED", sensors=PARTS, unit="random", seed=seed, rate=100.0)
    card = pb.calibrate(turned.imu, "gyro", method="stops").card
    return pb.calibrate(rest, "gyro", method="rest", calibration=card).card


def at_once(imu: Any) -> Any:
    """Samples whose axes are of one time: each is looked up so much later as its sheet says that it comes late."""
    rates = [np.interp(imu.t + late, imu.t, of) for of, late in zip(np.asarray(imu.gyr).T, LATE, strict=True)]
    return imu.corrected(meta=imu.meta, gyr=np.stack(rates, axis=1))


def drawn_swim(seed: int, duration: float) -> tuple[Any, Any, Any, Any]:
    """Largest errors (3,) of a drawn unit: with the mean of a rest, with a card by stops, and ideal.

    Last (`LOOKS`, 3, 2): of the swim with the card, errors about the body's axes and what is claimed of them, °.
    """
    how: dict[str, Any] = {"frame": "NED", "sensors": PARTS, "seed": seed}
    rest: Any = pb.simulate("static", unit="random", duration=REST, rate=RATE, **how).imu
    made = pb.simulate("fin", unit="random", duration=duration, **how)
    plain = swim_errors(made, np.mean(rest.gyr, axis=0))
    start = pb.Filter("integrate", frame="NED", init=made.truth.q_nb[0], calibration=stops_card(seed, rest))
    ours = start.process(at_once(made.imu), covariance=True)
    at = np.arange(1, LOOKS + 1) * (len(ours.t) - 1) // LOOKS
    turn = pb.rotations.quat_multiply(pb.rotations.quat_conjugate(made.truth.q_nb[at]), ours.q_nb[at])
    sd = np.sqrt(np.einsum("nii->ni", ours.cov_b[at]))  # type: ignore[index]
    claimed = pb.units.to_deg(np.stack((pb.rotations.rotvec_from_quat(turn), sd), axis=-1))
    ideal = pb.simulate("fin", unit="calibrated", duration=duration, **how)
    return plain, largest(errors_deg(ours, made.truth)), swim_errors(ideal, np.zeros(3)), claimed


def swims_part(study: Study, swims: int, duration: float) -> Any:
    """Swims of many units; what is claimed of the card's drift grows with time as the error does."""
    study.step()
    runs = [drawn_swim(seed, duration) for seed in study.seeds(swims)]
    *errors, claimed = (np.array(of) for of in zip(*runs, strict=True))
    inside = 100.0 * (np.abs(claimed[..., 0]) <= claimed[..., 1]).mean(axis=(1, 2))
    medians = [np.median(of, axis=0) for of in errors]
    study.rows({
        **{f"swim.{name}": (medians[0][i], medians[1][i]) for i, name in enumerate(ANGLES)},
        **{f"ideal.{name}": (None, medians[2][i]) for i, name in enumerate(ANGLES)},
    }, swims=swims)  # fmt: skip
    study.rows({"swim.inside": (None, inside.mean())}, error=inside.std() / math.sqrt(swims), swims=swims)
    grown = rms(claimed.transpose(1, 0, 2, 3).reshape(LOOKS, -1, 2), 1)
    study.table("error_and_claim", [[f"{duration * (k + 1) / LOOKS:g}", *row] for k, row in enumerate(grown)])
    return medians


def harmonic(t: Any, angle: Any, frequency: float) -> tuple[float, float, float]:
    """Amplitude, frequency, Hz, and phase, rad, at the last sample of an angle (N,) that swings about a mean.

    Least squares, Gauss and Newton in the frequency: the phase that a fit leaves to grow is that of the frequency.
    """
    since = t - t[-1]
    for _ in range(4):
        turn = 2.0 * np.pi * frequency * since
        c, s = np.cos(turn), np.sin(turn)
        a, b = np.linalg.lstsq(np.stack((c, s, np.ones_like(c)), axis=1), angle, rcond=None)[0][:2]
        slope = 2.0 * np.pi * since * (b * c - a * s)
        columns = np.stack((c, s, np.ones_like(c), slope), axis=1)
        a, b, _, step = np.linalg.lstsq(columns, angle, rcond=None)[0]
        frequency += float(step)
    return float(np.hypot(a, b)), frequency, float(np.arctan2(a, b))


def kinematics_part(study: Study, track: Any) -> None:
    """What the three motors set, speed, swing and twist, fitted while it swims from the last two strokes alone."""
    stroke, fits = round(RATE / SWIM["frequency"]), []
    yaw, roll = (np.unwrap(of) for of in (track.yaw, track.roll))
    for last in range(2 * stroke, len(track.t), stroke // 4):
        part = slice(last - 2 * stroke, last)
        swing, frequency, phase = harmonic(track.t[part], yaw[part], 1.1 * SWIM["frequency"])
        twist, _, behind = harmonic(track.t[part], roll[part], frequency)
        fits.append((swing, twist, frequency, phase - behind))
    off = np.array(fits) - [SWIM["swing"], SWIM["twist"], SWIM["frequency"], SWIM["lag"]]
    off[:, 3] = pb.rotations.wrap(off[:, 3])
    off[:, [0, 1, 3]] = pb.units.to_deg(off[:, [0, 1, 3]])
    *sizes, lag = rms(off, 0)
    study.rows(
        {f"motors.{name}": (None, size) for name, size in zip(("swing", "twist", "frequency"), sizes, strict=True)}
    )
    # What leans by the angle random walk mixes swing and twist: ∫W² over a run has 1.15 times its mean as deviation.
    study.rows({"motors.lag": (None, lag)}, error=0.5 * 1.15 * lag)


def attitude_part(study: Study, swims: int, duration: float) -> None:
    """Yaw, pitch and roll in real time, and each axis integrated on its own."""
    study.step()
    taken = study.recorded("fin", "swim", session=LIVE, unit="calibrated", duration=duration)
    again: Any = pb.replay(taken.recording, check=True)
    text = taken.recording.with_suffix(".txt")
    pb.write(text, again.imu, overwrite=True)
    back = pb.estimate(text, "integrate", init="level", frame="NED").track
    truth: Any = pb.read(taken.truth).track
    errors = errors_deg(again.track, truth)
    made = pb.simulate("fin", frame="NED", sensors="ideal", unit="calibrated", seed=0, duration=duration)
    free = errors_deg(integrate(made.imu), made.truth)
    rates = gyr(made.imu)[:, ::-1]
    steps = 0.5 * np.diff(made.imu.t)[:, np.newaxis] * (rates[1:] + rates[:-1])
    true = np.unwrap(pb.rotations.euler_zyx_from_quat(made.truth.q_nb), axis=0)
    apart = np.concatenate((np.zeros((1, 3)), np.cumsum(steps, axis=0))) - pb.units.to_deg(true - true[0])
    cone = pb.simulate("coning", frame="NED", sensors="ideal", unit="calibrated", seed=0, rate=RATE, duration=duration)
    turned = pb.rotations.quat_angle(integrate(cone.imu, cone.truth.q_nb[0]).q_nb, cone.truth.q_nb)
    kinematics_part(study, again.track)
    plain, ours, ideal = swims_part(study, swims, duration)
    study.rows({
        "live.text": float(np.array_equal(back.q_nb, again.track.q_nb)),
        **{f"free.{name}": (largest(apart)[i], largest(free)[i]) for i, name in enumerate(ANGLES[:2])},
        "coning": (None, pb.units.to_deg(turned).max()),
    }, swims=swims)  # fmt: skip
    columns = np.array([largest(free), largest(errors), ideal, plain, ours])
    study.table("largest_error_in", {name: columns[:, i] for i, name in enumerate(ANGLES)}, swims=swims)
    t, colours = again.imu.t, ("blue", "red", "green")
    angles = pb.units.to_deg(np.unwrap(pb.rotations.euler_zyx_from_quat(again.track.q_nb), axis=0))
    first = t <= 6.0
    shown = [PlotCurve(t[first], angles[first, i], colours[i], width=1.2) for i in range(3)]
    study.draw("yaw_pitch_and", shown, [PlotCurve(t, errors[:, i], colours[i]) for i in range(3)])
    lines = [PlotCurve(made.imu.t, apart[:, i], colours[i]) for i in range(2)]
    study.draw("per_axis_integration", [*lines, PlotCurve(made.imu.t, free[:, 0], "green", width=1.4)])


@dataclass(frozen=True, kw_only=True)
class Turn(pb.simulation.Scenario):
    """A turn of 90° about the vertical within 4 s, and then a hold."""

    rate: ClassVar[float] = RATE
    lasts: ClassVar[float] = LENGTH

    def motion(self, rng: np.random.Generator, duration: float) -> pb.simulation.Motion:
        """One move."""
        signals = pb.simulation.signals
        move, rest = signals.Moves((2.0,), (4.0,), (pb.units.deg(90.0),)), signals.constant(0.0)
        return pb.simulation.EulerMotion(pb.Frame.NED, signals.Stack((move, rest, rest)))


def through_bytes(study: Study, name: str, made: Any) -> Any:
    """Samples of a simulation that went through the frames of the rig."""
    return pb.read(study.sent("fin", name, made).recording).imu


def chain_part(study: Study, still: Any, length: float) -> None:
    """What the chain does to an angle: its range, a high-pass in it, and its temperature; `still`: a rest without."""
    study.step()
    how: dict[str, Any] = {"scenario": "fin", "set": {"frequency": "1 Hz"}, "unit": "calibrated", "duration": 20.0}
    taken = study.recorded("fin", "fast", session=LIVE, **how)
    imu: Any = pb.read(taken.recording).imu
    made = pb.simulate("fin", frame="NED", sensors="ideal", unit="calibrated", seed=0, duration=20.0, frequency=1.0)
    true, said = gyr(made.imu), gyr(imu)
    at_end = (np.abs(said[:, :2]) >= 100.0).any(axis=1) | (np.abs(said[:, 2]) >= 300.0)
    flagged = (imu.flags & pb.flags.GYR_CLIPPED) != 0
    first, panels = imu.t <= 2.0, []
    for i, colour in enumerate(("blue", "red")):
        both = (true, "muted", "dashed"), (said, colour, "solid")
        panels.append([PlotCurve(imu.t[first], of[first, i], *look) for of, *look in both])  # type: ignore[arg-type]
    study.draw("rates_at_1", *panels)
    truth: Any = pb.read(taken.truth).track
    clip_error = largest(errors_deg(integrate(imu), truth)).max()
    study.step()
    unit, high = pb.simulation.draw_module(PARTS, study.seed).calibrated(), CORNERS[1]
    yaw: dict[float, Any] = {}
    for corner in (0.0, *CORNERS):
        part = unit.with_high_pass(corner) if corner else unit
        made = pb.simulate(Turn(), frame="NED", sensors=part, unit="calibrated", seed=study.seed, duration=length)
        turned = through_bytes(study, f"turn-{corner:g}", made)
        yaw[corner] = pb.units.to_deg(integrate(turned).yaw)
    how = {"high_pass": high, "scenario": "static", "unit": "calibrated", "duration": length}
    passed: Any = pb.read(study.recorded("fin", "still-high-pass", **how).recording).imu
    n = np.unique(np.append(np.geomspace(1, len(still) // 2, 80).astype(np.int64), min(25_000, len(still) // 2)))
    tau, use = n / RATE, (n >= 2.0 * RATE) & (n <= 20.0 * RATE)
    dev = [pb.noise.deviation(np.ascontiguousarray(gyr(of)[:, 2]), n) for of in (still, passed)]
    slopes = [np.polyfit(np.log(tau[use]), np.log(of[use]), 1)[0] for of in dev]
    late = [float(np.interp(50.0, tau, of)) for of in dev]
    colours = ("blue", "red", "green")
    held = [PlotCurve(turned.t, of, colour, width=1.2) for of, colour in zip(yaw.values(), colours, strict=True)]
    plots = [PlotCurve(tau, of, colour, width=1.2) for of, colour in zip(dev, ("blue", "green"), strict=True)]
    study.draw("what_a_high", held, plots)
    study.rows({
        "clip.missed": (None, np.sum(at_end & ~flagged)),
        "clip.share": 100.0 * np.mean(flagged),
        "clip.error": clip_error,
        "highpass.hold": (yaw[CORNERS[0]][-1], yaw[0.0][-1]),
        "highpass.slope": (slopes[1], slopes[0]),
        "highpass.sigma": (late[1], late[0]),
    })  # fmt: skip
    study.step()
    temperature_part(study, unit)


def temperature_part(study: Study, unit: Any) -> None:
    """Warm up twice from cold at 100 Hz; the first record makes the card, the second is scored."""
    warm = replace(unit, gyr=replace(unit.gyr, bias_per_k=pb.units.dps(TEMPCO)))
    how: dict[str, Any] = {"frame": "NED", "sensors": warm, "unit": "random", "rate": 100.0, "warm_up": "15 K, 120 s"}
    made = [pb.simulate("static", seed=study.seed + k, duration=s, **how) for k, s in enumerate((600.0, LENGTH))]
    first, second = (through_bytes(study, f"warm-{k}", of) for k, of in enumerate(made))
    card: Any = pb.calibrate(first, "temperature", device=first.meta.device).card
    records = (second, pb.apply_card(card, second))
    means = [gyr(imu)[: 500 * (len(imu) // 500)].reshape(-1, 500, 3).mean(axis=1) for imu in records]
    angles = [pb.units.to_deg(pb.rotations.euler_zyx_from_quat(integrate(imu).q_nb)) for imu in records]
    for i, axis in enumerate("xyz"):
        before, after = (abs(float(of[-10:, i].mean())) for of in means)
        study.rows({f"warm.{axis}": (before, after)}, best_bar=(-math.inf, 0.5 * before))
    study.table("largest_error_of", {name: [largest(of)[i] for of in angles] for i, name in enumerate(ANGLES)})
    study.table("bias_per_kelvin", {"assumed": TEMPCO, "found": pb.units.to_dps(np.atleast_2d(card.gyr.bias_per_k)[0])})
    middle, colours = 5.0 * (np.arange(len(means[0])) + 0.5), ("blue", "red", "green")
    pairs = [(i, colour, k, dash) for i, colour in enumerate(colours) for k, dash in enumerate(("dashed", "solid"))]
    rates = [PlotCurve(middle, means[k][:, i], colour, dash) for i, colour, k, dash in pairs]
    study.draw("warm_up_before", rates, [PlotCurve(second.t, angles[k][:, 2 - i], c, dash) for i, c, k, dash in pairs])


def draw_noise(of: Mapping[str, Any], rng: np.random.Generator, count: int = COUNT, past: int = 3) -> Any:
    """Rates (count, 3) of a unit at rest, rad/s, with coefficients in the units of Table 1.

    Quantisation noise is that of an angle that is read with a white error and differenced, white noise, and flicker,
    which starts from nothing, so it has run for `past` records before.
    """
    q, n, b = (UNITS[letter] * np.broadcast_to(np.asarray(of[letter], float), 3) for letter in "QNB")
    errors = pb.simulation.errors
    flicker = errors.flicker(b, (past + 1) * count, rng)[past * count :]
    angle = q * rng.standard_normal((count + 1, 3))
    return RATE * np.diff(angle, axis=0) + errors.white(n * math.sqrt(RATE), count, rng) + flicker


def analysed(study: Study, recording: Any) -> tuple[Any, float]:
    """Noise at every n of a recording's rates, stored as TXT and read back, and the largest change of a rate, rad/s."""
    imu: Any = pb.read(recording).imu
    text = recording.with_suffix(".txt")
    pb.write(text, imu, overwrite=True)
    back: Any = pb.read(text).imu
    return pb.allan(text, taus="all"), float(np.max(np.abs(back.gyr - imu.gyr)))


def by_line(a: Any, letter: str) -> float:
    """Coefficient as a reader of the paper must take it: by its line, or where none shows, by force.

    Q then by a line of slope −1 through the shortest averaging time, B by the floor of the curve.
    """
    if (term := a.lines.terms.get(letter)) is not None:
        return float(term.value)
    if letter == "Q":
        return float(a.curve.dev[0] * a.curve.tau[0] / math.sqrt(3.0))
    return float(np.min(a.curve.dev[a.curve.edf >= 2.0])) / SIGMA


def experiment_part(study: Study, length: float) -> Any:
    """Figures 4 and 5 and Table 1, from the data sheets' noise, and from a unit in which the table was planted."""
    study.step()
    sheet = study.recorded("fin", "static-parts", scenario="static", duration=length, unit="calibrated")
    study.rows({"live.same": study.live(sheet)})
    study.step()
    planted = {letter: np.array(of) / (SIGMA if letter == "B" else 1.0) for letter, of in PRINTED.items()}
    rates = draw_noise(planted, np.random.default_rng([study.seed, 0]), round(RATE * length))
    how: dict[str, Any] = {"sensors": "ideal", "unit": "calibrated", "rate": RATE, "duration": length}
    rest = pb.simulate("static", frame="NED", seed=study.seed, **how)
    sent = study.sent("fin", "static-table", replace(rest, imu=rest.imu.corrected(meta=rest.imu.meta, gyr=rates)))
    records = {"sheet": analysed(study, sheet.recording), "planted": analysed(study, sent.recording)}
    study.rows({"text.lost": max(lost for _, lost in records.values())})
    for name, (noise, _) in records.items():
        for letter in "QNB":
            flat = SIGMA if letter == "B" else 1.0
            for axis, a in zip(AXES, noise.analyses, strict=True):
                term = a.terms[letter]
                pair = (by_line(a, letter), term.value if term.observable else term.upper)
                limit = study.text("value" if term.observable else "limit")
                figures = tuple(flat * value / UNITS[letter] for value in pair)
                study.rows({f"{name}.{letter}.{axis}": figures}, limit=limit)
    colours = ("blue", "red", "green")
    hour = UNITS["N"]
    study.draw("figure_4", *(
        [PlotCurve(*thin(a.curve.tau, a.curve.dev / hour), colour)
         for a, colour in zip(noise.analyses, colours, strict=True)] for noise, _ in records.values()
    ))  # fmt: skip
    panels = []
    for noise, _ in records.values():
        a = noise.analyses[2]
        tau, use = np.geomspace(a.curve.tau[0], a.curve.tau[-1], 200), a.curve.edf >= 2.0
        low, high = (thin(a.curve.tau[use], of[use] / hour)[1] for of in (a.curve.lo, a.curve.hi))
        lines = [PlotCurve(thin(a.curve.tau[use], a.curve.dev[use])[0], low, "blue", to=high)]
        lines += [PlotCurve(*thin(a.curve.tau, a.curve.dev / hour)), PlotCurve(tau, a.model(tau) / hour, "green")]
        for letter, power, size in (("Q", -1.0, math.sqrt(3.0)), ("N", -0.5, 1.0), ("B", 0.0, SIGMA)):
            if letter in a.lines.terms:
                lines.append(PlotCurve(tau, size * a.lines.terms[letter].value * tau**power / hour, "red", "dashed"))
        panels.append(lines)
    study.draw("figure_5", *panels)
    return pb.read(sheet.recording).imu


def thin(tau: Any, values: Any) -> tuple[Any, Any]:
    """About 200 points of a curve, evenly in the logarithm of the time."""
    at = np.unique(np.searchsorted(tau, np.geomspace(tau[0], tau[-1], 200)).clip(0, tau.size - 1))
    return tau[at], values[at]


def scatter_part(study: Study, records: int) -> None:
    """What (7) is worth: scatter of σ over records of white noise and half as many of flicker."""
    study.step()
    rng, ones = np.random.default_rng([study.seed, 7]), np.ones(3)
    devs: dict[str, list[Any]] = {"white": [], "disjoint": [], "flicker": []}
    for _ in range(-(-records // 6)):
        for _ in range(2):
            noise = pb.simulation.errors.white(ones, COUNT, rng)
            devs["white"].append(pb.noise.deviation(noise, FACTORS))
            devs["disjoint"].append(pb.noise.deviation(noise, FACTORS, "adev"))
        devs["flicker"].append(pb.noise.deviation(pb.simulation.errors.flicker(ones, 2 * COUNT, rng)[COUNT:], FACTORS))
    by = {name: np.concatenate(of, axis=1) for name, of in devs.items()}
    measured = {name: 100.0 * of.std(axis=1) / of.mean(axis=1) for name, of in by.items()}
    formula = [100.0 * percent_error(n / RATE) for n in FACTORS]
    theory = 100.0 / np.sqrt(2.0 * pb.noise.edf("oadev", 0.0, COUNT, FACTORS))
    study.values["records"] = records
    study.rows({"eq7": formula[2], **{f"eq7.{name}": (formula[0], of[0]) for name, of in measured.items()}})
    study.table("is_eq_7", {"formula": formula, "theory": theory, **measured})


def regimes_part(study: Study, runs: int) -> None:
    """Estimators over records of three regimes whose truth is known."""
    study.step()
    rng, step = np.random.default_rng([study.seed, 3]), 1.0 / RATE
    records = [rates for _ in range(-(-runs // 3)) for rates in draw_noise(THREE, rng).T]
    analyses = [pb.noise.analyse(np.ascontiguousarray(rates), step) for rates in records]
    ways: dict[str, Callable[[Any, str], Any]] = {
        "lines": lambda a, letter: a.lines.terms.get(letter),
        "squares": lambda a, letter: a.least_squares.terms.get(letter),
        "likelihood": lambda a, letter: a.terms.get(letter),
    }
    scores: dict[str, dict[str, tuple[float, ...]]] = {}
    for name, way in ways.items():
        for letter in "QNB":
            true = UNITS[letter] * THREE[letter]
            terms = [term for a in analyses if (term := way(a, letter)) is not None]
            values = np.array([term.value for term in terms]) / true
            share = percent_error(READ_AT[letter])
            ends = [(c.lo / true, c.hi / true) for c in terms]
            if name == "lines":
                ends = [(v * (1.0 - share), v * (1.0 + share)) for v in values]
            inside = float(np.mean([low <= 1.0 <= high for low, high in ends]))
            figures = 100.0 * (values.mean() - 1.0), 100.0 * values.std(), inside, len(terms) / len(analyses)
            scores.setdefault(name, {})[letter] = figures
    line, best = scores["lines"], scores["likelihood"]
    study.rows({
        **{f"three.{letter}.bias": (abs(line[letter][0]), abs(best[letter][0])) for letter in "QN"},
        **{f"three.{letter}.cover": (line[letter][2], best[letter][2]) for letter in "QNB"},
        "three.B.scatter": (line["B"][1], best["B"][1]),
    }, runs=runs, sd=(sd := best["B"][1] / math.sqrt(len(analyses))))  # fmt: skip
    study.rows({"three.B.bias": (abs(line["B"][0]), abs(best["B"][0]))}, runs=runs, sd=sd, error=sd)
    cells = {name: [" / ".join(f"{of[letter][k]:.2f}" for letter in "QNB") for k in range(4)]
             for name, of in scores.items()}  # fmt: skip
    study.table("estimators_on_records", cells, runs=runs)


def measure(study: Study, *, swims: int = 30, length: float = LENGTH, records: int = 400, runs: int = 180) -> None:
    """Measure every figure of the paper, from swims and records of `length`, s."""
    still = experiment_part(study, length)
    attitude_part(study, swims, length)
    chain_part(study, still, length)
    scatter_part(study, records)
    regimes_part(study, runs)
