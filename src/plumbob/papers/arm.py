"""Teaching arm [HuangJiang]: six units in ± sets, fuzzy and PI laws, a Kalman filter; and what an array can do.

Both tables of the paper are of simulations. With the noise that it states, its figures would be far smaller; they come
out with a noise that is assumed, which proves nothing. One run of each figure goes through the bytes of the rig
``arm``; statistics are over drawn arrays. What the paper's system is for, a robot's program, the rig ``teach`` makes.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, Final, NamedTuple

import numpy as np
from scipy.signal import lfilter

import plumbob as pb
from plumbob.papers.studies import MOUNTS, PlotCurve, Study, largest, rms, stick_figure

G0: Final = float(pb.units.g(1.0))
AXES, TRIADS = ("roll", "pitch", "yaw"), ("gyr", "acc", "mag")
COLOURS: Final = ("blue", "red", "green", "pink", "amber", "sky")
ALL: Final = 'units = "all"\n'  # what a session of a rig says of its units
RATE, DURATION = 10.0, 30.0  # samples per second in the paper, Hz, and length of a run, s
TURN_RATE: Final = float(pb.units.deg(-90.0)) / DURATION
CASES: Final = {False: "static", True: "turn"}
CONTENDERS: Final = ("none", "pi", "fuzzy")
SCHEMES: Final[Mapping[str, Any]] = {
    "none": pb.array.Scheme(set1="none", sets=1, ekf=False), "pi": pb.array.Scheme(set1="pi", sets=1),
    "fuzzy": pb.array.Scheme(), "control": pb.array.Scheme(set1="pi"), "ekf": pb.array.Scheme(set1="none", sets=1),
    "bare": pb.array.Scheme(ekf=False), "sum": pb.array.Scheme(sum_table=True),
}  # fmt: skip
"""The paper's three contenders; the control, which has the same law on both sets; and what each part does alone."""
RECOVERIES: Final = {name: SCHEMES[name]._replace(ekf=False) for name in ("fuzzy", "control", "sum")} | {
    "sum_alone": pb.array.Scheme(sum_table=True, sets=1, ekf=False), "ekf": SCHEMES["fuzzy"],
}  # fmt: skip
STARTS: Final = {  # wrong starts: yaw, pitch and roll, deg
    "yaw": (10.0, 0.0, 0.0), "roll": (0.0, 0.0, 10.0), "pitch": (0.0, 10.0, 0.0), "each": (10.0 / 3**0.5,) * 3,
    "all": (10.0,) * 3,
}  # fmt: skip
DESIGNS: Final = ((0.3, 3.0), (0.8, 9.0), (4.5, 9.0))  # slope, 1/s, and correction of large errors, deg/s, of rules
SCALE, BIAS = 0.003, float(pb.units.dps(0.2))  # scale errors and angles between axes; of a broken axis, rad/s
WATCH, SINCE, UNTIL = 90.0, 31.0, 60.0  # s in all; a fault begins in the second of rest after a motion, and ends, s
WORLD: Final = {"mount_angle": "5 deg", "mount_shift": "2 cm", "bend": "20 uT"}  # by which the rig is off
STILL: Final = {"turn": "0 deg"}
UnitErrors = pb.simulation.UnitErrors
REST: Final = UnitErrors(float(pb.units.dps(0.1)), 0.01 * G0, 0.5, float(pb.units.dps(0.13)))  # assumed: parts arm:rest
TURN: Final = UnitErrors(float(pb.units.dps(0.2)), 0.02 * G0, 1.0, float(pb.units.dps(0.25)))  # assumed: parts arm:turn
STATED: Final = UnitErrors(float(pb.units.dps(0.1 / 3600.0)), 1e-4 * G0, 0.05)  # 0.1 °/h, 0.1 mg and 50 nT


def with_noise(array: Any, noise: Any) -> Any:
    """Array whose mounts know the noise of their units."""
    return pb.ImuArray(array.units, {name: replace(m, noise=noise.card(RATE)) for name, m in array.mounts.items()})


