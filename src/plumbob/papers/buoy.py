"""The buoy paper [Yu2018]: attitude of a drifting buoy by a PI filter with a gate, calibrated by an ellipsoid.

The paper's method takes one reading in each of 18 regions, six parameters (13), the mean of the rates at rest, and its
filter; ours are the calibrations of all three sensors and of the mounting, and the filter `mekf`. Units are drawn
within the data sheets of MPU-6000 and HMC5983, with soft iron across the axes besides; one of them goes through the
bytes of the rig ``buoy``, the buoy's own program through those of ``buoy_attitude``.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any, Final

import numpy as np

import plumbob as pb
from plumbob.papers.studies import ANGLES, PlotCurve, Scene, Study, errors_deg, largest, rms

PARTS: Final = "mpu6000+hmc5983"
CROSS: Final = 0.05
"""Largest entry of the soft iron across the axes: assumed, for no sheet can state what a buoy is built of."""
REST, MOVE = 3.0, 2.0  # time in each of the 18 poses of the capture and of each move between them, s
REFERENCE: Final = np.array([0.8, 0.2, 0.2])
"""Largest errors of the compass DCM260B in yaw, pitch and roll [Yu2018] §4.2, °."""
CLAIM: Final = 5.0  # largest error of an angle that the paper claims, °
KP: Final = 0.5
G0: Final = float(pb.units.g(1.0))
STROKES: Final = ((2.0, 0.4), (3.0, 0.8), (2.0, 0.8), (1.0, 0.6))
"""Highest speed of a stroke, m/s, and its duration, s: assumed; the paper gives none."""
LONGER: Final = (0.4, 0.6, 0.8, 1.0, 1.3, 1.6)  # strokes to 3 m/s among which the largest error is looked for, s
KPS: Final = (0.1, 0.25, 0.5, 0.75, 1.0, 1.25, 1.5)
SETTLE: Final = 60.0  # time at sea that is left out, s
METHODS: Final[Mapping[str, tuple[str, str, Mapping[str, Any]]]] = {
    "compass": ("ours", "tilt_compass", {}),
    "open": ("paper", "mahony", {"gate": "off"}),
    "gated": ("paper", "mahony", {}),
    "narrow": ("paper", "mahony", {"gate": 0.08}),
    "card": ("ours", "mahony", {}),
    "weak": ("ours", "mahony", {"kp": 0.05, "ki": 0.001, "gate": "off", "quick_start": True}),
    "vqf": ("ours", "vqf", {}),
    "mekf": ("ours", "mekf", {}),
    "smoother": ("ours", "smoother", {}),
}
"""By name: whose calibration, the filter, and its parameters; the filter `mahony` has the paper's by default."""
SLID: Final = ("open", "gated", "narrow", "card", "vqf", "mekf")
DEGENERATE: Final[Mapping[str, tuple[str, str, dict[str, Any]]]] = {
    "ring": ("level-ring", "levelring", {}),
    "unit": ("cone", "cone", {}),
    "table": ("cone", "cone", {"table": "on"}),
}
"""Captures that calibrate nothing: why, and the scenario; a level ring, and cones of a tilted unit or table."""
SESSION: Final = '\n[imu]\ndevice = "mpu6000+hmc5983 #{seed}"\nframe = "NED"\n'
LIVE: Final = '[calibration]\ncard = "card.json"\n[estimate]\nfilter = "mekf"\n[output]\nevery = "50 ms"\n'
Correct = Callable[[Any], Any]  # gives samples as a calibration corrects them


def draw_unit(seed: int, cross: float = CROSS) -> Any:
    """Unit drawn within the data sheets, whose soft iron has symmetric entries up to `cross` across the axes."""
    unit: Any = pb.simulation.draw_module(PARTS, seed)
    across = np.zeros((3, 3))
    across[np.triu_indices(3, 1)] = np.random.default_rng([seed, 2018]).uniform(-cross, cross, 3)
    return replace(unit, mag=replace(unit.mag, soft_iron=unit.mag.soft_iron + across + across.T))


def simulate_unit(scenario: str, unit: Any, seed: int, rate: float = 100.0, **how: Any) -> Any:
    """What a unit measures in a scenario, and its true attitude."""
    return pb.simulate(scenario, frame="NED", sensors=unit, unit="random", seed=seed, rate=rate, **how)


