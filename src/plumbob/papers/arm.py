"""Teaching arm [HuangJiang]: six units in ± sets, fuzzy and PI laws, a Kalman filter; and what an array can do.

Both tables of the paper are of simulations. With the noise that it states, its figures would be far smaller; they come
out with a noise that is assumed, which shows that they are possible and proves nothing. One run of each figure goes
through the bytes of the rig ``arm``; statistics are over seeds, drawn directly. The paper's system ends with
the attitude of one place of an arm; what it is for, a program for a robot, is done here with the rig ``teach``.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache
from typing import Any, Final, NamedTuple

import numpy as np

import plumbob as pb
from plumbob.papers.studies import MOUNTS, PlotCurve, Study, largest, rms, stick_figure

G0: Final = float(pb.units.g(1.0))
AXES: Final = ("roll", "pitch", "yaw")
TRIADS: Final = ("gyr", "acc", "mag")
COLOURS: Final = ("blue", "red", "green", "pink", "amber", "sky")
ALL: Final = 'units = "all"\n'  # what a session of a rig says of its units
RATE: Final = 10.0  # samples per second in the paper, Hz
DURATION: Final = 30.0  # s
TURN_RATE: Final = float(pb.units.deg(-90.0)) / DURATION
FIELD: Final = 50.0 * np.array([np.cos(pb.units.deg(50.0)), 0.0, np.sin(pb.units.deg(50.0))])  # NED, 50° down, µT
CASES: Final = {False: "static", True: "turn"}
CONTENDERS: Final = ("none", "pi", "fuzzy")
SCHEMES: Final[Mapping[str, Any]] = {
    "none": pb.array.Scheme(set1="none", sets=1, ekf=False),
    "pi": pb.array.Scheme(set1="pi", sets=1),
    "fuzzy": pb.array.Scheme(),
    "control": pb.array.Scheme(set1="pi"),
    "ekf": pb.array.Scheme(set1="none", sets=1),
    "bare": pb.array.Scheme(ekf=False),
    "sum": pb.array.Scheme(sum_table=True),
}
"""The paper's three contenders; the control, which has the same law on both sets; and what each part does alone."""
RECOVERIES: Final[Mapping[str, Any]] = {
    "fuzzy": pb.array.Scheme(ekf=False),
    "control": pb.array.Scheme(set1="pi", ekf=False),
    "sum": pb.array.Scheme(sum_table=True, ekf=False),
    "sum_alone": pb.array.Scheme(sum_table=True, sets=1, ekf=False),
    "ekf": pb.array.Scheme(),
}
STARTS: Final[Mapping[str, tuple[float, float, float]]] = {
    "yaw": (10.0, 0.0, 0.0),
    "roll": (0.0, 0.0, 10.0),
    "pitch": (0.0, 10.0, 0.0),
    "each": (10.0 / 3**0.5,) * 3,
    "all": (10.0, 10.0, 10.0),
}
"""Wrong starts: yaw, pitch and roll, deg."""
DESIGNS: Final = ((0.3, 3.0), (0.8, 9.0), (4.5, 9.0))  # slope, 1/s, and correction of large errors, deg/s, of rules
SCALE: Final = 0.003  # scale errors of the units, and angles between their axes
BIAS: Final = float(pb.units.dps(0.2))  # of a broken axis, rad/s
WATCH: Final = 90.0  # s
SINCE, UNTIL = 31.0, 60.0  # when a fault begins, in the second of rest after a motion or in its middle, and ends, s
WORLD: Final = {
    "mount_angle": "5 deg",
    "mount_shift": "2 cm",
    "bend": "20 uT",
}  # by which the rig is off


class UnitErrors(NamedTuple):
    """Errors of a unit: scatter of one sample, rad/s, m/s², µT, and half widths of biases that are spread evenly."""

    gyr: float
    acc: float
    mag: float
    bias: float  # of the gyroscope, rad/s
    iron: float = 0.0  # of the magnetometer, µT