def arm_array(seed: int, *, turns: bool, rate: float = RATE, noise: Any = None, duration: float = DURATION) -> Any:
    """The paper's array in the turn from 0° to −90° or at rest, and the true attitude (N, 4) of its body in NED.

    At every rate, Hz, the scatter of a sample is that of 10 Hz.
    """
    noise, speed = noise or (TURN if turns else REST), TURN_RATE if turns else 0.0
    t = np.arange(round(duration * rate)) / rate
    q_nb = pb.rotations.quat_from_euler_zyx(np.stack((speed * t, 0.0 * t, 0.0 * t), axis=1))
    rates = np.tile([0.0, 0.0, speed], (t.size, 1))
    return pb.simulation.draw_array(q_nb, rates, noise, rate=rate, frame="NED", seed=[seed, turns]), q_nb


def moved(seed: int, duration: float, *, moving: bool, rate: float = RATE, units: int = 6) -> tuple[Any, Any]:
    """Units at rest, or turning with 60 °/s rms every other 20 s, whose gains and axes are off, and true attitudes.

    At another rate than 10 Hz the scatter of a sample is larger by its root: the noise over time is the same.
    """
    rng, count = np.random.default_rng(seed), round(duration * rate)
    t, rates = np.arange(count) / rate, np.zeros((count, 3))
    q_nb = np.tile([1.0, 0.0, 0.0, 0.0], (count, 1))
    if moving:
        keep = np.exp(-1.0 / rate / 0.5)  # as an arm does, correlated over half a second
        on = (np.floor(t / 20.0) % 2 == 1)[:, np.newaxis]
        white = lfilter([np.sqrt(1.0 - keep**2)], [1.0, -keep], rng.normal(size=(count, 3)), axis=0)
        rates = pb.units.dps(60.0) * white * on
        q_nb = pb.rotations.quat_chained(rates / rate)[-count:]
    mounts = {f"u{k + 1}": list(MOUNTS.values())[k % 6] for k in range(units)}
    noise = REST._replace(scale=SCALE, **{triad: getattr(REST, triad) * np.sqrt(rate / RATE) for triad in TRIADS})
    return pb.simulation.draw_array(q_nb, rates, noise, rate=rate, frame="NED", seed=rng, mounts=mounts), q_nb


def broken(array: Any, unit: str) -> Any:
    """Array of which one axis of a unit's gyroscope reads 0.2 °/s too much for a time."""
    good, when = array.units[unit], (array.t >= SINCE - 1e-9) & (array.t < UNTIL - 1e-9)
    bad = good.corrected(meta=good.meta, gyr=good.gyr + BIAS * np.outer(when, [1.0, 0.0, 0.0]))
    return pb.ImuArray({**array.units, unit: bad}, array.mounts)


def pair(array: Any) -> Any:
    """The first unit of each set, on +x and −x."""
    return pb.ImuArray(*({name: of[name] for name in ("u1", "u4")} for of in (array.units, array.mounts)))


def turn_errors(q_nb: Any, truth: Any) -> Any:
    """Errors (N, 3) of roll, pitch and yaw, deg: angles of the turn from the true to the estimated attitude."""
    turn = pb.rotations.quat_multiply(pb.rotations.quat_conjugate(truth), q_nb)
    return pb.units.to_deg(np.unwrap(pb.rotations.euler_zyx_from_quat(turn), axis=0))[:, ::-1]


def statistics(e: Any) -> Any:
    """Standard deviation, range and rms (rows) of each column of errors (N, 3)."""
    return np.array([e.std(axis=0), np.ptp(e, axis=0), rms(e, 0)])


class Over(NamedTuple):
    """Statistics (3,) of roll, pitch and yaw over seeds, deg: means, of the rms the root mean square."""

    std: Any
    range: Any
    rms: Any
    each: Any  # (seeds, 3), the standard deviations of each run
    standard_error: Any  # of the mean of these


