"""The trackball paper [Chen2013]: a drift model and a scalar Kalman filter of an MPU-3050, at rest and on a turntable.

The paper's method is its drift model, the constant of a rest, and the scalar filter, whose Q and R it does not give:
every Q/R is tried. Ours are a calibration card and a filter of two states. The recorded tests go through the bytes of
the rig ``trackball`` with one unit; statistics over many seeds are simulated directly, with the noise that is assumed,
as the paper's figures are lost: 0.1 °/s per sample, 36 °/h, and 1.5 °/s of bias at turn-on.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

import plumbob as pb
from plumbob.papers.studies import PlotCurve, Scene, Study, rms

RATIOS: Final = (1e-1, 1e-2, 1e-3, 1e-4, 1e-6)  # Q/R of the scalar filter
AT_REST: Final = 1e-3  # Q/R at which the bars of the test at rest are set, and Figures 1 to 3 are drawn
IN_MOTION: Final = 1e-2  # Q/R with which Figures 4 and 5 are drawn: a smaller one lags by more
STEP: Final = 0.1  # [Chen2013]: sampling time of both tests, s
SAMPLES: Final = 1000  # [Chen2013]: of each record, 100 s
REST: Final = SAMPLES * STEP
SLOPE: Final = pb.units.deg(0.6)  # [Chen2013]: rad/s², while the table speeds up: 10 r/min in 100 s
WHITE, BIAS, WALK = (pb.units.dps(value) for value in (0.1, 1.5, 5e-4))
"""Noise of a sample and bias at turn-on, rad/s, and random walk of the bias in the long record, rad/s/√s: assumed."""
FLICKER: Final = pb.units.dps(36.0 / 3600.0)  # bias instability, rad/s: assumed
TAUS: Final = (0.1, 0.2, 0.4, 1.0, 2.0, 4.0, 10.0, 50.0)  # averaging times of the paper, s
LONG_TAUS: Final = (0.1, 1.0, 10.0, 100.0, 600.0)
LONG: Final = 4 * 3600.0  # length of the long record, s
PARTS: Final = {"a": 0.03, "b": -0.05}
"""True coefficients of temperature of two parts, °/s per °C; the paper takes 0.1 for every one."""
LAST: Final = 30  # samples at the end of a warm-up, 3 s, over which what is left is averaged
SETTLED: Final = 600  # samples after which a filter's lag is measured, on the rest of the ramp
HELD: Final = 50  # samples of the constant rate, 5 s, that the second score of it leaves out: what the ramp left there
GAINS: Final = [0.3 + 0.02 * k for k in range(33)]
SEEDS: Final = {"short": 200, "white": 20, "long": 10, "table": 50, "part": 10}
VIEW: Final = np.array([0.55, 0.75, 0.36]) / np.linalg.norm([0.55, 0.75, 0.36])  # from where the ball is seen


class Smoothing(NamedTuple):
    """A filter of rates and its parameters."""

    filter: str
    params: Mapping[str, float]

    def smooth(self, t: Any, rate: Any) -> Any:
        """Rates (N, 3) after it."""
        return pb.filter_rates(pb.ImuData(t=t, gyr=rate), self.filter, params=self.params).imu.gyr


def gain(ratio: float) -> float:
    """Gain K that the scalar filter settles at, from Q/R."""
    p = 0.5 * (ratio + math.sqrt(ratio * (ratio + 4.0)))
    return p / (1.0 + p)


def scalar(ratio: float) -> Smoothing:
    """Scalar Kalman filter of that Q/R."""
    return Smoothing("scalar", {"walk": WHITE * math.sqrt(ratio / STEP), "noise": WHITE})


UNFILTERED: Final = Smoothing("moving_average", {"samples": 1.0})
TWO_STATES: Final = Smoothing("two_state", {"noise": WHITE})
LINES: Final[Mapping[str, tuple[Smoothing, bool]]] = {
    "compensated": (UNFILTERED, False),
    "paper": (scalar(IN_MOTION), False),
    "calibrated": (UNFILTERED, True),
    "calibrated, paper's filter": (scalar(IN_MOTION), True),
    "best": (TWO_STATES, True),
}
"""How recorded rates are made: by which filter, and by a card or by the paper's drift model; less that of the rest."""