REST: Final = UnitErrors(float(pb.units.dps(0.1)), 0.01 * G0, 0.5, float(pb.units.dps(0.13)))  # assumed: parts arm:rest
TURN: Final = UnitErrors(float(pb.units.dps(0.2)), 0.02 * G0, 1.0, float(pb.units.dps(0.25)))  # assumed: parts arm:turn
STATED: Final = UnitErrors(float(pb.units.dps(0.1 / 3600.0)), 1e-4 * G0, 0.05, 0.0)  # 0.1 °/h, 0.1 mg and 50 nT
Body = dict[str, dict[str, Any]]


@cache
def noise_card(noise: UnitErrors, rate: float) -> Any:
    """Card of white noise alone, of units at a rate, Hz."""
    ideal: Any = pb.simulate("arm", frame="NED", sensors="ideal", unit="calibrated", seed=0, duration="1 s")
    white = {name: np.full(3, getattr(noise, name) / np.sqrt(rate)) for name in TRIADS}
    triads = {name: replace(getattr(ideal.noise, name), n_rpsd=rpsd) for name, rpsd in white.items()}
    return replace(ideal.noise, **triads)


def with_noise(array: Any, noise: UnitErrors, rate: float = RATE) -> Any:
    """Array whose mounts know the noise of their units at a rate, Hz."""
    card = noise_card(noise, rate)
    return pb.ImuArray(array.units, {name: replace(mount, noise=card) for name, mount in array.mounts.items()})


def as_array(signals: Body, noise: UnitErrors = REST, rate: float = RATE, meta: Any = None) -> Any:
    """Array of what `drawn` gave."""
    t, mounts, how = signals["truth"]["t"], list(MOUNTS.values()), {} if meta is None else {"meta": meta}
    units = {n: pb.ImuData(t, of["gyr"], of["acc"], of["mag"], **how) for n, of in signals.items() if n != "truth"}
    return with_noise(pb.ImuArray(units, {name: mounts[k % 6] for k, name in enumerate(units)}), noise, rate)


def drawn(
    t: Any, q_nb: Any, rates: Any, noise: UnitErrors, rng: Any, *, units: int = 6, scale: float | None = None
) -> Body:
    """Values by unit and triad of a body with attitude (N, 4) and rates (N, 3); `truth` holds `t` and `q_nb`.

    With `scale`, gains and axes are off by it, and no unit has hard iron.
    """
    c_nb, mounts = pb.rotations.dcm_from_quat(q_nb), list(MOUNTS.values())
    felt = {"gyr": rates, "acc": -G0 * c_nb[:, 2], "mag": np.einsum("nji,j->ni", c_nb, FIELD)}
    signals: Body = {"truth": {"q_nb": q_nb, "t": t}}
    for u in range(units):
        of = {}
        for triad, values in felt.items():
            axes = np.eye(3) if scale is None else np.eye(3) + scale * rng.normal(size=(3, 3))
            scatter = getattr(noise, triad) * rng.normal(size=values.shape)
            of[triad] = (values @ mounts[u % 6].dcm) @ axes.T + scatter
        of["gyr"] += rng.uniform(-noise.bias, noise.bias, 3)
        if scale is None:
            of["mag"] += rng.uniform(-noise.iron, noise.iron, 3)
        signals[f"u{u + 1}"] = of
    return signals


def arm_array(
    seed: int, *, turns: bool, rate: float = RATE, noise: UnitErrors | None = None, duration: float = DURATION
) -> tuple[Any, Any]:
    """The paper's array in the turn from 0° to −90° or at rest, and the true attitude (N, 4) of its body in NED.

    At every rate, Hz, the scatter of a sample is that of 10 Hz.
    """
    noise, speed = noise or (TURN if turns else REST), TURN_RATE if turns else 0.0
    t = np.arange(round(duration * rate)) / rate
    q_nb = pb.rotations.quat_from_euler_zyx(np.stack((speed * t, 0.0 * t, 0.0 * t), axis=1))
    signals = drawn(t, q_nb, np.tile([0.0, 0.0, speed], (t.size, 1)), noise, np.random.default_rng([seed, turns]))
    return as_array(signals, noise, rate, pb.ImuMeta(rate_nominal=rate, frame=pb.Frame.NED)), q_nb