def by_scheme(array: Any, scheme: Any, start: Any = None) -> Any:
    """Attitude (N, 4) in NED by the paper's scheme."""
    return pb.array.teaching_arm(array, frame=pb.Frame.NED, scheme=scheme, start=start).q_nb


def by_directions(array: Any, noise: Any) -> Any:
    """Attitude (N, 4) in NED by Plumbob's filter, which knows how a bias is spread."""
    settings = pb.array.MonitoringSettings(gyr_bias=noise.bias / np.sqrt(3.0))
    return pb.array.estimate(array, "directions", frame=pb.Frame.NED, settings=settings).track.q_nb


def measured(
    turns: bool, seeds: Sequence[int], *, rate: float = RATE, noise: Any = None, ours: bool = True,
    schemes: Mapping[str, Any] = SCHEMES,
) -> dict[str, Over]:  # fmt: skip
    """Statistics of every scheme over seeds, and of two and six units by Plumbob's filter where `ours`."""
    stats, noise = dict[str, list[Any]](), noise or (TURN if turns else REST)
    for seed in seeds:
        array, truth = arm_array(seed, turns=turns, rate=rate, noise=noise)
        tracks = {name: by_scheme(array, scheme) for name, scheme in schemes.items()}
        if "pi" in tracks and "fuzzy" in tracks:
            tracks["pi, common start"] = by_scheme(array, schemes["pi"], tracks["fuzzy"][0])
        if ours:
            tracks |= {"two": by_directions(pair(array), noise), "six": by_directions(array, noise)}
        for name, q_nb in tracks.items():
            stats.setdefault(name, []).append(statistics(turn_errors(q_nb, truth)))
    over = {}
    for name, runs in stats.items():
        each, span, root = np.array(runs).transpose(1, 0, 2)
        error = each.std(axis=0) / np.sqrt(len(each))
        over[name] = Over(each.mean(axis=0), span.mean(axis=0), rms(root, 0), each, error)
    return over


def recovery(scheme: Any, euler_deg: tuple[float, float, float] = STARTS["yaw"]) -> tuple[float, Any, Any]:
    """How a scheme forgets a start that is wrong by yaw, pitch and roll, deg, in 120 s without noise.

    From when on its largest error stays below 0.5°, s, infinite where it does not; times (N,) and those errors, deg.
    """
    array, truth = arm_array(0, turns=False, noise=UnitErrors(0.0, 0.0, 0.0), duration=120.0)
    wrong = pb.rotations.quat_from_euler_zyx(pb.units.deg(np.array(euler_deg)))
    track = by_scheme(array, scheme, pb.rotations.quat_multiply(wrong, truth[0]))
    error = largest(turn_errors(track, truth), 1)
    late = np.flatnonzero(np.append(1.0, error) >= 0.5)[-1]  # the sample behind the last that is
    return float(array.t[late]) if late < error.size else math.inf, array.t, error


def three(values: Any) -> str:
    """Roll, pitch and yaw in one cell."""
    return "/".join(f"{value:.3f}" for value in values)


def printed(study: Study, turns: bool, name: str) -> list[float]:
    """Standard deviations that the paper prints at rest or in the turn, deg, in the order of `AXES`."""
    return [study.description.printed(f"{CASES[turns]}.{name}.{axis}") for axis in AXES]


