"""Wrong inputs as users bring them: is each refused or flagged with its cause, or does it pass without a word?

A motion, simulated or real, is given one fault, written in the form of some reader, and run as a user would: `run`,
`info` and `doctor`, or `eval` where the reference is at fault. Right: inclination within 2°, and with a magnetometer
heading within 5°, of what the right input gives. Refused, flagged: a message, note, finding or reason of the grade that
the right input has not names the quantity at fault. Misleading: only other quantities are named, or `doctor` calls
another one wrong. Silent: wrong, and no word. Whether the file alone shows a fault is computed apart: sizes against
gravity and the Earth's field, stamps and repeats, and whether gravity and field, turned back by the rates less the
constant bias that suits best, stand as still as they do in the right input.
"""

import argparse
import os
import re
import tempfile
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
from scipy.optimize import least_squares

import plumbob as pb
from benchmarks import formats
from plumbob.core.constants import G0
from plumbob.quality.arrangement import BIN, inflation, widening
from plumbob.quality.derotated import rotations
from plumbob.rotations import dcm_from_quat, quat_conjugate, quat_multiply
from tests.helpers import file_kinds as kinds
from tests.helpers.file_kinds import DATA, Motion

MOTIONS: dict[str, tuple[str, dict[str, Any]]] = {
    "tumble": ("brisk", {}), "fin": ("brisk", {"frequency": "0.9 Hz", "swing": "30 deg"}), "buoy": ("brisk", {}),
    "rod": ("brisk", {}), "coning": ("brisk", {}), "arm": ("slow", {}), "sway": ("slow", {}), "cone": ("slow", {}),
    "turntable": ("slow", {"spin_up": 10.0, "hold": 30.0}), "static": ("none", {"roll": "10 deg", "heading": "60 deg"}),
}  # fmt: skip
REAL = {
    "broad/03_undisturbed_slow_rotation_C.hdf5": "brisk", "broad/07_undisturbed_fast_rotation_B.hdf5": "brisk",
    "broad/11_undisturbed_slow_translation_B.hdf5": "slow", "broad/21_undisturbed_fast_combined.mat": "brisk",
    "foreign/phones/Guillaume_iPhone5_NoDist_Texting.parquet": "slow",
    "foreign/phones/Guillaume_Nexus5_NoDist_Swinging.parquet": "brisk",
    "foreign/robot_arm/openaxes_triangle-150_radius.parquet": "slow",
}  # fmt: skip
SENSORS = {"gyr": r"gyr", "acc": r"\bacc|gravity|upside down", "mag": r"\bmag|field"}
TIME = r"\btime:|time\.unit|stamps?\b|clock|\bgaps?\b|sampling rate|jitter|the usual step"
PLACES = {"wrong": {"place": "-34.0,151.0", "date": "2025-06-01"}, "field": {"strength": 49.9, "dip": "67.6 deg"}}
"""A place in the south, and the field of the motions: that of 52° north."""
UNITS = {"gyr": "deg/s", "acc": "m/s^2", "mag": "uT"}
SHOWS = 25.0
"""Sum of squares, in variances, by which a file shows that it is wrong: five standard deviations."""
ZERO_RATE = float(np.radians(20.0))
"""Bias of the rates of a unit without a card, rad/s (MPU-6000: ±20 °/s, PS-MPU-6000A, 6.1)."""
Columns = Callable[[np.ndarray], np.ndarray]


def _tables(folder: Path, m: Motion, *files: tuple[str, ...]) -> list[Path]:
    """Tables whose heads say the units, of some sensors each, and a drafted profile of all."""
    paths = []
    for names in files:
        there = [name for name in names if getattr(m, name) is not None]
        heads = ["time (s)", *(f"{name}_{axis} ({UNITS[name]})" for name in there for axis in "xyz")]
        values = [np.degrees(m.gyr) if name == "gyr" else getattr(m, name) for name in there]
        if there:
            paths.append(folder / f"{names[0]}.csv")
            table = np.column_stack([m.t_ns / 1e9, *values])
            np.savetxt(paths[-1], table, delimiter=",", header=",".join(heads), comments="", fmt="%.9g")
    answers = {"frame": "ENU", "acc.sign": "specific-force", "axes": "x y z"}
    pb.profile(paths, accept=True, answers=answers, out=folder / "all.toml")
    return [*paths, folder / "all.toml"]