def on_table() -> dict[str, tuple[Smoothing, float]]:
    """Filters of the turntable, and how many samples late a ramp comes: scalar ones, averages as quiet, ours."""
    filters: dict[str, tuple[Smoothing, float]] = {"unfiltered": (UNFILTERED, 0.0)}
    for ratio in RATIOS:
        k, count = gain(ratio), round(2.0 / gain(ratio) - 1.0)
        filters[f"scalar {ratio:g}"] = scalar(ratio), (1.0 - k) / k
        filters[f"average {ratio:g}"] = Smoothing("moving_average", {"samples": float(count)}), 0.5 * (count - 1)
    return {**filters, "two states": (TWO_STATES, 0.0)}


def simulate_unit(
    seed: int, duration: float | None, scenario: str = "static", temp_c: Any = 25.0, **errors: Any
) -> Any:
    """Three channels of the unit with the assumed noise, and further errors of `plumbob.simulation.TriadErrors`."""
    gyr = pb.simulation.TriadErrors(**{"white_sd": np.full(3, WHITE), **errors})
    unit = pb.simulation.Module("mpu3050", "assumed for the trackball paper", gyr=gyr)
    how: dict[str, Any] = {"sensors": unit, "unit": "random", "seed": seed, "rate": 1.0 / STEP, "duration": duration}
    return pb.simulate(scenario, frame="NED", temp_c=temp_c, **how)


def at_rest(seed: int, duration: float, **errors: Any) -> tuple[Any, Any]:
    """Times and rates (N, 3) of a unit at rest, with flicker noise."""
    imu = simulate_unit(seed, duration, **{"flicker": np.full(3, FLICKER), **errors}).imu
    return imu.t, imu.gyr


def warm_up(study: Study, coefficient: float, count: int) -> tuple[float, float, float, float]:
    """Mean rate at 45 °C of a part whose bias is 0 at 25 °C, °/s: measured, by the paper's 0.1, by its own card.

    The card is that of a soak of an hour, and its drift is compared with the true one, so that noise does not count;
    last, the coefficient that the card has, °/s per °C.
    """
    per_k, first = np.full(3, pb.units.dps(coefficient)), study.seeds(1).start

    def warming(seed: int, duration: float) -> Any:
        warmth = pb.simulation.signals.Polynomial((25.0, 20.0 / duration))
        return simulate_unit(seed, duration, temp_c=warmth, bias_per_k=per_k).imu

    soak = warming(first, 3600.0)
    card = pb.calibrate(soak, "temperature").card
    tests = [warming(first + 1 + k, REST) for k in range(count)]
    raw = np.mean([test.gyr[-LAST:] for test in tests])
    ways = [pb.filter_rates(test, "moving_average", params=UNFILTERED.params, drift="chen2013") for test in tests]
    warm = {"gyr": np.tile(20.0 * per_k, (2, 1)), "temp_c": np.full(2, 45.0)}
    still = pb.ImuData(t=np.array([0.0, STEP]), **warm, meta=soak.meta)
    left: Any = [np.mean([way.imu.usable("gyr")[-LAST:] for way in ways])]
    left.append(np.mean(pb.apply_card(card, still).usable("gyr")))
    found: Any = card.gyr
    return tuple(pb.units.to_dps(np.array([raw, *left, found.bias_per_k[0, 0]])).tolist())