def capture_poses(unit: Any, seed: int, rate: float = 100.0) -> Any:
    """The unit at rest on six faces and twelve edges, by hand."""
    return simulate_unit("faces", unit, seed, rate, edges="on", wobble="5 deg", dwell=REST, move=MOVE)


def ellipsoid(vectors: Any) -> tuple[Any, Any] | None:
    """Matrix (3, 3) that brings vectors (N, 3) to the unit ball, and its centre (3,); None where they fit no ellipsoid.

    [Yu2018] (8) to (14), with the first row of (14) divided by R as the others are.
    """
    x, y, z = vectors.T
    rows = np.column_stack((-y * y, -z * z, 2.0 * x, 2.0 * y, 2.0 * z, np.ones_like(x)))  # [Yu2018] (12)
    w = np.linalg.lstsq(rows, x * x, rcond=None)[0]  # [Yu2018] (13)
    stretch = np.array([1.0, w[0], w[1]])  # [Yu2018] (11): 1, E² and F²
    if not (stretch > 0.0).all():
        return None
    centre = w[2:5] / stretch
    square = float(w[5] + stretch @ centre**2)
    return (np.diag(np.sqrt(stretch / square)), centre) if square > 0.0 else None  # [Yu2018] (14)


def readings(capture: Any, name: str, first: float = 0.5 * REST, every: float = REST + MOVE, count: int = 18) -> Any:
    """One reading (count, 3) of a triad in each region."""
    values = capture.usable(name)
    there = np.flatnonzero(np.isfinite(values).all(axis=1))
    times = capture.t[0] + first + every * np.arange(count)
    return values[there[np.searchsorted(capture.t[there], times)]]


def paper_way(capture: Any, acc: Any, mag: Any, *, force: bool = True) -> Correct | None:
    """The paper's calibration by readings (N, 3), and by the mean of the rates in the first pose."""
    gravity, field = ellipsoid(acc), ellipsoid(mag)
    if gravity is None or field is None:
        return None
    (turn, middle), (shape, centre) = gravity, field
    zero = np.nanmean(capture.gyr[capture.t < capture.t[0] + REST - 0.5], axis=0)

    def correct(imu: Any) -> Any:
        triads = {"gyr": imu.gyr - zero, "mag": (imu.mag - centre) @ shape.T}
        triads["acc"] = G0 * (imu.acc - middle) @ turn.T if force else imu.acc
        return imu.corrected(meta=imu.meta, **triads)

    return correct


def make_card(capture: Any, raised: Any, kinds: Iterable[str] = ("accel", "gyro", "mag")) -> Any:
    """Card of a capture, and of the mounting by two poses."""
    card: Any = None
    for kind in kinds:
        card = pb.calibrate(capture, kind, calibration=card).card
    return pb.calibrate(raised, "mount", calibration=card, frame="NED").card


def calibrations(capture: Any, raised: Any) -> tuple[dict[str, Any], Any]:
    """Calibrations of a unit, the paper's and ours, and our card."""
    card = make_card(capture, raised)
    ways = {"paper": paper_way(capture, readings(capture, "acc"), readings(capture, "mag"))}
    return {**ways, "ours": lambda imu: pb.apply_card(card, imu)}, card


def drawn_calibrations(unit: Any, seed: int) -> dict[str, Any]:
    """Calibrations of a drawn unit."""
    return calibrations(capture_poses(unit, seed, 25.0).imu, simulate_unit("raise", unit, seed).imu)[0]


def estimates(imu: Any, ways: Mapping[str, Any], names: Iterable[str]) -> dict[str, Any]:
    """Attitudes by methods."""
    given = {way: correct(imu) for way, correct in ways.items()}
    of = {name: METHODS[name] for name in names}
    return {
        name: pb.estimate(given[way], how, params=params, frame="NED").track for name, (way, how, params) in of.items()
    }