def _native(folder: Path, m: Motion) -> Path:
    triads = {name: getattr(m, name) for name in SENSORS if getattr(m, name) is not None}
    meta = pb.ImuMeta(device="unit", frame="ENU")
    return pb.write(folder / "a.parquet", pb.ImuData(t=m.t_ns / 1e9, **triads, meta=meta))


def _known(kind: formats.Kind) -> Callable[[Path, Motion], Path]:
    def write(folder: Path, m: Motion) -> Path:
        with patch.object(kinds, "real_motion", lambda: m if m.mag is not None else m._replace(mag=m.gyr)):
            return kind.make(folder)

    return write


FORMS: dict[str, tuple[Callable[[Path, Motion], Any], str]] = {
    "native Parquet": (_native, "ENU"),
    "CSV with units": (lambda folder, m: _tables(folder, m, tuple(SENSORS)), "ENU"),
    "a file per sensor": (lambda folder, m: _tables(folder, m, *((name,) for name in SENSORS)), "ENU"),
}
"""What writes each form, and its frame."""
FIXED = ("native Parquet", "real", "own", "phyphox", "Sensor Logger", "KITTI", "OpenSim")
"""Kinds of `benchmarks.formats` that are files of their own, have stamps of their own, or hold attitudes alone."""
WITHOUT_MAG = (*FORMS, "EuRoC", "TUM VI")
OTHERS = [kind for kind in formats.MADE if kind.source not in FIXED and not kind.name.startswith(FIXED)]
FORMS |= {kind.name: (_known(kind), kind.frame) for kind in OTHERS}
TEXTS = (*WITHOUT_MAG[1:3], "CSV with a profile", "Xsens, text", "DataFlash, text", "RepoIMU")


@dataclass(frozen=True)
class Fault:
    """The words that name what is wrong, and what it is: motion, file, options of `run`, or the truth of `eval`."""

    words: str
    edit: Callable[[Motion], Motion] = lambda m: m
    damage: Callable[[Path], object] | None = None
    run: dict[str, Any] = field(default_factory=dict)
    truth: Columns | None = None
    mag: bool = False


def _of(change: Columns, *names: str, words: str = "") -> Fault:
    """The same change of some triads."""

    def edit(m: Motion) -> Motion:
        return m._replace(**{n: change(getattr(m, n).copy()) for n in names if getattr(m, n) is not None})

    return Fault(words or SENSORS.get(names[0], TIME), edit, mag=names == ("mag",))


def _put(value: Callable[[np.ndarray], Any], rows: slice, axes: Any) -> Columns:
    def change(v: np.ndarray) -> np.ndarray:
        v[rows, axes] = value(v)
        return v

    return change


def _time(change: Columns, words: str = TIME) -> Fault:
    return _of(lambda t: change(t).astype(np.int64), "t_ns", words=words)


def _swap(one: str, other: str) -> Fault:
    edit = lambda m: m._replace(**{one: getattr(m, other), other: getattr(m, one)})  # noqa: E731
    return Fault(f"{SENSORS[one]}|{SENSORS[other]}", edit, mag="mag" in (one, other))


def _back(t: np.ndarray) -> np.ndarray:
    for first in range(500, len(t) - 5, 1000):
        t[first : first + 3] = t[first : first + 3][::-1]
    return t