def drift_part(study: Study, parts: int, noise: Path, soak_seconds: float) -> None:
    """Parts that warm up, and a recorded soak."""
    by_part = {name: warm_up(study, true, parts) for name, true in PARTS.items()}
    end_sd = pb.units.to_dps(2.0 * WHITE / math.sqrt(3.0 * 3600.0 / STEP))  # of the end of a line, mean of three axes
    for name, (raw, printed, by_card, _) in by_part.items():
        study.rows({f"drift.raw.{name}": raw})
        study.rows({f"drift.left.{name}": (printed, abs(by_card))}, error=end_sd)
    turned = 60.0 / 250.0  # of the range, °/s: 0.2 % of it in its middle, nothing at its ends
    study.rows({"drift.k_t": (None, by_part["a"][3]), "drift.bow": 0.002 * 250.0 * 4.0 * turned * (1.0 - turned)})
    study.table("mean_rate_at", [[f"{PARTS[name]:+.2f}".replace("-", "−"), *of] for name, of in by_part.items()])
    study.step()
    file = study.recorded("trackball", "soak", noise=noise, warm_up="20 K, 600 s", duration=soak_seconds).recording
    ways: dict[str, dict[str, Any]] = {
        "measured": {}, "printed": {"drift": "chen2013"},
        "soak": {"calibration": pb.calibrate(file, "temperature").card},
    }  # fmt: skip
    last, means = round(0.1 * soak_seconds / STEP), {}
    made: dict[str, Any] = {"params": UNFILTERED.params, "rest": (0.0, 5.0)}
    for name, how in ways.items():
        rate = pb.filter_rates(file, "moving_average", **made, **how).imu.usable("gyr")
        means[name] = pb.units.to_dps(rate[-last:].mean(axis=0))
    study.table("recorded_soak_of", means)


def factors(taus: Iterable[float]) -> list[int]:
    """Averaging factors of averaging times, s."""
    return [round(tau / STEP) for tau in taus]


def squares(rate: Any, taus: Sequence[float]) -> Any:
    """Mean squares of a record about its mean and of its integrated angle, and its Allan variances."""
    angle = STEP * np.cumsum(rate, axis=0)
    level = [np.mean((rate - rate.mean(axis=0)) ** 2), np.mean(angle**2)]
    return np.concatenate((level, np.mean(pb.noise.deviation(rate, factors(taus)) ** 2, axis=1)))


def ratios(records: Iterable[tuple[Any, Any]], taus: Sequence[float]) -> tuple[Any, Any]:
    """What the filters leave of the `squares` of records (Q/R, 2 + k), and Allan deviations before, rad/s (k,)."""
    before, after = [], []
    for t, rate in records:
        before.append(squares(rate, taus))
        after.append([squares(scalar(q).smooth(t, rate), taus) for q in RATIOS])
    raw = np.mean(before, axis=0)
    return np.mean(after, axis=0) / raw, np.sqrt(raw[2:])


def rest_part(study: Study, noise: Path) -> None:
    """The recorded static test: Figures 1 and 2, the random sequence of x before and after the filter."""
    file = study.recorded("trackball", "static", noise=noise).recording
    raw: Any = pb.read(file).imu
    to_dps, rates = pb.units.to_dps, []
    for way in (UNFILTERED, scalar(AT_REST), TWO_STATES):
        made = pb.filter_rates(file, way.filter, params=way.params, drift="chen2013", rest=(0.0, REST))
        rates.append(made.imu.usable("gyr")[:, 0])
    before, after, best = rates
    study.rows({"rest.before": to_dps(before.std()), "rest.after": (to_dps(after.std()), to_dps(best.std()))})
    study.values["constant"] = ", ".join(f"{v:.2f}".replace("-", "−") for v in to_dps(raw.gyr.mean(axis=0)))
    study.draw("figure_1", [PlotCurve(raw.t, to_dps(before))])
    study.draw("figure_2", [PlotCurve(raw.t, to_dps(best), "green"), PlotCurve(raw.t, to_dps(after), "red")])
    compared = [pb.noise.curve(of, STEP, np.array(factors(TAUS))) for of in (before, after)]
    study.values["curves"] = [
        PlotCurve(TAUS, to_dps(of.dev), colour, dash, mark="o", to=to_dps(np.array([of.lo, of.hi])))
        for of, colour, dash in zip(compared, ("blue", "red"), ("solid", "dashed"), strict=True)
    ]