def static_errors(imu: Any, truth: Any, wrong: Any) -> Any:
    """Errors (36, 3) of tilt and compass, °, at the rests of the table, whose reference is `wrong` by (36, 3)."""
    t = np.asarray(imu.t) - imu.t[0]
    rests = [(t > 4.0 * k + 0.3) & (t < 4.0 * k + 2.7) for k in range(36)]
    acc, mag = (np.stack([np.nanmean(imu.usable(name)[rest], axis=0) for rest in rests]) for name in ("acc", "mag"))
    looks: Any = pb.ImuData(t=4.0 * np.arange(36.0), acc=acc, mag=mag)
    shown = pb.Filter("tilt_compass", frame="NED").process(looks).q_nb
    e = errors_deg(shown, np.stack([truth.q_nb[np.flatnonzero(rest)[0]] for rest in rests])) - wrong
    return (e + 180.0) % 360.0 - 180.0


def reference_error(seed: int) -> Any:
    """Errors (36, 3) of a DCM260B, °."""
    return REFERENCE * np.random.default_rng([seed, 260]).uniform(-1.0, 1.0, (36, 3))


def table_errors(seeds: Sequence[int], cross: float) -> Any:
    """Largest of 36 errors, °, (seeds, 4, 3): as measured, by the paper, its magnetometer alone, and ours."""
    return np.array([unit_errors(draw_unit(seed, cross), seed) for seed in seeds])


def unit_errors(unit: Any, seed: int, again: int = 3) -> Any:
    """Those of one unit (4, 3); of 200 captures one is refused, as a pose moved, and is done `again` by hand."""
    capture, raised = capture_poses(unit, seed, 10.0).imu, simulate_unit("raise", unit, seed, 25.0).imu
    try:
        card = make_card(capture, raised, ("accel", "mag"))
    except pb.errors.CalibrationError:
        if not again:
            raise
        return unit_errors(unit, seed + 10**6, again - 1)
    table = simulate_unit("table36", unit, seed, 25.0)
    acc, mag, wrong = readings(capture, "acc"), readings(capture, "mag"), reference_error(seed)
    both, alone = (paper_way(capture, acc, mag, force=force) for force in (True, False))
    assert both is not None and alone is not None  # six faces and twelve edges
    looks = (table.imu, both(table.imu), alone(table.imu), pb.apply_card(card, table.imu))
    return [largest(static_errors(imu, table.truth, wrong)) for imu in looks]


def refusal_shares(study: Study, name: str, count: int) -> tuple[float, float]:
    """Of a capture that calibrates nothing, %: how often the paper's fit keeps 5° with it, and we refuse it rightly."""
    why, scenario, how = DEGENERATE[name]
    rightly = within = 0
    for seed in study.seeds(count):
        unit = draw_unit(seed)
        table = simulate_unit("table36", unit, seed, 25.0)
        capture = simulate_unit(scenario, unit, seed, 10.0, **how).imu
        try:
            pb.calibrate(capture, "mag")
        except pb.errors.CalibrationError as error:
            rightly += why in [reason.kind for reason in getattr(error, "reasons", ())]
        every = (capture.t[-1] - capture.t[0]) / 36.0
        correct = paper_way(capture, *(readings(capture, triad, 0.0, every) for triad in ("acc", "mag")))
        if correct is not None:
            errors = static_errors(correct(table.imu), table.truth, reference_error(seed))
            within += bool(largest(errors).max() <= CLAIM)
    return 100.0 * within / count, 100.0 * rightly / count


def through_bytes(study: Study, name: str, made: Any, **how: Any) -> Any:
    """Files of a unit's samples that went through the frames of the rig."""
    return study.sent("buoy", name, made, session=SESSION.format(seed=study.seed) + how.pop("more", ""), **how)