def table_part(study: Study, turns: bool, seeds: int) -> tuple[dict[str, Over], dict[str, Any]]:
    """Table 1 or 2 over seeds, and its figures: one run through bytes, whose errors (N, 3) it gives too, deg."""
    name, noise = ("turn", TURN) if turns else ("rest", REST)
    study.step()
    taken = study.recorded("arm", name, session=ALL, sensors=f"arm:{name}", scenario="arm", set={} if turns else STILL)
    if not turns:
        study.rows({"live.same": study.live(taken)})
    array = with_noise(pb.read_array(taken.recording, mounts="arm"), noise)
    track: Any = pb.read(taken.truth.with_stem(f"{taken.truth.stem}-u1")).track  # u1 is aligned with the body
    tracks = {scheme: by_scheme(array, SCHEMES[scheme]) for scheme in CONTENDERS} | {"six": by_directions(array, noise)}
    errors = {scheme: turn_errors(q_nb, track.q_nb) for scheme, q_nb in tracks.items()}
    if turns:
        yaw = [np.unwrap(pb.rotations.euler_zyx_from_quat(of)[:, 0])
               for of in (track.q_nb, tracks["fuzzy"], tracks["six"])]  # fmt: skip
        looks = (("amber", "solid", 2.8), ("blue", "solid", 0.9), ("green", "dashed", 0.9))
        panels = ([PlotCurve(array.t, pb.units.to_deg(of - middle), *look) for of, look in zip(yaw, looks, strict=True)]
                  for middle in (0.0, yaw[0]))  # fmt: skip
        study.draw("figure_6", *panels)
    words, whats = study.description.texts("words"), study.description.texts("what")
    for number, scheme in enumerate(CONTENDERS, 7 if turns else 3):
        bands = [np.full(2, std) for std in printed(study, turns, scheme)]
        study.draw(f"errors_{name}", *(
            [PlotCurve(array.t[[0, -1]], -band, "soft", to=band), PlotCurve(array.t, errors[scheme][:, i]),
             PlotCurve(array.t, errors["six"][:, i], "green")] for i, band in enumerate(bands)
        ), number=number, what=whats[scheme])  # fmt: skip
    study.table(f"run_{name}", [[words[key], *map(three, statistics(e))] for key, e in errors.items()])
    study.step()
    stats = measured(turns, study.seeds(seeds))
    study.table(f"table_{name}", [
        [words[key], three(printed(study, turns, key)) if key in CONTENDERS else "-",
         *map(three, (over.std, over.standard_error, over.range, over.rms))] for key, over in stats.items()
    ])  # fmt: skip
    none, common = stats["none"], stats["fuzzy"].std / stats["pi, common start"].std
    study.values |= {f"{name}_std": none.std.mean(), f"{name}_rms": none.rms.mean(), f"{name}_ratio": common.max()}
    table_figures(study, turns, stats)
    return stats, errors


def of_runs(study: Study, key: str, value: Any, each: Any) -> None:
    """A mean figure, and how far one run lies off it by chance, of its values `each` (seeds,)."""
    mean, sd = value[0] if isinstance(value, tuple) else value, float(each.std())
    away = abs(mean - study.description.printed(key)) / (sd or math.nan)
    reason = study.text("one_run", sd=sd, away=away, seeds=len(each))
    study.rows({key: value}, error=sd / math.sqrt(len(each)), one_run=sd, reason=reason)


def table_figures(study: Study, turns: bool, stats: Mapping[str, Over]) -> None:
    """Figures of a table, by angle: standard deviations, ranges, the control, ratios, and Plumbob's."""
    case, six = CASES[turns], stats["six"]
    for i, axis in enumerate(AXES):
        for name in CONTENDERS:
            of, ours = stats[name], name == "fuzzy"
            of_runs(study, f"{case}.{name}.{axis}", (of.std[i], six.std[i]) if ours else of.std[i], of.each[:, i])
            study.rows({f"{case}.{name}.range.{axis}": (of.range[i], six.range[i]) if ours else of.range[i]})
        study.rows({f"{case}.control.{axis}": stats["control"].std[i]})
        for name, over in (("pi", "none"), ("fuzzy", "pi")):
            a, b = stats[name], stats[over]
            of_runs(study, f"{case}.{name}_over_{over}.{axis}", a.std[i] / b.std[i], a.each[:, i] / b.each[:, i])
        study.rows({f"{case}.two.{axis}": (None, stats["two"].std[i])}, error=stats["two"].standard_error[i])
    study.rows({f"{case}.none.rms": stats["none"].rms.mean()})