def moved(seed: int, duration: float, *, moving: bool, rate: float = RATE, units: int = 6) -> Body:
    """Values of units at rest, or turning with 60 °/s rms every other 20 s.

    At another rate than 10 Hz the scatter of a sample is larger by its root: the noise over time is the same.
    """
    rng, count = np.random.default_rng(seed), round(duration * rate)
    t, rates = np.arange(count) / rate, np.zeros((count, 3))
    q_nb = np.tile([1.0, 0.0, 0.0, 0.0], (count, 1))
    if moving:
        from scipy.signal import lfilter

        keep = np.exp(-1.0 / rate / 0.5)  # as an arm does, correlated over half a second
        on = (np.floor(t / 20.0) % 2 == 1)[:, np.newaxis]
        white = lfilter([np.sqrt(1.0 - keep**2)], [1.0, -keep], rng.normal(size=(count, 3)), axis=0)
        rates = pb.units.dps(60.0) * white * on
        q_nb = pb.rotations.quat_chained(rates / rate)[-count:]
    larger = {triad: getattr(REST, triad) * np.sqrt(rate / RATE) for triad in TRIADS}
    return drawn(t, q_nb, rates, REST._replace(**larger), rng, units=units, scale=SCALE)


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

    @property
    def standard_error(self) -> Any:
        """Standard error (3,) of the mean of the standard deviations, deg."""
        return self.each.std(axis=0) / np.sqrt(len(self.each))


def by_scheme(array: Any, scheme: Any, start: Any = None) -> Any:
    """Attitude (N, 4) in NED by the paper's scheme."""
    return pb.array.teaching_arm(array, frame=pb.Frame.NED, scheme=scheme, start=start).q_nb


def by_directions(array: Any, noise: UnitErrors) -> Any:
    """Attitude (N, 4) in NED by Plumbob's filter, which knows how a bias is spread."""
    settings = pb.array.MonitoringSettings(gyr_bias=noise.bias / np.sqrt(3.0))
    return pb.array.estimate(array, "directions", frame=pb.Frame.NED, settings=settings).track.q_nb


def measured(
    turns: bool, seeds: Sequence[int], *, rate: float = RATE, noise: UnitErrors | None = None, ours: bool = True,
    schemes: Mapping[str, Any] = SCHEMES,
) -> dict[str, Over]:  # fmt: skip
    """Statistics of every scheme over seeds, and of two and six units by Plumbob's filter where `ours`."""
    stats: dict[str, list[Any]] = {}
    noise = noise or (TURN if turns else REST)
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
        std, span, root = np.array(runs).transpose(1, 0, 2)
        over[name] = Over(std.mean(axis=0), span.mean(axis=0), rms(root, 0), std)
    return over


def recovery(scheme: Any, euler_deg: tuple[float, float, float] = STARTS["yaw"]) -> tuple[float, Any, Any]:
    """How a scheme forgets a start that is wrong by yaw, pitch and roll, deg, in 120 s without noise.

    From when on its largest error stays below 0.5°, s, infinite where it does not; times (N,) and those errors, deg.
    """
    array, truth = arm_array(0, turns=False, noise=UnitErrors(0.0, 0.0, 0.0, 0.0), duration=120.0)
    wrong = pb.rotations.quat_from_euler_zyx(pb.units.deg(np.array(euler_deg)))
    start = pb.rotations.quat_multiply(wrong, truth[0])
    error = largest(turn_errors(by_scheme(array, scheme, start), truth), 1)
    late = np.flatnonzero(error >= 0.5)
    after = int(late[-1]) + 1 if late.size else 0
    return float(array.t[after]) if after < error.size else float("inf"), array.t, error