def statistics_part(study: Study, seeds: Mapping[str, int], long_seconds: float) -> None:
    """Many records at rest: variances, Figure 3, four hours, and fits of five powers."""
    study.step()
    records = [at_rest(seed, REST) for seed in study.seeds(seeds["short"])]
    short, before = ratios(records, TAUS)
    single = np.concatenate([pb.noise.deviation(rate, factors(TAUS), "adev").T for _, rate in records])
    powers = np.power.outer(np.array(TAUS), np.arange(-2.0, 3.0))  # [Chen2013] (14)
    plain = np.linalg.lstsq(powers, (single.T) ** 2, rcond=None)[0]
    study.step()
    white = np.mean([white_left(seed) for seed in study.seeds(seeds["white"])], axis=0)
    theory = np.array([gain(q) / (2.0 - gain(q)) for q in RATIOS])
    study.step()
    hours = [at_rest(seed, long_seconds, walk_rpsd=np.full(3, WALK)) for seed in study.seeds(seeds["long"])]
    long, long_before = ratios(hours, LONG_TAUS)
    terms = pb.noise.analyse(np.ascontiguousarray(hours[0][1][:, 0]), STEP).terms
    row, adev, long_adev = RATIOS.index(AT_REST), np.sqrt(short[:, 2:]), np.sqrt(long[:, 2:])
    n, b = 60.0 * pb.units.to_deg(terms["N"].value), 3600.0 * pb.units.to_deg(terms["B"].value)
    study.rows({
        **{f"rest.variance.q{-round(math.log10(q))}": white[k] / theory[k] for k, q in enumerate(RATIOS)},
        **{f"allan.ratio.{tau:g}": adev[row, k] for k, tau in enumerate(TAUS)},
        "allan.scatter": single[:, -1].std() / single[:, -1].mean(),
        **{f"allan.long.{tau:g}": long_adev[row, LONG_TAUS.index(tau)] for tau in (100.0, 600.0)},
        "allan.angle": math.sqrt(short[row, 1]),
        "fit.negative": 100.0 * np.mean((plain < 0.0).any(axis=0)),
        "noise.white": (None, n),
        "noise.flicker": (None, b),
    })  # fmt: skip
    scatter = study.outcomes["allan.scatter"].faithful
    study.values.update(adev=100 * long_adev[row, 3], scatter=scatter, white_n=n, flicker=b)
    columns = (map(gain, RATIOS), theory, white, short[:, 0], np.sqrt(short[:, 1]))
    study.table("at_rest_samples", [[f"{q:g}", *of] for q, *of in zip(RATIOS, *columns, strict=True)], samples=SAMPLES)
    for name, ratio, dev in (("allan_short", adev, before), ("allan_long", long_adev, long_before)):
        rows = [[f"Q/R = {q:g}", *ratio[k]] for k, q in enumerate(RATIOS)]
        study.table(name, [[study.text("before_s"), *pb.units.to_dps(dev)], *rows])
    colours = ("sky", "amber", "red", "pink", "olive")
    by_ratio = [PlotCurve(TAUS, adev[k], colour, mark="o") for k, colour in enumerate(colours)]
    study.draw("figure_3", study.values.pop("curves"), by_ratio)


def white_left(seed: int, duration: float = 10_000.0) -> Any:
    """Share (k,) of the variance of white noise that each filter leaves once it has settled, to 1 %."""
    t, rate = at_rest(seed, duration, flicker=np.zeros(3))
    settled = {q: math.ceil(5.0 / gain(q)) for q in RATIOS}
    squares_of = [np.mean(scalar(q).smooth(t, rate)[start:] ** 2) for q, start in settled.items()]
    return np.array(squares_of) / np.mean(rate**2)


def turn_table(seed: int, scale: float) -> tuple[Any, Any, Any, Any]:
    """Times, true and measured rates (N,) about the table's axis, and these less the mean of a rest."""
    errors = {"flicker": np.full(3, FLICKER), "scale": np.full(3, scale), "bias": np.full(3, BIAS)}
    made = simulate_unit(seed, None, "turntable", **errors)
    rest = simulate_unit(seed + 1_000_000, REST, bias=np.full(3, BIAS), flicker=np.full(3, FLICKER)).imu
    measured = made.imu.gyr[:, 2]
    return made.imu.t, made.kinematics.rate_b[:, 2], measured, measured - rest.gyr[:, 2].mean()