def unit_part(study: Study) -> tuple[Any, dict[str, Any]]:
    """Capture and calibration of one unit through bytes, Figures 5 and 7."""
    study.step()
    seed, unit = study.seed, draw_unit(study.seed)
    capture = pb.read(through_bytes(study, "capture", capture_poses(unit, seed)).recording).imu
    raised = pb.read(through_bytes(study, "raised", simulate_unit("raise", unit, seed)).recording).imu
    ways, card = calibrations(capture, raised)
    card.save(study.folder / "card.json", overwrite=True)
    readings_, table = readings(capture, "mag"), simulate_unit("table36", unit, seed)
    shape, centre = ellipsoid(readings_) or (np.eye(3), np.zeros(3))
    after, semi = (readings_ - centre) @ shape.T, 1.0 / np.diag(shape)
    turn = np.linspace(0.0, 2.0 * np.pi, 181)
    panels = []
    for points, at, size, colour in ((readings_, centre, semi, "red"), (after, np.zeros(3), np.ones(3), "blue")):
        for i, j in ((0, 1), (0, 2), (1, 2)):
            around = PlotCurve(at[i] + size[i] * np.cos(turn), at[j] + size[j] * np.sin(turn), colour)
            dots = PlotCurve(points[:, i], points[:, j], colour, "none", mark="o")
            panels.append([around, dots, PlotCurve(at[i : i + 1], at[j : j + 1], "ink", "none", mark="+")])
    study.draw("figure_5", *panels)
    sizes = [100.0 * np.std(size) / np.mean(size) for size in (np.linalg.norm(of, axis=1) for of in (readings_, after))]
    study.values.update(spread=sizes[0], spread_after=sizes[1])
    imu = pb.read(through_bytes(study, "table", table).recording).imu
    wrong = reference_error(seed)
    looks = {"before": imu, **{way: correct(imu) for way, correct in ways.items()}}
    errors = {way: static_errors(of, table.truth, wrong) for way, of in looks.items()}
    study.rows({
        **{f"unit.before.{name}": largest(errors["before"])[i] for i, name in enumerate(ANGLES)},
        **{f"unit.{name}": tuple(largest(errors[way])[i] for way in ways) for i, name in enumerate(ANGLES)},
    })  # fmt: skip
    colours = {"before": "red", "paper": "blue", "ours": "green"}
    heading = 10.0 * np.arange(36.0)
    panels = [[PlotCurve(heading, of[:, i], colours[way], mark="o") for way, of in errors.items()] for i in range(3)]
    study.draw("figure_7", *panels)
    return unit, ways