def slow_mode(turn_deg: float = 10.0, kp: float = 0.8, ki: float = 0.02) -> float:
    """Time, s, after which the linear loop of PI on both sets keeps yaw below 0.5°, in closed form.

    A turn by yaw also leans the field: the products of both vectors are M θ with the matrix of roll and yaw
    M = [[1 + s², −c s], [−c s, c²]], c and s of the dip, whose smaller eigenvalue λ gives the poles of
    p² + λ Kp p + λ Ki = 0.
    """
    c, s = np.cos(pb.units.deg(50.0)), np.sin(pb.units.deg(50.0))
    values, vectors = np.linalg.eigh(np.array([[1.0 + s * s, -c * s], [-c * s, c * c]]))
    share = vectors[1, 0] ** 2 * turn_deg  # of yaw, in the slow eigenvector
    slow, fast = sorted(np.abs(np.roots([1.0, values[0] * kp, values[0] * ki])))
    return float(np.log(share * slow / (fast - slow) / 0.5) / slow)


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
    still = {} if turns else {"turn": "0 deg"}
    taken = study.recorded("arm", name, session=ALL, sensors=f"arm:{name}", scenario="arm", set=still)
    if not turns:
        study.rows({"live.same": study.live(taken)})
    array = with_noise(pb.read_array(taken.recording, mounts="arm"), noise)
    track: Any = pb.read(taken.truth.with_stem(f"{taken.truth.stem}-u1")).track  # u1 is aligned with the body
    truth = track.q_nb
    tracks = {scheme: by_scheme(array, SCHEMES[scheme]) for scheme in CONTENDERS} | {"six": by_directions(array, noise)}
    errors = {scheme: turn_errors(q_nb, truth) for scheme, q_nb in tracks.items()}
    if turns:
        angles = [pb.units.to_deg(np.unwrap(pb.rotations.euler_zyx_from_quat(q_nb)[:, 0]))
                  for q_nb in (truth, tracks["fuzzy"], tracks["six"])]  # fmt: skip
        looks = (("amber", "solid", 2.8), ("blue", "solid", 0.9), ("green", "dashed", 0.9))
        study.draw("figure_6", *(
            [PlotCurve(array.t, angle - middle, *look) for angle, look in zip(angles, looks, strict=True)]
            for middle in (0.0, angles[0])
        ))  # fmt: skip
    whats, ends = study.description.texts("what"), array.t[[0, -1]]
    for number, scheme in enumerate(CONTENDERS, 7 if turns else 3):
        bands = [np.full(2, std) for std in printed(study, turns, scheme)]
        study.draw(f"errors_{name}", *(
            [PlotCurve(ends, -band, "soft", to=band), PlotCurve(array.t, errors[scheme][:, i]),
             PlotCurve(array.t, errors["six"][:, i], "green")] for i, band in enumerate(bands)
        ), number=number, what=whats[scheme])  # fmt: skip
    words = study.description.texts("words")
    study.table(f"run_{name}", [[words[key], *map(three, statistics(e))] for key, e in errors.items()])
    study.step()
    stats = measured(turns, study.seeds(seeds))
    rows = [
        [words[key], three(printed(study, turns, key)) if key in CONTENDERS else "-",
         *map(three, (over.std, over.standard_error, over.range, over.rms))] for key, over in stats.items()
    ]  # fmt: skip
    study.table(f"table_{name}", rows)
    none, common = stats["none"], stats["fuzzy"].std / stats["pi, common start"].std
    study.values |= {f"{name}_std": none.std.mean(), f"{name}_rms": none.rms.mean(), f"{name}_ratio": common.max()}
    table_figures(study, turns, stats)
    return stats, errors


def of_runs(study: Study, key: str, value: Any, each: Any) -> None:
    """A mean figure, and how far one run lies off it by chance, of its values `each` (seeds,), or None."""
    if each is None:
        study.rows({key: value})
        return
    mean, sd = value[0] if isinstance(value, tuple) else value, float(each.std())
    away = abs(mean - study.description.printed(key)) / (sd or math.nan)
    reason = study.text("one_run", sd=sd, away=away, seeds=len(each))
    study.rows({key: value}, error=sd / math.sqrt(len(each)), one_run=sd, reason=reason)