def stated_part(study: Study, few: Sequence[int], rest: Mapping[str, Over]) -> None:
    """The turn at 100 Hz; the stated noise, the gain, measurements that are used once, and hard iron in each unit."""
    study.step()
    fast = measured(True, few, rate=100.0, schemes={"fuzzy": SCHEMES["fuzzy"]})
    study.rows({f"hundred.fuzzy.{axis}": (fast["fuzzy"].std[i], fast["six"].std[i]) for i, axis in enumerate(AXES)})
    study.step()
    over = measured(False, few, noise=STATED, schemes={name: SCHEMES[name] for name in CONTENDERS})
    for name in CONTENDERS:
        value, best = over[name].std.mean(), over["six"].std.mean() if name == "fuzzy" else None
        study.rows({f"stated.{name}": (value, best)}, value=float(np.mean(printed(study, False, name))) / value)
    corner, needed = 0.8 / (2.0 * math.pi), 2.0 * math.pi * 15.0  # of K = 0.8 1/s, and for motion of 15 Hz
    gains = {"gain.corner": corner, "gain.needed": needed, "gain.nyquist": 0.5 * RATE}
    study.rows(gains, step=1.0 / (1.0 + needed / RATE))
    study.rows({f"once.{axis}": rest["ekf"].std[i] for i, axis in enumerate(AXES)})  # before PI uses them again
    schemes = {name: SCHEMES[name] for name in ("pi", "control")}
    iron = measured(True, few, noise=TURN._replace(iron=1.5), ours=False, schemes=schemes)
    of_runs(study, "iron.pi", iron["pi"].std[2], iron["pi"].each[:, 2])
    study.rows({"iron.control": iron["control"].std[2]})
    combination_part(study)


def combination_part(study: Study) -> None:
    """What y⁺ and y⁻ give together: common bias, noise, and the parity."""
    common, true = pb.units.dps(0.3), np.array([0.0, 0.0, pb.units.dps(-3.0)])
    array, _ = arm_array(study.seed, turns=True, noise=REST._replace(bias=float(pb.units.dps(0.05))))
    sets = pb.array.sets_of(array)
    plus, raw = sets.plus["gyr"] + common, -sets.minus["gyr"] + common  # both read 0.3 °/s too much
    half = 0.5 * (plus - raw)
    study.rows({
        "pair.bias": pb.units.to_dps(largest(half.mean(axis=0) - true)),
        "pair.noise": half.std(axis=0).mean() / plus.std(axis=0).mean(),
        "pair.parity": abs(np.corrcoef((0.5 * (plus + raw))[:, 2], np.sin(array.t))[0, 1]),
    }, single=pb.units.to_dps((plus.mean(axis=0) - true)[0]))  # fmt: skip


def rules_part(study: Study, few: Sequence[int]) -> None:
    """Control, recovery from a wrong start, and the design of the rules."""
    study.step()
    words, starts = (study.description.texts(name) for name in ("recoveries", "starts"))
    runs = {n: {of: recovery(scheme, angles) for of, angles in STARTS.items()} for n, scheme in RECOVERIES.items()}
    study.rows({f"recovery.{name}": of["yaw"][0] for name, of in runs.items()})
    rows = [[words[name], *(f"{time:.1f}" if np.isfinite(time) else "> 120" for time, _, _ in of.values())]
            for name, of in runs.items()]  # fmt: skip
    study.table("recovery_from_a", rows, head=(study.text("time_to_below_0"), *starts.values()))
    lines = zip((of["yaw"] for of in runs.values()), COLOURS, strict=False)
    study.draw("recovery_from_10", [PlotCurve(t, np.maximum(e, 1e-3), colour) for (_, t, e), colour in lines])
    schemes = {of: pb.array.Scheme(slope=of[0], far=float(pb.units.dps(of[1]))) for of in DESIGNS}
    stats = measured(False, few, ours=False, schemes={f"{of}": scheme for of, scheme in schemes.items()})
    study.table("design_of_the", [
        [f"{of[0]:g}", f"{of[1]:g}", three(stats[f"{of}"].std), f"{recovery(scheme._replace(ekf=False))[0]:.1f}"]
        for of, scheme in schemes.items()
    ])  # fmt: skip