def smooth_channel(way: Smoothing, t: Any, rate: Any) -> Any:
    """One channel (N,) after a filter."""
    return way.smooth(t, np.tile(rate[:, np.newaxis], 3))[:, 0]


def score(rate: Any, true: Any, given: Any) -> list[float]:
    """Of one run, °/s: squares on the ramp, held and 5 s later; means; °: the angle's largest error; and the lag."""
    to_dps = pb.units.to_dps
    error = to_dps(rate - true)
    ramp, hold = error[:SAMPLES], error[SAMPLES:]
    angle = np.abs(STEP * np.cumsum(ramp)).max()
    late = to_dps(given - rate)[SETTLED:SAMPLES].mean()
    return [np.mean(ramp**2), np.mean(hold**2), np.mean(hold[HELD:] ** 2), ramp.mean(), hold.mean(), angle, late]


def many_turns(study: Study, count: int, scale: float) -> dict[str, Any]:
    """Scores (7,) of every filter, means over the seeds, the first three as roots; "measured" before any correction."""
    filters, runs = on_table(), []
    for seed in study.seeds(count):
        t, true, measured, given = turn_table(seed, scale)
        after = [smooth_channel(way, t, given) for way, _ in filters.values()]
        runs.append([score(measured, true, measured), *(score(rate, true, given) for rate in after)])
    mean = np.mean(runs, axis=0)
    mean[:, :3] = np.sqrt(mean[:, :3])
    return dict(zip(["measured", *filters], mean, strict=True))


def best_gain(study: Study, count: int, gains: Sequence[float]) -> tuple[float, float]:
    """The settled gain K of a scalar filter with the least error on the ramp, and that error, rms, °/s."""
    errors = []
    for seed in study.seeds(count):
        t, true, _, given = turn_table(seed, 0.0)
        rates = (smooth_channel(scalar(k**2 / (1.0 - k)), t, given) for k in gains)  # K = p/(1 + p), p² = Q/R (p + 1)
        errors.append([np.mean(pb.units.to_dps(rate - true)[:SAMPLES] ** 2) for rate in rates])
    mean = np.mean(errors, axis=0)
    return gains[int(mean.argmin())], math.sqrt(mean.min())


def turntable_part(study: Study, count: int, gains: Sequence[float]) -> None:
    """The turntable over many seeds: flicker noise alone moves the rms of one run by a tenth."""
    study.step()
    rows, wrong = (many_turns(study, count, scale) for scale in (0.0, 0.01))
    study.step()
    k, least = best_gain(study, count, gains)
    filtered, two, removed = rows[f"scalar {IN_MOTION:g}"], rows["two states"], rows["unfiltered"]
    names = ("ramp.rms", "hold.rms", "hold.late", "ramp.mean", "hold.mean", "ramp.angle")
    study.rows({
        "ramp.removed": removed[0],
        **{name: (filtered[i], two[i]) for i, name in enumerate(names)},
        **{f"ramp.lag.q{-round(math.log10(q))}": rows[f"scalar {q:g}"][6] for q in RATIOS[:4]},
        "ramp.lag": (None, two[6]),
        "ramp.gain": least,
        "ramp.misled": wrong[f"scalar {IN_MOTION:g}"][0],
        "drift.gain": (wrong[f"scalar {IN_MOTION:g}"][4], study.values["held"]),
    }, ramp_rms=rows["measured"][0], removed_ramp_rms=removed[0])  # fmt: skip
    study.values.update(gain=k, run_gain=least)
    lags = {name: pb.units.to_deg(SLOPE) * STEP * late for name, (_, late) in on_table().items()}
    lags["measured"] = math.nan
    for scale, by in (("right", rows), ("wrong", wrong)):
        study.table(f"turntable_{scale}", {name: [*of[:5], of[6], lags[name], of[5]] for name, of in by.items()})


def filtered_rates(file: Path, name: str, card: Path) -> Any:
    """Rates of a recording by one of `LINES`."""
    way, calibrated = LINES[name]
    how: dict[str, Any] = {"calibration": card} if calibrated else {"drift": "chen2013"}
    return pb.filter_rates(file, way.filter, params=way.params, rest=(0.0, REST), **how)