def table_figures(study: Study, turns: bool, stats: Mapping[str, Over]) -> None:
    """Figures of a table, by angle: standard deviations, ranges, the control, ratios, and Plumbob's."""
    case, two, six = CASES[turns], stats["two"], stats["six"]
    for i, axis in enumerate(AXES):
        for end, field in (("", "std"), (".range", "range")):
            values = {name: getattr(stats[name], field)[i] for name in CONTENDERS}
            values["fuzzy"] = values["fuzzy"], getattr(six, field)[i]
            for name, value in values.items():
                of_runs(study, f"{case}.{name}{end}.{axis}", value, None if end else stats[name].each[:, i])
        study.rows({f"{case}.control.{axis}": stats["control"].std[i]})
        for pair in (("pi", "none"), ("fuzzy", "pi")):
            above, below = (stats[name] for name in pair)
            ratio, each = above.std[i] / below.std[i], above.each[:, i] / below.each[:, i]
            of_runs(study, f"{case}.{pair[0]}_over_{pair[1]}.{axis}", ratio, each)
        study.rows({f"{case}.two.{axis}": (None, two.std[i])}, error=two.standard_error[i])
    study.rows({f"{case}.none.rms": stats["none"].rms.mean()})


def hundred_part(study: Study, few: Sequence[int], turn: Mapping[str, Over]) -> None:
    """The turn at 100 Hz, beside that at 10 Hz."""
    study.step()
    schemes = {name: SCHEMES[name] for name in ("none", "pi", "fuzzy", "control")}
    fast, words = measured(True, few, rate=100.0, schemes=schemes), study.description.texts("words")
    rows = [(words[name], three(turn[name].std), three(fast[name].std)) for name in (*schemes, "two", "six")]
    study.table("turn_seeds_at", rows)
    study.rows({f"hundred.fuzzy.{axis}": (fast["fuzzy"].std[i], fast["six"].std[i]) for i, axis in enumerate(AXES)})


def stated_part(study: Study, seeds: Sequence[int], rest: Mapping[str, Over]) -> None:
    """The stated noise, the gain, measurements that are used once, and hard iron of ±1.5 µT in each unit."""
    study.step()
    over, rows = measured(False, seeds, noise=STATED, schemes={name: SCHEMES[name] for name in CONTENDERS}), []
    for name in CONTENDERS:
        key, value = f"stated.{name}", over[name].std.mean()
        best = over["six"].std.mean() if name == "fuzzy" else None
        study.rows({key: (value, best)}, value=float(np.mean(printed(study, False, name))) / value)
        row = study.outcomes[key]
        rows.append((row.what, f"{row.paper:g}", f"{value:.2g}", row.reason or ""))
    study.table("table_1_with", rows)
    corner, needed = 0.8 / (2.0 * math.pi), 2.0 * math.pi * 15.0  # of K = 0.8 1/s, and for motion of 15 Hz
    gains = {"gain.corner": corner, "gain.needed": needed, "gain.nyquist": 0.5 * RATE}
    study.rows(gains, step=1.0 / (1.0 + needed / RATE))
    study.rows({f"once.{axis}": rest["ekf"].std[i] for i, axis in enumerate(AXES)})  # before PI uses them again
    schemes = {name: SCHEMES[name] for name in ("pi", "control")}
    iron = measured(True, seeds, noise=TURN._replace(iron=1.5), ours=False, schemes=schemes)
    of_runs(study, "iron.pi", iron["pi"].std[2], iron["pi"].each[:, 2])
    study.rows({"iron.control": iron["control"].std[2]})
    combination_part(study)


def combination_part(study: Study) -> None:
    """What y⁺ and y⁻ give together: common bias, noise, and the parity."""
    common = pb.units.dps(0.3)
    array, _ = arm_array(study.seed, turns=True, noise=REST._replace(bias=float(pb.units.dps(0.05))))
    sets = pb.array.sets_of(array)
    plus, raw = sets.plus["gyr"] + common, -sets.minus["gyr"] + common  # both read 0.3 °/s too much
    true = np.array([0.0, 0.0, pb.units.dps(-3.0)])
    residual = 0.5 * (plus - raw).mean(axis=0) - true
    noise = 0.5 * (plus - raw).std(axis=0).mean() / plus.std(axis=0).mean()
    cosine = np.corrcoef((0.5 * (plus + raw))[:, 2], np.sin(array.t))[0, 1]
    figures = {"pair.bias": pb.units.to_dps(largest(residual)), "pair.noise": noise, "pair.parity": abs(cosine)}
    study.rows(figures, single=pb.units.to_dps((plus.mean(axis=0) - true)[0]))