def with_fault(seed: int, *, moving: bool, units: int = 6, rate: float = RATE) -> tuple[Any, Any, str]:
    """An array of which a gyroscope's axis reads 0.2 °/s too much, what the monitor says, and the unit's name."""
    unit = f"u{1 + seed % units}"
    array = broken(moved(seed, WATCH, moving=moving, units=units, rate=rate)[0], unit)
    return array, pb.array.monitor(array), unit


def watched(*, moving: bool, seeds: Sequence[int], rate: float = RATE) -> dict[str, float]:
    """Share of arrays with an alarm, and of these with the right unit, %; median time to it, s, and what 95 % keep."""
    delays, right = [], 0
    first, last = round(SINCE * rate), round(UNTIL * rate)
    for seed in seeds:
        _, monitored, unit = with_fault(seed, moving=moving, rate=rate)
        alarms = (monitored.imu.flags[first:last] & (pb.flags.UNIT_EXCLUDED | pb.flags.CANNOT_ISOLATE)) != 0
        hits = [(f.unit, f.triad) for f in monitored.faults if f.begin >= SINCE - 1e-6]
        if alarms.any():
            delays.append(float(np.argmax(alarms)) / rate)
            right += hits[:1] == [(unit, "gyr")]
    median, slow = (float(np.quantile(delays, q)) if delays else np.nan for q in (0.5, 0.95))
    shares = {"detected": 100.0 / len(seeds) * len(delays), "isolated": 100.0 * right / max(len(delays), 1)}
    return {**shares, "median": median, "slow": slow}


def parity_test(step_dps: float, seed: int, runs: int = 200, duration: float = 60.0) -> tuple[int, float]:
    """Alarms, and their median time, s: the mean of p = (y⁺ + y⁻)/2, forgotten by 0.1, exceeds 5 of its deviations.

    `step_dps`: on one of the two gyroscopes of 0.1 °/s noise at 10 Hz, deg/s, from the first sample on.
    """
    keep, sd, rng = 0.9, 0.1 / np.sqrt(2.0), np.random.default_rng([seed, 3])  # sd: of the parity, deg/s
    settled = sd * np.sqrt((1.0 - keep) / (1.0 + keep))
    before = settled * rng.normal(size=runs)  # it has run for long
    p = 0.5 * step_dps + sd * rng.normal(size=(round(duration * RATE), runs))
    mean, _ = lfilter([1.0 - keep], [1.0, -keep], p, axis=0, zi=keep * before[np.newaxis])
    over = np.abs(mean) > 5.0 * settled
    alarms = over.argmax(axis=0)[over.any(axis=0)]
    return alarms.size, float(np.median(alarms) / RATE) if alarms.size else np.nan


def broken_at_rest(study: Study) -> tuple[Any, Any, str]:
    """As `with_fault`: six units at rest through bytes, where 0.2 °/s is added to what one axis was read to say."""
    how: dict[str, Any] = {"sensors": "arm:rest", "scenario": "arm", "set": {**STILL, "time": f"{WATCH:g} s"}}
    taken = study.recorded("arm", "watch", session=ALL, **how)
    array = with_noise(broken(pb.read_array(taken.recording, mounts="arm"), "u3"), REST)
    return array, pb.array.monitor(array), "u3"


def away_from_the_rest(array: Any, monitored: Any, unit: str) -> list[PlotCurve]:
    """What a broken gyroscope reads beyond the rest, its mean over 1 s, and when it is left out."""
    t = monitored.imu.t
    away = pb.units.to_dps(array.units[unit].gyr[:, 0] - (monitored.imu.gyr @ array.mounts[unit].dcm)[:, 0])
    size = max(1, round(1.0 / float(np.median(np.diff(t)))))
    out = monitored.excluded("gyr")[:, monitored.names.index(unit)]
    return [PlotCurve(t, away, "soft", width=0.4),
            PlotCurve(t, np.convolve(away, np.ones(size) / size)[: t.size], width=1.0),
            PlotCurve(t, np.where(out, -0.6, np.nan), "muted", width=3.0)]  # fmt: skip