def modules_part(study: Study, count: int, captures: int) -> Any:
    """The static test of many units, what soft iron across the axes does, and captures that calibrate nothing."""
    study.step()
    crosses = {"0": (0.0, count // 4), "0.05": (CROSS, count), "0.1": (0.1, count // 4)}
    by = {name: table_errors(study.seeds(max(few, 1)), cross) for name, (cross, few) in crosses.items()}
    errors = by["0.05"]
    high = {name: np.quantile(of, 0.95, axis=0, method="higher") for name, of in by.items()}
    share = 100.0 * np.mean(errors.max(axis=2) <= CLAIM, axis=0)
    middle = np.median(errors, axis=0)
    study.rows({
        **{f"static.before.{name}": middle[0, i] for i, name in enumerate(ANGLES)},
        **{f"static.{name}": (high["0.05"][1, i], high["0.05"][3, i]) for i, name in enumerate(ANGLES)},
        "static.share": (share[1], share[3]),
        "static.alone": high["0.05"][2, 0],
        **{f"static.iron.{name}": (high[name][1, 0], high[name][3, 0]) for name in ("0", "0.1")},
    }, units=count, few=count // 4)  # fmt: skip
    for name, of in by.items():
        cells = {
            way: [*np.median(of, axis=0)[k], *high[name][k], 100.0 * np.mean(of[:, k].max(axis=1) <= CLAIM)]
            for k, way in enumerate(("before", "paper", "alone", "ours"))
        }
        study.table(f"static_{name}", cells, units=len(of))
    study.step()
    study.rows({f"refused.{name}": refusal_shares(study, name, captures) for name in DEGENERATE}, captures=captures)
    return errors


def slide_part(study: Study, unit: Any, ways: Mapping[str, Any], count: int) -> tuple[float, float]:
    """Slides on a level desk, Figure 8, of one unit through bytes and of many; the largest errors of paper and ours."""
    study.step()
    seed, (speed, stroke) = study.seed, STROKES[0]
    made = simulate_unit("slide", unit, seed, peak_speed=speed, stroke=stroke)
    imu: Any = pb.read(through_bytes(study, "slide", made).recording).imu
    errors = {name: errors_deg(of, made.truth) for name, of in estimates(imu, ways, SLID).items()}
    zero: Any = imu.corrected(meta=imu.meta, acc=ways["paper"](imu).acc, mag=ways["paper"](imu).mag)
    biased = errors_deg(pb.estimate(zero, "mahony", frame="NED").track, made.truth)
    panels = []
    for column, printed in ((2, (9.6, 3.3)), (1, (6.1, 2.7))):
        by = (("open", "red"), ("gated", "blue"), ("mekf", "green"))
        lines = [PlotCurve(imu.t, errors[name][:, column], colour) for name, colour in by]
        ends = [[at, at] for limit in printed for at in (-limit, limit)]
        panels.append([*lines, *(PlotCurve([imu.t[0], imu.t[-1]], end, "muted", "dotted") for end in ends)])
    study.draw("figure_8", *panels)
    study.rows({
        "boot.bias": largest(pb.units.to_dps(ways["paper"](imu).gyr[:1] - imu.gyr[:1])).max(),
        "boot.kept": largest(biased)[1:].max(),
        "boot.first": tuple(np.abs(errors[name][0, 1:]).max() for name in ("gated", "mekf")),
        **{f"slide.unit.{name}": tuple(largest(errors[way])[i] for way in ("gated", "mekf"))
           for i, name in ((2, "roll"), (1, "pitch"))},
    })  # fmt: skip
    study.step()
    slid: dict[tuple[float, float], dict[str, Any]] = {pair: {name: [] for name in SLID} for pair in STROKES}
    for number in study.seeds(count):
        drawn = draw_unit(number)
        cards = drawn_calibrations(drawn, number)
        for pair, by_name in slid.items():
            made = simulate_unit("slide", drawn, number, peak_speed=pair[0], stroke=pair[1])
            for name, of in estimates(made.imu, cards, SLID).items():
                by_name[name].append(largest(errors_deg(of, made.truth))[[2, 1]])
    most = {pair: {name: np.array(of) for name, of in by_name.items()} for pair, by_name in slid.items()}
    first = most[STROKES[0]]
    taken = 100.0 * (1.0 - first["gated"] / first["open"])
    still: Any = pb.simulation.draw_module(PARTS, study.seed).calibrated()
    scan = {pair: [strongest(still, study.seed, pair, kp) for kp in KPS] for pair in ((3.0, 0.8), (1.5, 0.6))}
    study.rows({
        **{f"slide.open.{name}": np.median(first["open"][:, i]) for i, name in enumerate(("roll", "pitch"))},
        **{f"slide.gated.{name}": (first["gated"][:, i].max(), first["mekf"][:, i].max())
           for i, name in enumerate(("roll", "pitch"))},
        **{f"slide.reduction.{name}": np.median(taken[:, i]) for i, name in enumerate(("roll", "pitch"))},
        **{"slide.new.{:g}-{:g}".format(*pair): (of["gated"].max(), of["mekf"].max()) for pair, of in most.items()},
        "slide.bound": max(strongest(still, study.seed, (3.0, each), KP)[0] for each in LONGER),
        "slide.gain": float(np.interp(9.6, [roll for roll, _ in scan[3.0, 0.8]], KPS, right=np.nan)),
    }, units=count, bound=float(pb.units.to_deg(KP * 3.0 / G0)))  # fmt: skip
    for key, of in (("median", np.median), ("worst", np.max)):
        cells = {name: [" / ".join(f"{v:.2f}" for v in of(by[name], axis=0)) for by in most.values()] for name in SLID}
        study.table(f"slide_{key}", cells, units=count)
    rolls = [[roll for roll, _ in of] for of in scan.values()]
    study.draw("gains", [PlotCurve(KPS, *of, mark="o") for of in zip(rolls, ("red", "blue"), strict=True)])
    return max(by["gated"].max() for by in most.values()), max(by["mekf"].max() for by in most.values())


def strongest(unit: Any, seed: int, pair: tuple[float, float], kp: float) -> tuple[float, float]:
    """Largest roll and pitch, °, of the PI law without a gate on a slide, of a unit whose only error is noise."""
    made = simulate_unit("slide", unit, seed, peak_speed=pair[0], stroke=pair[1])
    track: Any = pb.estimate(made.imu, "mahony", params={"kp": kp, "gate": "off"}, frame="NED").track
    return tuple(largest(errors_deg(track, made.truth))[[2, 1]])


def device_part(study: Study) -> None:
    """The buoy's own program on a slide: its line at 20 Hz, its events, and its log in Flash; the energy of its parts.

    The rig draws the unit, without soft iron across the axes; its card is by six parameters, as the paper's.
    """
    study.step()
    poses: dict[str, Any] = {"edges": "on", "wobble": "5 deg", "dwell": REST, "move": MOVE}
    faces: dict[str, Any] = {"scenario": "faces", "set": poses, "duration": "88 s"}
    taken = study.recorded("buoy", "device-capture", session=SESSION.format(seed=study.seed), **faces)
    capture: Any = pb.read(taken.recording).imu
    card: Any = None
    ways: tuple[tuple[str, Any], ...] = (("accel", {"shape": "axes"}), ("gyro", {}), ("mag", {"shape": "axes"}))
    for kind, options in ways:
        card = pb.calibrate(capture, kind, calibration=card, **options).card
    image = study.folder / "flash.bin"
    slide = {"peak_speed": STROKES[0][0], "stroke": STROKES[0][1]}
    study.rows({"live.same": study.live(study.recorded("buoy", "line", unit="random", duration=60.0))})
    taken = study.recorded("buoy_attitude", "device", scenario="slide", set=slide, calibration=card, flash_log=image)
    data = taken.capture.read_bytes()
    truth: Any = pb.read(taken.truth).track
    said = pb.decode(data, "buoy_attitude").frames["buoy_attitude"].columns
    clock = 1e-6 * (said["clock"].astype(float) - said["clock"][0])
    q = pb.rotations.quat_from_euler_zyx(np.stack([said[name] for name in ("heading", "pitch", "roll")], axis=1))
    rows = np.searchsorted(truth.t, 1e-6 * said["clock"].astype(float) - 1e-6)
    most = largest(errors_deg(q, truth.q_nb[rows]))
    stored = image.read_bytes()[: len(data) // 256 * 256]  # whole pages
    parts, log = study.description.content["energy"], study.description.content["log"]
    tasks = study.description.content["task"]
    busy = sum(task["takes_ms"] / task["every_ms"] for task in tasks.values())
    duty = {"always": 1.0, "busy": busy, "idle": 1.0 - busy, "write": log["page_ms"] * 1e-3 * log["rate"] / 8.0}
    draw = {name: part["ma"] * duty[part["duty"]] for name, part in parts.items()}
    minutes = log["bytes"] / log["record"] / log["rate"] / 60.0
    burst = log["burst_s"] / log["burst_every_s"]
    study.rows({
        "line.rate": float((clock.size - 1) / clock[-1]),
        "events.missed": float(said["missed"].max()),
        "log.same": 100.0
        * np.mean(np.frombuffer(stored, np.uint8) == np.frombuffer(data[: len(stored)], np.uint8)),
        "device.roll": most[2],
        "device.pitch": most[1],
        "events.idle": 100.0 * (1.0 - busy),
        "log.minutes": minutes,
        "log.bytes": log["record"] * log["rate"] * 86400.0 * 1e-6,
        "log.years": minutes * log["erases"] / (60.0 * 24.0 * 365.25),
        "energy.current": sum(draw.values()),
        "energy.days": log["battery_mah"] / sum(draw.values()) / 24.0,
        "energy.burst": log["battery_mah"] / (sum(draw.values()) * burst + log["asleep_ma"]) / 24.0 / 30.44,
        "log.burst": minutes / burst / 60.0 / 24.0,
    })  # fmt: skip
    cells = [[study.text(name), part["ma"], 100.0 * duty[part["duty"]], draw[name], part["source"]]
             for name, part in parts.items()]  # fmt: skip
    study.table("energy", cells)
    bars = []
    for row, task in enumerate(tasks.values()):
        begins = np.arange(task["every_ms"], 160.0, task["every_ms"])
        x = np.ravel(np.stack((begins, begins + task["takes_ms"], np.full(begins.size, np.nan)), axis=1))
        bars.append(PlotCurve(x, np.full(x.size, 2.0 - row), ("blue", "green", "red")[row], width=8.0))
    study.draw("figure_4", bars)


def sea_part(study: Study, unit: Any, ways: Mapping[str, Any], seas: int, duration: float) -> tuple[float, float]:
    """At sea: one unit live through bytes, Figure 6, and several; the largest errors of the paper's method and ours."""
    study.step()
    made, text = simulate_unit("buoy", unit, study.seed, duration=duration), study.folder / "sea.txt"
    text.unlink(missing_ok=True)
    taken = through_bytes(study, "sea", made, more=LIVE, text=text)
    again: Any = pb.replay(taken.recording, check=True, keep="track")
    lines = sum(not line.startswith("#") for line in text.read_text(encoding="utf-8").splitlines())
    imu: Any = pb.read(taken.recording).imu
    errors = {name: errors_deg(of, made.truth) for name, of in estimates(imu, ways, METHODS).items()}
    settled = made.imu.t >= SETTLE
    live_rms = {name: rms(of[settled], 0)[::-1] for name, of in errors.items()}
    study.step()
    rows: dict[str, list[Any]] = {name: [] for name in METHODS}
    worst = [largest(errors[name][settled]).max() for name in ("gated", "mekf")]
    for number in study.seeds(seas):
        drawn = draw_unit(number)
        sailed = simulate_unit("buoy", drawn, number, duration=duration)
        for name, of in estimates(sailed.imu, drawn_calibrations(drawn, number), METHODS).items():
            e = errors_deg(of, sailed.truth)[settled]
            rows[name].append(rms(e, 0)[::-1])
            if name in ("gated", "mekf"):
                worst[name == "mekf"] = max(worst[name == "mekf"], largest(e).max())
    median = {name: np.median(of, axis=0) for name, of in rows.items()}
    study.rows({
        **{f"sea.{name}": (median["gated"][i], median["mekf"][i]) for i, name in enumerate(ANGLES[::-1])},
        **{f"sea.unit.{name}": (live_rms["gated"][i], live_rms["mekf"][i]) for i, name in enumerate(ANGLES[::-1])},
        "sea.output": (None, float(lines / imu.t[-1])),
    }, seas=seas)  # fmt: skip
    study.table("sea", {name: [*median[name], *live_rms[name]] for name in METHODS}, seas=seas)
    last, shown = imu.t >= imu.t[-1] - 60.0, (("compass", "soft"), ("gated", "blue"), ("mekf", "green"))
    roll = pb.units.to_deg(pb.rotations.euler_zyx_from_quat(made.truth.q_nb)[:, 2])
    below = [PlotCurve(imu.t[last], errors[name][last, 2], colour) for name, colour in (*shown, ("smoother", "amber"))]
    study.draw("roll_in_waves", [PlotCurve(imu.t[last], roll[last], "ink")], below)
    few = np.flatnonzero(again.track.t >= again.track.t[-1] - 30.0)[::5]
    ends = {"x": (1, 0, 0), "y": (0, 1, 0), "−x": (-1, 0, 0), "−y": (0, -1, 0), "z": (0, 0, 0.9), "o": (0, 0, 0)}
    edges = [("x", "y"), ("y", "−x"), ("−x", "−y"), ("−y", "x"), ("o", "x"), ("o", "y"), ("o", "z")]
    points, shadow = (
        {k: pb.rotations.quat_rotate(of.q_nb[few], np.array(v, float)) * [1.0, -1.0, -1.0] for k, v in ends.items()}
        for of in (again.track, made.truth)
    )
    angles = pb.units.to_deg(pb.rotations.euler_zyx_from_quat(again.track.q_nb[few])).T
    t = again.track.t[few] - again.track.t[few[0]]
    values: Any = dict(zip(("φ", "θ", "γ"), angles, strict=True))
    study.scene("sea", Scene(study.text("figure_6"), t, points, edges, values=values, shadow=shadow))
    return worst[0], worst[1]


def measure(
    study: Study, *, units: int = 200, slides: int = 20, seas: int = 3, captures: int = 20, duration: float = 600.0
) -> None:
    """Measure every figure of the paper."""
    study.values.update(units=units, slides=slides, seas=seas)
    unit, ways = unit_part(study)
    static = modules_part(study, units, captures)
    slid = slide_part(study, unit, ways, slides)
    device_part(study)
    sailed = sea_part(study, unit, ways, seas, duration)
    still = static[:, 1].max(), static[:, 3].max()
    study.rows({"claim": tuple(max(of) for of in zip(still, slid, sailed, strict=True))}, units=units)