def rules_part(study: Study, few: Sequence[int]) -> None:
    """Control, recovery from a wrong start, also in closed form, and the design of the rules."""
    study.step()
    words, starts = study.description.texts("recoveries"), study.description.texts("starts")
    runs = {n: {of: recovery(scheme, angles) for of, angles in STARTS.items()} for n, scheme in RECOVERIES.items()}
    for name, of in runs.items():
        why = study.text("10_of_yaw_take", slow_mode=slow_mode()) if name == "control" else None
        study.rows({f"recovery.{name}": of["yaw"][0]}, reason=why)
    rows = [[words[name], *(f"{time:.1f}" if np.isfinite(time) else "> 120" for time, _, _ in of.values())]
            for name, of in runs.items()]  # fmt: skip
    study.table("recovery_from_a", rows, head=(study.text("time_to_below_0"), *starts.values()))
    lines = zip((of["yaw"] for of in runs.values()), COLOURS, strict=False)
    study.draw("recovery_from_10", [PlotCurve(t, np.maximum(e, 1e-3), colour) for (_, t, e), colour in lines])
    schemes = {of: pb.array.Scheme(slope=of[0], far=float(pb.units.dps(of[1]))) for of in DESIGNS}
    stats = measured(False, few, ours=False, schemes={f"{of}": scheme for of, scheme in schemes.items()})
    designs = [[f"{of[0]:g}", f"{of[1]:g}", three(stats[f"{of}"].std), f"{recovery(scheme._replace(ekf=False))[0]:.1f}"]
               for of, scheme in schemes.items()]  # fmt: skip
    study.table("design_of_the", designs)


def with_fault(seed: int, *, moving: bool, units: int = 6, rate: float = RATE) -> tuple[Any, Any, str]:
    """An array of which a gyroscope's axis reads 0.2 °/s too much, what the monitor says, and the unit's name."""
    signals = moved(seed, WATCH, moving=moving, units=units, rate=rate)
    unit, rows = f"u{1 + seed % units}", slice(round(SINCE * rate), round(UNTIL * rate))
    signals[unit]["gyr"][rows, 0] += BIAS
    array = as_array(signals)
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
    detected, isolated = 100.0 / len(seeds) * len(delays), 100.0 * right / max(len(delays), 1)
    return {"detected": detected, "isolated": isolated, "median": median, "slow": slow}


def parity_test(step_dps: float, seed: int, runs: int = 200, duration: float = 60.0) -> tuple[int, float]:
    """Alarms, and their median time, s: the mean of p = (y⁺ + y⁻)/2, forgotten by 0.1, exceeds 5 of its deviations.

    `step_dps`: on one of the two gyroscopes of 0.1 °/s noise at 10 Hz, deg/s, from the first sample on.
    """
    keep, sd = 0.9, 0.1 / np.sqrt(2.0)  # of the parity, deg/s
    limit = 5.0 * sd * np.sqrt((1.0 - keep) / (1.0 + keep))
    rng = np.random.default_rng([seed, 3])
    mean = limit / 5.0 * rng.normal(size=runs)  # it has run for long
    when = np.full(runs, np.nan)
    for k in range(round(duration * RATE)):
        mean = keep * mean + (1.0 - keep) * (0.5 * step_dps + sd * rng.normal(size=runs))
        when[np.isnan(when) & (np.abs(mean) > limit)] = k / RATE
    alarms = when[np.isfinite(when)]
    return alarms.size, float(np.median(alarms)) if alarms.size else np.nan


def broken_at_rest(study: Study) -> tuple[Any, Any, str]:
    """As `with_fault`: six units at rest through bytes, where 0.2 °/s is added to what one axis was read to say."""
    still = {"turn": "0 deg", "time": f"{WATCH:g} s"}
    taken = study.recorded("arm", "watch", session=ALL, sensors="arm:rest", scenario="arm", set=still)
    array = with_noise(pb.read_array(taken.recording, mounts="arm"), REST)
    good = array.units["u3"]
    gyr = good.gyr.copy()
    gyr[(array.t >= SINCE) & (array.t < UNTIL), 0] += BIAS
    bad = pb.ImuData(good.t, gyr, good.acc, good.mag, meta=good.meta)
    array = pb.ImuArray({**array.units, "u3": bad}, array.mounts)
    return array, pb.array.monitor(array), "u3"