def _line(path: Path) -> None:
    raw = path.read_bytes()
    middle = raw.index(b"\n", len(raw) // 2) + 1
    path.write_bytes(raw[:middle] + b"1.23,garb\x07age\n" + raw[middle:])


def _faults() -> dict[str, Fault]:
    half, deg = slice(2000, None), np.pi / 180.0
    factors = {"gyr deg/s called rad/s": 1.0 / deg, "gyr rad/s called deg/s": deg}
    factors |= {"acc g called m/s²": 1.0 / G0, "mag gauss called µT": 0.01, "mag mgauss called µT": 10.0}
    factors |= {f"{name} × {factor:g}": factor for name in SENSORS for factor in (0.5, 0.9, 1.1, 2.0)}
    made = {f"factors: {name}": _of(lambda v, k=k: v * k, name[:3]) for name, k in factors.items()}
    for n, words in SENSORS.items():
        made[f"axes: {n} x and y swapped"] = _of(lambda v: v[:, [1, 0, 2]], n)
        made[f"axes: {n} y negated"] = _of(lambda v: v * [1.0, -1.0, 1.0], n)
        made[f"axes: {n} all negated"] = _of(np.negative, n)
        made[f"values: {n} z dead"] = _of(_put(lambda v: 0.0, slice(None), 2), n)
        made[f"values: {n} x held"] = _of(_put(lambda v: v[2000, 0], half, 0), n)
        made[f"values: {n} held"] = _of(_put(lambda v: v[2000], half, slice(None)), n)
        made[f"values: {n} NaN in 5 %"] = _of(_put(lambda v: np.nan, slice(3, None, 20), slice(None)), n)
        made[f"values: {n} saturated"] = _of(lambda v: np.clip(v, -0.6 * np.abs(v).max(), 0.6 * np.abs(v).max()), n)
        made[f"time: {n} late by 5 rows"] = _of(lambda v: np.roll(v, 5, axis=0), n, words=words + "|delay")
    every = SENSORS["gyr"] + "|upside down|axes|mirrored"
    made["axes: mag turned by 180°"] = _of(lambda v: v * [-1.0, -1.0, 1.0], "mag")
    made["axes: all left-handed"] = _of(lambda v: v * [1.0, -1.0, 1.0], *SENSORS, words=every)
    made["axes: NED called ENU"] = _of(lambda v: v * [1.0, -1.0, -1.0], *SENSORS, words=every)
    made["values: mag hard iron 40 µT"] = _of(lambda v: v + [40.0, 0.0, 0.0], "mag")
    made |= {"columns: gyr and acc": _swap("gyr", "acc"), "columns: acc and mag": _swap("acc", "mag")}
    up = np.array([0.0, 0.0, G0])
    free = Fault(SENSORS["acc"], lambda m: m._replace(acc=m.acc - np.einsum("nij,i->nj", dcm_from_quat(m.q_nb), up)))
    made["columns: acc without gravity"] = free
    for factor in (2.0, 0.5, 0.98):
        made[f"time: rate off, t × {factor:g}"] = _time(lambda t, k=factor: t * k, TIME + "|gyr unit")
    made["time: row number as ms"] = _time(lambda t: np.arange(len(t)) * 1e6, TIME + "|gyr unit")
    made |= {"time: µs called ms": _time(lambda t: t * 1e3), "time: ms called µs": _time(lambda t: t / 1e3)}
    made["time: stamps repeat"] = _time(lambda t: t[np.arange(len(t)) - (np.arange(len(t)) % 7 == 6)])
    made["time: stamps go back"] = _time(_back)
    for words, seconds in {"a jump of an hour": 3600.0, "midnight wraps": -86400.0}.items():
        made[f"time: {words}"] = _time(lambda t, s=seconds: t + np.where(np.arange(len(t)) > 2000, s * 1e9, 0))
    made["time: bursts of ten"] = _time(lambda t: t - (np.arange(len(t)) % 10) * 0.9 * np.median(np.diff(t)))
    cut = r"\bcut|truncat|half|end|incomplete|damaged"
    made["file: half"] = Fault(cut, damage=lambda path: os.truncate(path, path.stat().st_size // 2))
    made["file: one broken line"] = Fault(r"\bline|row", damage=_line)
    made["place: the other hemisphere"] = Fault(r"\bplace", run=PLACES["wrong"])
    made["place: card of another unit"] = Fault(r"\bcard|calibrat|bias", run={"calibration": ""})
    quats: dict[str, tuple[str, Columns]] = {
        "xyzw called wxyz": ("order", lambda q: q[:, [1, 2, 3, 0]]), "inverse": ("inverse", quat_conjugate),
        "NED called ENU": ("NED", lambda q: quat_multiply([0.0, 0.5**0.5, 0.5**0.5, 0.0], q)),
        "body turned by 90°": ("mounting", lambda q: quat_multiply(q, [0.5**0.5, 0.0, 0.0, 0.5**0.5])),
        "heading off by 30°": ("heading", lambda q: quat_multiply([np.cos(0.26), 0.0, 0.0, np.sin(0.26)], q)),
    }  # fmt: skip
    return made | {f"reference: {name}": Fault(words, truth=change) for name, (words, change) in quats.items()}


FAULTS = _faults()


@cache
def scene(name: str, mag: bool) -> Motion:
    """Some 40 s of a motion, with a magnetometer or without."""
    if name in REAL:
        imu, track = (recording := pb.read(DATA / name)).imu, recording.track
        q = track.q_nb[np.searchsorted(track.t, imu.t).clip(0, len(track) - 1)]
        rows = np.flatnonzero(np.abs(imu.t - imu.t[-1] / 2) < 20.0)
        rows = rows[:: max(1, round(len(rows) / 4000))]
    else:
        more = {"duration": 40.0, "rate": 100.0, "mag_rate": 100.0} | MOTIONS[name][1] | PLACES["field"]
        made = pb.simulate(name, frame="ENU", seed=1, sensors="mpu6050+hmc5983", unit="calibrated", **more)
        imu, q, rows = made.imu, made.truth.q_nb, np.arange(len(made.imu))
    values = {n: whole(imu.t, getattr(imu, n))[rows] for n in imu.triads if n != "mag" or mag}
    t_ns = np.round((imu.t[rows] - imu.t[rows[0]]) * 1e9).astype(np.int64)
    return Motion(t_ns, values["gyr"], values["acc"], values.get("mag"), np.full(len(rows), 25.0), q[rows])


def whole(t: np.ndarray, values: np.ndarray) -> np.ndarray:
    known = np.isfinite(values).all(axis=1)
    return np.stack([np.interp(t, t[known], column[known]) for column in values.T], axis=1)


def called_wrong(what: Any) -> list[str]:
    """What `doctor` calls wrong, a line each, without the sensors that it is compared with."""
    lines = [f"{f.sensor} {f.question} {f.answer}: {f.value}" for f in pb.doctor(what).findings if f.wrong]
    return [re.sub(r"in those of .*", "", line) for line in lines]


def look(path: Any, frame: str, run: dict[str, Any], card: bool = False) -> tuple[Any, list[str], list[str]]:
    """The attitude, and what a user sees: lines of `run` and `info`, and what `doctor` calls wrong."""
    more = {"profile": path[-1]} if isinstance(path, list) else {}
    source = pb.read(path[:-1] if more else path, **more)
    if card:
        run = {"calibration": replace(_card(), device=source.imu.meta.device)}
    made, info = pb.estimate(source, frame=frame, **run), pb.info(source)
    lines = [
        re.sub("; the heading there is the gyroscope's", "", line) for line in map(str, (*made.notes, *source.notes))
    ]
    lines += [f"flag {name}" for name, count in made.outline.flags.items() if count > 0.02 * made.outline.samples]
    lines += [f"{c.name}: {c.measured}" for c in info.grade.criteria if c.lost >= 1.0]
    lines = [line for line in lines if not line.startswith("field at")]
    return made.track, lines, called_wrong(source if more else path)


@cache
def clean(motion: str, form: str, mag: bool) -> tuple[Any, list[str], list[str]]:
    """What is seen of the right input."""
    with tempfile.TemporaryDirectory() as folder:
        return look(FORMS[form][0](Path(folder), scene(motion, mag)), FORMS[form][1], {})


@cache
def _card() -> pb.CalibrationCard:
    """Card of another unit."""
    made = pb.simulate("poses", frame="ENU", seed=3, sensors="mpu6050+hmc5983", unit="random")
    return pb.calibrate(made.imu, "hand").card


def errors(wrong: pb.AttitudeTrack, right: pb.AttitudeTrack) -> np.ndarray:
    """Inclination and heading between two attitudes, root mean square, degrees; rows of the wrong one may be lost."""
    same = len(wrong) == len(right)
    rows = np.arange(len(right)) if same else np.searchsorted(right.t, wrong.t).clip(0, len(right) - 1)
    e = quat_multiply(wrong.q_nb, quat_conjugate(right.q_nb[rows]))[min(200, len(rows) // 4) :]
    w, _, _, z = e[np.isfinite(e).all(axis=1)].T
    angles = 2.0 * np.stack([np.arccos(np.hypot(w, z).clip(0.0, 1.0)), np.arctan2(np.abs(z), np.abs(w))])
    return np.degrees(np.sqrt(np.mean(angles**2, axis=1)))


def hidden(wrong: Motion, right: Motion, late: bool) -> str:
    """Why a file does not show that it is wrong, computed; empty where it does."""
    steps = np.diff(wrong.t_ns)
    if (steps <= 0).any() or steps.max() > 20 * np.median(steps) or not 1e5 < np.median(steps) < 5e8:
        return ""
    for name in (n for n in SENSORS if getattr(right, n) is not None):
        new, old = (getattr(m, name) for m in (wrong, right))
        held = [(v[1:] == v[:-1]).sum(axis=0) for v in (new, old)]
        low, high = {"gyr": (0.0, 10.0), "acc": (0.85 * G0, 1.15 * G0), "mag": (20.0, 70.0)}[name]
        sizes = [np.median(np.linalg.norm(v, axis=1)) for v in (new, old)]
        if np.isnan(new).any() or (held[0] > held[1] + 100).any() or (low < sizes[1] < high) > (low < sizes[0] < high):
            return ""
    more, before = unrest(right, wrong)
    if more > SHOWS and not (late and more < before):
        return ""
    bias = "a bias of the rates, as units without a card have it, makes up for it"
    feigned = "pushes in step with the turning feign delays as long" if late else bias
    return feigned if before else "gravity wanders as much where the right rates turn it back as where none do"


def unrest(usual: Motion, wrong: Motion) -> tuple[float, float]:
    """Sum of squares, in variances, by which gravity and field turn more in space, and that of the right input.

    Each has the bias that suits.

    What the right rates do not bring to rest says nothing of wrong ones: a sensor counts whose vector, turned back by
    them, does not wander more than if it were not turned back at all. Changes from window to window that are alike
    count as the fewer independent ones that they stand for.
    """

    def turned(bias: np.ndarray, of: Motion, v: np.ndarray, size: int) -> tuple[np.ndarray, np.ndarray]:
        """Changes (n, 3) of a vector from window to window, and their slopes by the bias: it turns all that follows."""
        dt = float(np.median(np.diff(of.t_ns))) / 1e9
        dcm = rotations(of.gyr + bias, dt / BIN)
        still = np.einsum("nij,nj->ni", dcm, v)[:, :, None] / np.median(np.linalg.norm(v, axis=1))
        both = np.concatenate((still, np.cross(dt * np.cumsum(dcm, axis=0), still, axis=1)), axis=2)
        rows = np.diff(both[: len(v) // size * size].reshape(-1, size, 3, 4).mean(axis=1), axis=0)
        return rows[:, :, 0], rows[:, :, 1:].reshape(-1, 3)

    def suited(of: Motion, names: list[str], size: int, starts: list[np.ndarray], sd: dict[str, float]) -> float:
        """Least sum of squares of some sensors, by the bias that suits best from some starts."""

        def residuals(b: np.ndarray) -> np.ndarray:
            parts = [turned(b, of, getattr(of, n), size)[0].ravel() / sd[n] for n in names]
            return np.concatenate([*parts, b / ZERO_RATE])

        def slopes(b: np.ndarray) -> np.ndarray:
            return np.concatenate(
                [*(turned(b, of, getattr(of, n), size)[1] / sd[n] for n in names), np.eye(3) / ZERO_RATE]
            )

        fits = [least_squares(residuals, start, slopes, ftol=1e-3) for start in starts]
        return min(float(np.sum(np.minimum(fit.fun**2, 25.0))) for fit in fits)

    most, none = (0.0, 0.0), usual._replace(gyr=np.zeros_like(usual.gyr))
    for size in (25, 100):
        left = {
            n: turned(np.zeros(3), usual, getattr(usual, n), size)[0]
            for n in SENSORS
            if n != "gyr" and getattr(usual, n) is not None
        }
        alone = {n: inflation(of) for n, of in left.items()}
        sd = {
            n: float(np.hypot(0.02, 1.5 * np.median(np.abs(of)))) * alone[n] ** 0.5 * widening(of.size / alone[n], 3)
            for n, of in left.items()
        }
        names = [
            n
            for n in left
            if suited(usual, [n], size, [np.zeros(3)], sd) < suited(none, [n], size, [np.zeros(3)], sd) + SHOWS
        ]
        if names:
            # a steady rate may be a bias: also that which turns it round
            starts = [np.zeros(3), -2.0 * wrong.gyr.mean(axis=0), (usual.gyr - wrong.gyr).mean(axis=0)]
            before = suited(usual, names, size, starts[:1], sd)
            most = max(most, (suited(wrong, names, size, starts, sd) - before, before))
    return most


def judged(fault: Fault, form: str, motion: str, mag: bool) -> tuple[str, str]:
    """The outcome of one wrong input, and what was seen."""
    right, before = scene(motion, mag), clean(motion, form, mag)
    if fault.truth is not None:
        truth = pb.AttitudeTrack(t=right.t_ns / 1e9, q_nb=right.q_nb, frame="ENU", north=before[0].north)
        results = [pb.evaluate(before[0], one) for one in (truth, truth.with_attitude(fault.truth(truth.q_nb)))]
        bad = float(np.degrees(np.subtract(*(one.stats["total"].rmse for one in reversed(results))))) > 2.0
        fresh = [line for line in results[1].notes if line not in results[0].notes]
        return _outcome(fault, bad, fresh, [], str)
    wrong = fault.edit(right)
    try:
        with tempfile.TemporaryDirectory() as folder:
            path = FORMS[form][0](Path(folder), wrong)
            if fault.damage is not None:
                fault.damage(path[0] if isinstance(path, list) else path)
            after = look(path, FORMS[form][1], fault.run, card="calibration" in fault.run)
    except pb.PlumbobError as error:
        return ("refused" if re.search(fault.words, str(error), re.IGNORECASE) else "misleading"), str(error)
    known = {re.sub(r"\d+", "", line) for lines in before[1:] for line in lines}
    fresh, called = ([line for line in lines if re.sub(r"\d+", "", line) not in known] for lines in after[1:])
    lean, turn = errors(after[0], before[0])
    bad = lean > 2.0 or (mag and turn > 5.0)
    why = str if "place" in fault.run else lambda: hidden(wrong, right, "delay" in fault.words)
    outcome, lines = _outcome(fault, bad, fresh, called, why)
    return outcome, f"{lean:.1f}°, {turn:.1f}°: {lines}"


def _outcome(
    fault: Fault, bad: bool, fresh: list[str], called: list[str], why_hidden: Callable[[], str]
) -> tuple[str, str]:
    """Of new lines, and those of `doctor` among them."""
    fresh = [str(line) for line in fresh]
    lines = " | ".join(called + fresh) or "nothing"
    named = [bool(re.search(fault.words, line, re.IGNORECASE)) for line in called + fresh]
    if called and not any(named[: len(called)]):
        return "misleading", lines
    if not bad:
        return "right", lines
    if fresh:
        return "flagged" if any(named) else "misleading", lines
    return ("silent, not shown", f"{lines}: {why}") if (why := why_hidden()) else ("silent", lines)


def draws(count: int, seed: int) -> Iterator[tuple[str, str, str, bool]]:
    """Every fault in turn, each with a motion, a form and perhaps without a magnetometer."""
    rng, real = np.random.default_rng(seed), [name for name in REAL if (DATA / name).exists()]
    for i in range(count):
        name, fault = list(FAULTS.items())[i % len(FAULTS)]
        chosen = fault.truth is not None or bool(fault.run)
        motion = str(rng.choice([*MOTIONS, *(one for one in real if not chosen and not (fault.mag and "arm/" in one))]))
        mag = "arm/" not in motion and (fault.mag or chosen or rng.random() < 0.7)
        some = TEXTS if fault.damage is not None else WITHOUT_MAG if not mag else FORMS
        forms = [form for form in some if (form not in WITHOUT_MAG[3:] if mag else form in WITHOUT_MAG)]
        yield name, motion, str(rng.choice(forms)), mag


def main() -> None:
    """Print what is silent or misleading, and the table."""
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("--count", type=int, default=300)
    p.add_argument("--seed", type=int, default=1)
    p.add_argument("--only", type=int, nargs="*", help="these by their numbers, with all that was seen")
    args = p.parse_args()
    warnings.simplefilter("ignore")
    table: dict[str, Counter[str]] = {}
    for i, (name, motion, form, mag) in enumerate(draws(args.count, args.seed)):
        if args.only and i not in args.only:
            continue
        outcome, lines = judged(FAULTS[name], form, motion, mag)
        kind = f"{MOTIONS[motion][0] if motion in MOTIONS else REAL[motion]}, {'with' if mag else 'no'} mag"
        for row in (name.split(":")[0], kind, "all"):
            table.setdefault(row, Counter())[outcome] += 1
        if args.only or outcome not in ("right", "refused", "flagged"):
            again = f"python -m benchmarks.wrong_inputs --count {args.count} --seed {args.seed} --only {i}"
            print(f"{outcome}: {name}; {motion}; {form}; {kind}: {lines[:400]}\n    {again}", flush=True)
    columns = ("right", "refused", "flagged", "misleading", "silent", "silent, not shown")
    print(f"{'':18}" + "".join(f"{column:>18}" for column in columns))
    for row, counts in sorted(table.items()):
        print(f"{row:18}" + "".join(f"{counts[column]:18}" for column in columns))


if __name__ == "__main__":
    main()