def recorded_part(study: Study, noise: Path) -> None:
    """The recorded turntable and the recorded ball, with the card of a rate table."""
    to_dps, to_deg = pb.units.to_dps, pb.units.to_deg
    study.step()
    taken = study.recorded("trackball", "ratetable", noise=noise, scenario="ratetable")
    card = study.folder / "card.json"
    rates = [float(pb.units.dps(rate)) for rate in (50.0, 100.0, 200.0)]
    pb.calibrate(taken.recording, "table", rates=rates).save(card, overwrite=True)
    taken = study.recorded("trackball", "turntable", noise=noise, scenario="turntable", set={"lead": REST})
    imu: Any = pb.read(taken.recording).imu
    truth: Any = pb.read(taken.truth).track
    begin = imu.t >= REST
    t = imu.t[begin] - REST
    true = np.minimum(to_deg(SLOPE) * t, 60.0)
    by_line = {name: filtered_rates(taken.recording, name, card) for name in LINES}
    rate = {name: to_dps(of.imu.usable("gyr")[begin, 2]) for name, of in by_line.items()}
    error = {name: of - true for name, of in rate.items()}
    heading = {}
    for name in (name for name, (_, calibrated) in LINES.items() if calibrated):
        track: Any = pb.estimate(by_line[name].recording, "integrate", frame="NED", init="level").track
        heading[name] = to_deg(np.unwrap(track.yaw) - np.unwrap(truth.yaw))[begin]
    ends = [abs(heading[name][SAMPLES - 1]) for name in ("calibrated, paper's filter", "calibrated")]
    study.rows({
        "bytes.ramp": (rms(error["paper"][:SAMPLES]), rms(error["best"][:SAMPLES])),
        "bytes.hold": (rms(error["paper"][SAMPLES:]), rms(error["best"][SAMPLES:])),
        "bytes.heading": tuple(ends),
    })  # fmt: skip
    study.values.update(behind=ends[0], calibrated=ends[1], held=abs(error["best"][SAMPLES:].mean()))
    raw = to_dps(imu.gyr[begin, 2])
    for key, part in (("figure_4", slice(0, SAMPLES)), ("figure_5", slice(SAMPLES, 2 * SAMPLES))):
        shown = [PlotCurve(t[part], raw[part], "muted"), PlotCurve(t[part], rate["paper"][part], "red")]
        shown += [PlotCurve(t[part], rate["best"][part], "green"), PlotCurve(t[part], true[part], "ink", "dashed")]
        errors = [PlotCurve(t[part], error["paper"][part], "red"), PlotCurve(t[part], error["best"][part], "green")]
        study.draw(key, shown, errors)
    lines = {"calibrated": "blue", "calibrated, paper's filter": "red", "best": "green"}
    mean = {name: np.convolve(error[name], np.ones(10) / 10.0, "same") for name in lines}
    panels = ([PlotCurve(t, of[name], colour) for name, colour in lines.items()] for of in (mean, heading))
    study.draw("lag_of_the", *panels)
    study.step()
    taken = study.recorded("trackball", "ball", noise=noise, scenario="ball", set={"lead": REST})
    study.rows({"live.same": study.live(taken)})
    ball_part(study, taken, card)


def angle_between(one: Any, other: Any) -> Any:
    """Angle (N,), °, between points (N, 3) of the unit ball."""
    return pb.units.to_deg(2.0 * np.arcsin(np.clip(0.5 * np.linalg.norm(one - other, axis=1), 0.0, 1.0)))


def touched(track: Any) -> Any:
    """Which of 2000 places, spread evenly over the ball, a track (N, 3) of touching points comes within 5° of."""
    k = np.arange(2000) + 0.5
    z, around = 1.0 - k / 1000.0, np.pi * (1.0 + np.sqrt(5.0)) * k
    places = np.stack((np.sqrt(1.0 - z**2) * np.cos(around), np.sqrt(1.0 - z**2) * np.sin(around), z), axis=1)
    return (places @ track.T).max(axis=1) >= np.cos(pb.units.deg(5.0))