def away_from_the_rest(array: Any, monitored: Any, unit: str) -> list[PlotCurve]:
    """What a broken gyroscope reads beyond the rest, its mean over 1 s, and when it is left out."""
    t = monitored.imu.t
    away = pb.units.to_dps(array.units[unit].gyr[:, 0] - (monitored.imu.gyr @ array.mounts[unit].dcm)[:, 0])
    size = max(1, round(1.0 / float(np.median(np.diff(t)))))
    smooth = np.convolve(away, np.ones(size) / size)[: t.size]
    out = monitored.excluded("gyr")[:, monitored.names.index(unit)]
    return [PlotCurve(t, away, "soft", width=0.4), PlotCurve(t, smooth, width=1.0),
            PlotCurve(t, np.where(out, -0.6, np.nan), "muted", width=3.0)]  # fmt: skip


def faults_part(study: Study, seeds: Sequence[int], duration: float) -> None:
    """A fault of one axis over `seeds` and false alarms, with bars; a pair by its parity."""
    study.step()
    shown = [broken_at_rest(study), with_fault(study.seed, moving=True)]
    study.draw("fault_of_0", *(away_from_the_rest(*run) for run in shown))
    study.step()
    for name, moving in (("rest", False), ("moving", True)):
        stats = watched(moving=moving, seeds=seeds)
        study.rows({f"fault.{name}.{key}": (None, value) for key, value in stats.items()})
        quiet = [pb.array.monitor(as_array(moved(seed, duration, moving=moving))) for seed in study.seeds(3)]
        at_100 = watched(moving=moving, seeds=seeds[:25], rate=100.0)
        alarms = sum(len(monitored.faults) for monitored in quiet)
        study.rows({f"fault.{name}.100_hz": (None, at_100["median"])})
        study.rows({f"fault.{name}.alarms": (None, alarms / 3.0)}, error=math.sqrt(alarms) / 3.0)  # as counts scatter
    _, two, _ = with_fault(study.seed, moving=False, units=2)
    cannot = (two.imu.flags[round(SINCE * RATE) : round(UNTIL * RATE)] & pb.flags.CANNOT_ISOLATE) != 0
    study.rows({"fault.two": (None, cannot.any() and not two.faults)})
    parity = {size: parity_test(size, study.seed) for size in (0.0, 0.1, 0.2, 0.3, 0.5)}
    study.rows({"parity.alarms": (None, parity[0.0][0])})
    for size, (count, median) in parity.items():
        if size:
            study.rows({f"parity.{size:g}": (None, median)}, found=count)
    study.table("test_of_the", [(f"{size:g}", f"{n}", f"{t:.1f}" if n else "-") for size, (n, t) in parity.items()])


def mounts_rms(chain: Any, other: Any) -> float:
    """Rms of the angles between the mounts of two chains, deg."""
    pairs = [(a.mount.q_bs, b.mount.q_bs) for a, b in zip(chain.segments, other.segments, strict=True) if a.unit]
    a, b = np.array(pairs).transpose(1, 0, 2)
    turns = pb.rotations.rotvec_from_quat(pb.rotations.quat_multiply(pb.rotations.quat_conjugate(a), b))
    return float(pb.units.to_deg(np.sqrt(np.mean(np.sum(np.square(turns), axis=1)))))