def faults_part(study: Study, seeds: Sequence[int], duration: float) -> None:
    """A fault of one axis over `seeds` and false alarms, with bars; a pair by its parity."""
    study.step()
    shown = [broken_at_rest(study), with_fault(study.seed, moving=True)]
    study.draw("fault_of_0", *(away_from_the_rest(*run) for run in shown))
    study.step()
    for name, moving in (("rest", False), ("moving", True)):
        study.rows({f"fault.{name}.{key}": (None, v) for key, v in watched(moving=moving, seeds=seeds).items()})
        quiet = [pb.array.monitor(moved(seed, duration, moving=moving)[0]) for seed in study.seeds(3)]
        study.rows({f"fault.{name}.100_hz": (None, watched(moving=moving, seeds=seeds[:25], rate=100.0)["median"])})
        alarms = sum(len(monitored.faults) for monitored in quiet)
        study.rows({f"fault.{name}.alarms": (None, alarms / 3.0)}, error=math.sqrt(alarms) / 3.0)  # as counts scatter
    _, two, _ = with_fault(study.seed, moving=False, units=2)
    study.rows({"fault.two": (None, (two.imu.flags & pb.flags.CANNOT_ISOLATE).any() and not two.faults)})
    parity = {size: parity_test(size, study.seed) for size in (0.0, 0.1, 0.2, 0.3, 0.5)}
    study.rows({"parity.alarms": (None, parity[0.0][0])})
    for size, (count, median) in list(parity.items())[1:]:
        study.rows({f"parity.{size:g}": (None, median)}, found=count)


def mount_turns(chain: Any, other: Any) -> Any:
    """Turns (U, 3) between the mounts of two chains, about segment axes, deg."""
    q_sb = [pb.rotations.quat_conjugate([s.mount.q_bs for s in of.segments if s.unit]) for of in (chain, other)]
    return turn_errors(*q_sb)


def teach(study: Study) -> tuple[Any, ...]:
    """Align the units on one recording, estimate another one, export its program, and replay it."""
    how: dict[str, Any] = {"session": ALL, "set": WORLD, "unit": "calibrated"}
    given: dict[str, Any] = {"pose_sd": "0.5 deg", "params": {"mean_rate": False}}  # a frame has the rate at its time
    first = study.recorded("teach", "align", scenario="calibration", **how)
    take = study.recorded("teach", "teach", **how)
    chain, placed = (pb.load_chain(take.truth.with_name(f"{take.truth.stem}{end}.chain.toml")) for end in ("", "-true"))
    pose = 0.0, 1.8, [0.0] * len(chain.angles)  # the program of alignment begins with two seconds at zero
    card = pb.arm.align(chain, pb.read_array(first.recording), poses=[pose], **given)
    card.save(study.folder / "arm.card.json", overwrite=True)
    true = pb.arm.JointTrack.load(take.truth.with_stem(f"{take.truth.stem}-angles"))
    start, array = true.angles[0].tolist(), pb.read_array(take.recording)
    joints = pb.arm.run(card, array, frame="NED", pose=start, **given).joints
    program = pb.arm.taught(joints, chain, rate="100 Hz")
    files = [study.folder / f"program.{kind}" for kind in ("csv", "yaml", "mcap", "script", "urdf")]
    for path in files[:-1]:
        pb.arm.export(program, path, overwrite=True)
    files[-1].write_text(pb.arm.urdf_text(chain), encoding="utf-8")
    model, ours = (pb.arm.replay(pb.arm.Program.load(files[0]), of) for of in (files[-1], chain))
    before, after = (mount_turns(of, placed) for of in (chain, card.chain))
    claims = pb.units.to_deg(np.array([card.mount_sd[body.unit][:3] for body in chain.segments if body.unit]))
    size, good = math.sqrt(len(after)), claims <= 1.0  # °: what motion shows
    study.rows({
        "teach.mounts": (None, np.linalg.norm(after[good]) / size), "teach.claim": (None, largest(after / claims, None))
    }, all=np.linalg.norm(after) / size, rest=claims.max())  # fmt: skip
    study.values |= {"mounts_deg": np.linalg.norm(before) / size, "files": ", ".join(path.name for path in files)}
    return chain, joints, true, program, model, np.abs(model.hand - ours.hand).max()