def ball_part(study: Study, taken: Any, card: Path) -> None:
    """The point that touches the lower plate, in axes of the ball, which the paper's application is about."""
    truth: Any = pb.read(taken.truth).track
    begin = truth.t >= REST
    t = truth.t[begin] - REST

    def touching(track: Any) -> Any:
        return pb.rotations.quat_rotate(pb.rotations.quat_conjugate(track.q_nb[begin]), np.array([0.0, 0.0, 1.0]))

    given = {"measured": taken.recording}
    given |= {name: filtered_rates(taken.recording, name, card).recording for name in LINES}
    tracks = {"true": touching(truth)}
    for name, rates in given.items():
        tracks[name] = touching(pb.estimate(rates, "integrate", frame="NED", init="level").track)
    away = {name: angle_between(track, tracks["true"]) for name, track in tracks.items()}
    cover = {name: touched(track) for name, track in tracks.items()}
    study.rows({
        "ball.track": (rms(away["paper"]), rms(away["calibrated"])),
        "ball.covered": tuple(100.0 * cover[name].mean() for name in ("paper", "calibrated")),
        "ball.wrong": tuple(100.0 * (cover[name] != cover["true"]).mean() for name in ("paper", "calibrated")),
    }, covered=100.0 * cover["true"].mean())  # fmt: skip
    study.table("error_of_the", {name: [rms(away[name]), away[name].max(), away[name][-1]] for name in given})
    right = np.cross([0.0, 0.0, -1.0], VIEW)
    right /= np.linalg.norm(right)
    across = np.stack((right, np.cross(VIEW, right)))
    turn = np.linspace(0.0, 2.0 * np.pi, 181)
    panels = []
    for name, colour in (("true", "blue"), ("measured", "olive"), ("paper", "red"), ("calibrated", "green")):
        points, near = tracks[name] @ across.T, tracks[name] @ VIEW > 0.0
        sides = [np.where(side[:, np.newaxis], points, np.nan).T for side in (~near, near)]
        far, close = PlotCurve(sides[0][0], sides[0][1], "soft"), PlotCurve(sides[1][0], sides[1][1], colour)
        panels.append([PlotCurve(np.cos(turn), np.sin(turn), "muted"), far, close])
    study.draw("track_of_the", *panels)
    few = slice(None, None, 2)
    points = {"o": np.zeros((t[few].size, 3)), study.text("true_2"): tracks["true"][few]}
    lines, circle = [("o", "true")], np.stack((np.cos(turn[::15]), np.sin(turn[::15]), 0.0 * turn[::15]), axis=1)[:-1]
    for k, columns in enumerate(((0, 1, 2), (0, 2, 1), (2, 0, 1))):  # the circles in the planes of the axes
        names = [f".{k}.{i}" for i in range(len(circle))]
        points |= {name: np.tile(at, (t[few].size, 1)) for name, at in zip(names, circle[:, columns], strict=True)}
        lines += list(zip(names, [*names[1:], names[0]], strict=True))
    shown: dict[str, Any] = {"trail": "true", "values": {study.text("apart"): away["paper"][few]}}
    shadow = {"o": points["o"], "true": tracks["paper"][few]}
    study.scene("ball", Scene(study.text("touching_point_on_the"), t[few], points, lines, shadow=shadow, **shown))


def measure(
    study: Study, *, seeds: Mapping[str, int] = SEEDS, long_seconds: float = LONG, soak_seconds: float = 3600.0,
    gains: Sequence[float] = GAINS,
) -> None:  # fmt: skip
    """Measure every figure of the paper."""
    noise = study.folder / "noise.json"
    simulate_unit(0, STEP * 2, flicker=np.full(3, FLICKER)).noise.save(noise, overwrite=True)
    study.values.update(seeds, at_rest=AT_REST, in_motion=IN_MOTION)
    study.step()
    drift_part(study, seeds["part"], noise, soak_seconds)
    study.step()
    rest_part(study, noise)
    statistics_part(study, seeds, long_seconds)
    recorded_part(study, noise)
    turntable_part(study, seeds["table"], gains)