def teach(study: Study, duration: float | None) -> tuple[Any, ...]:
    """Align the units on one recording of `duration`, s, estimate another one, export its program, and replay it."""
    how: dict[str, Any] = {"session": ALL, "set": WORLD, "unit": "calibrated", "duration": duration}
    held, params = pb.units.deg(0.5), {"mean_rate": False}  # a frame of the rig has the rate at its time
    first = study.recorded("teach", "align", scenario="calibration", **how)
    take = study.recorded("teach", "teach", **how)
    chain = pb.load_chain(take.truth.with_suffix(".chain.toml"))
    placed = pb.load_chain(take.truth.with_name(f"{take.truth.stem}-true.chain.toml"))
    pose = 0.0, 1.8, [0.0] * len(chain.angles)  # the program of alignment begins with two seconds at zero
    card = pb.arm.align(chain, pb.read_array(first.recording), poses=[pose], pose_sd=held, params=params)
    card.save(study.folder / "arm.card.json", overwrite=True)
    true = pb.arm.JointTrack.load(take.truth.with_stem(f"{take.truth.stem}-angles"))
    start, array = true.angles[0].tolist(), pb.read_array(take.recording)
    joints = pb.arm.run(card, array, frame="NED", pose=start, pose_sd=held, params=params).joints
    program = pb.arm.taught(joints, chain, rate="100 Hz")
    files = [study.folder / f"program.{kind}" for kind in ("csv", "yaml", "mcap", "script", "urdf")]
    for path in files[:-1]:
        pb.arm.export(program, path, overwrite=True)
    files[-1].write_text(pb.arm.urdf_text(chain), encoding="utf-8")
    loaded = pb.arm.Program.load(files[0])
    model, ours = pb.arm.replay(loaded, files[-1]), pb.arm.replay(loaded, chain)
    before, after = (mounts_rms(of, placed) for of in (chain, card.chain))
    study.values |= {"mounts_deg": before, "done_mounts_deg": after, "files": ", ".join(path.name for path in files)}
    residual = np.abs(model.hand - ours.hand).max()
    return chain, joints, true, program, model, residual


def teaching_part(study: Study, duration: float | None) -> None:
    """A machine is taught by hand: bytes of six units on its links become a program, and a model that moves."""
    study.step()
    chain, joints, true, program, model, residual = teach(study, duration)
    error = pb.units.to_deg(pb.rotations.wrap(joints.angles - true.angles))
    hand = 1e3 * np.linalg.norm(joints.hand - true.hand, axis=1)
    values = {
        "mounts": study.values["done_mounts_deg"],
        "angles.rms": rms(error),
        "angles.max": largest(error, None),
        "hand.rms": rms(hand),
        "hand.max": hand.max(),
        "program": 100.0 * model.against(true.t, true.hand).rms_share,
        "limits": 100.0 * max(program.used(chain).values()),
        "stops": len(program.stops),
        "replay": 1e3 * residual,
    }
    study.rows({f"teach.{name}": (None, value) for name, value in values.items()})
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
    each = zip(error.T, COLOURS, strict=True)
    lines = [PlotCurve(joints.t[every], of[every], colour) for of, colour in each]
    study.draw("errors_of_the", lines, [PlotCurve(joints.t[every], hand[every], "ink")])
    caption = study.text("motion_of_the_machine")
    study.scene("teaching", stick_figure(chain, joints.t, joints.angles, shadow=true.angles, caption=caption))


def measure(
    study: Study,
    *,
    seeds: int = 600,
    few: int = 100,
    faults: int = 200,
    hours: float = 3.0,
    taught: float | None = None,
) -> None:
    """Measure every figure: tables over `seeds`, what is beside them over `few`, and faults over more of those.

    With 600 seeds the standard error of a figure is about a tenth of what the seeds of one run scatter by.
    """
    names = [(name, f"{'+−'[k > 2]}{'xyz'[k % 3]}", " ".join(f"{v:g}" for v in mount.q_bs))
             for k, (name, mount) in enumerate(MOUNTS.items())]  # fmt: skip
    study.table("figure_2_mounting", names)
    for name, noise in (("noise_rest", REST), ("noise_turn", TURN)):
        gyr, bias = pb.units.to_deg(noise.gyr), pb.units.to_deg(noise.bias)
        study.values[name] = f"{gyr:.2g} °/s, ±{bias:.2g} °/s, {noise.acc / G0:.2g} g, {noise.mag:g} µT"
    study.values |= {"seeds": seeds, "few": few, "faults": faults}
    rest, turn = (table_part(study, turns, seeds)[0] for turns in (False, True))
    hundred_part(study, study.seeds(few), turn)
    stated_part(study, study.seeds(few), rest)
    rules_part(study, study.seeds(few))
    faults_part(study, study.seeds(faults), 3600.0 * hours)
    teaching_part(study, taught)