def teaching_part(study: Study) -> None:
    """A machine is taught by hand: bytes of six units on its links become a program, and a model that moves."""
    study.step()
    chain, joints, true, program, model, residual = teach(study)
    error = pb.units.to_deg(pb.rotations.wrap(joints.angles - true.angles))
    hand = 1e3 * np.linalg.norm(joints.hand - true.hand, axis=1)
    figures = {
        "angles.rms": rms(error), "angles.max": largest(error, None),
        "hand.rms": rms(hand), "hand.max": hand.max(), "stops": len(program.stops), "replay": 1e3 * residual,
        "program": 100.0 * model.against(true.t, true.hand).rms_share,
        "limits": 100.0 * max(program.used(chain).values()),
    }  # fmt: skip
    study.rows({f"teach.{name}": (None, value) for name, value in figures.items()})
    angles = [pb.units.to_deg(of.angles) for of in (true, joints, program)]
    columns = (angles[0].min(axis=0), angles[0].max(axis=0), rms(error, 0), largest(error))
    study.table("joint_angles", [[name, *row] for name, *row in zip(program.names, *columns, strict=True)])
    every, times = slice(None, None, 6), (true.t, joints.t, np.asarray(program.recorded))
    looks = (("soft", "solid", 2.6), ("blue", "solid", 0.9), ("red", "dashed", 1.0))
    for key, sources in (("joint_angles_over", angles), ("position_of_the", (true.hand, joints.hand, model.hand))):
        study.draw(key, *(
            [PlotCurve(t[every], of[every, k], *look) for t, of, look in zip(times, sources, looks, strict=True)]
            for k in range(sources[0].shape[1])
        ))  # fmt: skip
    lines = [PlotCurve(joints.t[every], of[every], colour) for of, colour in zip(error.T, COLOURS, strict=True)]
    study.draw("errors_of_the", lines, [PlotCurve(joints.t[every], hand[every], "ink")])
    caption = study.text("motion_of_the_machine")
    study.scene("teaching", stick_figure(chain, joints.t, joints.angles, shadow=true.angles, caption=caption))


def measure(study: Study, *, seeds: int = 600, few: int = 100, faults: int = 200, hours: float = 3.0) -> None:
    """Measure every figure: tables over `seeds`, what is beside them over `few`, and faults over `faults`."""
    study.table("figure_2_mounting", [
        (name, f"{'+−'[k > 2]}{'xyz'[k % 3]}", " ".join(f"{v:g}" for v in mount.q_bs))
        for k, (name, mount) in enumerate(MOUNTS.items())
    ])  # fmt: skip
    for name, noise in (("noise_rest", REST), ("noise_turn", TURN)):
        gyr, bias = pb.units.to_deg(noise.gyr), pb.units.to_deg(noise.bias)
        study.values[name] = f"{gyr:.2g} °/s, ±{bias:.2g} °/s, {noise.acc / G0:.2g} g, {noise.mag:g} µT"
    study.values |= {"seeds": seeds, "few": few, "faults": faults}
    rest, _ = (table_part(study, turns, seeds)[0] for turns in (False, True))
    stated_part(study, study.seeds(few), rest)
    rules_part(study, study.seeds(few))
    faults_part(study, study.seeds(faults), 3600.0 * hours)
    teaching_part(study)
