"""What 'plumbob doctor' finds of conventions that are planted: axes, units and delays, on real and simulated motions.

Each triad of a recording is arranged anew, by one of 48, put in a wrong unit, and made late or early by up to 200 ms.
Whether an arrangement can be seen at all is computed from the true attitude alone: with it, gravity and field are
turned into the body, and each other arrangement is scored on them; the least sum of squares in units of the disturbance
(linear acceleration, iron nearby, noise: what was measured less what the attitude says) must be 25 or more. Sums of
squares over arrangements are quadratic forms of one 9 × 9 matrix, so this is a statement about its least eigenvalues.

Then, in the recording as it is, one factor is planted: in the rates, in time, by a counter of rows taken for ms, or in
the specific force. Rates and times are observable where gravity and field, turned back by the rates with the part of
the factor that the gain of a part does not explain, stand 25 variances less still (`benchmarks.wrong_inputs`).
"""

import argparse
import os
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from benchmarks.wrong_inputs import unrest, whole
from plumbob import read, simulate
from plumbob.core.units import Quantity, to_si
from plumbob.data import AttitudeTrack, ImuData
from plumbob.data.recording import Recording
from plumbob.quality.arrangement import ARRANGEMENTS, BIN, Samples
from plumbob.quality.derotated import FLOOR, _changed, _products
from plumbob.quality.diagnosis import Declared, Examination, Trust
from plumbob.rotations import dcm_from_quat, quat_chained, quat_conjugate, quat_multiply, quat_slerp, rotvec_from_quat
from tests.helpers.file_kinds import Motion

SEEN = 25.0
WRONG_UNITS = {
    "gyr": ("rad/s", "deg/s", "rpm", "mrad/s"),
    "acc": ("m/s2", "g", "mg"),
    "mag": ("uT", "nT", "mgauss", "gauss"),
}
KIND = {"gyr": Quantity.RATE, "acc": Quantity.ACCELERATION, "mag": Quantity.FIELD}
SIMULATED = (
    ("tumble", 60.0), ("buoy", 120.0), ("sway", 60.0), ("arm", 60.0), ("turntable", 60.0), ("static", 60.0),
    ("tumble", 12.0), ("coning", 60.0), ("cone", 60.0), ("fin", 60.0),
)  # fmt: skip
FACTORS = (
    *((what, k) for what in ("rates", "time") for k in (0.5, 0.9, 1.1, 2.0)),
    ("counter", 0.0), ("force", 0.5), ("force", 2.0),
)  # fmt: skip
GAIN = 1.03  # of gyroscopes as they leave the line, PS-MPU-6000A, 6.1


Planted = tuple[dict[str, np.ndarray], dict[str, np.ndarray], dict[str, str], dict[str, float]]
"""Values, axes, units and delays by triad."""


@dataclass
class Tally:
    observable: int = 0
    found: int = 0
    hidden: int = 0
    hidden_found: int = 0
    confident_wrong: int = 0

    def count(self, seen: bool, found: bool, confident_wrong: bool) -> None:
        self.observable += seen
        self.hidden += not seen
        self.found += seen and found
        self.hidden_found += not seen and found
        self.confident_wrong += confident_wrong


@dataclass
class Score:
    tallies: dict[str, Tally]
    late: dict[str, list[float]]


def recordings(kinds: list[str], simulated: int) -> Iterator[tuple[str, Recording]]:
    data = Path(os.environ.get("PLUMBOB_DATA", "/nonexistent"))
    if "broad" in kinds:
        for path in sorted([*data.glob("broad/*.hdf5"), *data.glob("broad/*.mat")]):
            yield f"broad/{path.stem[:28]}", read(path)
    if "foreign" in kinds:
        for path in sorted(data.glob("foreign/*/*.parquet")):
            yield f"{path.parent.name}/{path.stem[-28:]}", read(path)
    if "simulated" in kinds:
        for seed in range(simulated):
            name, duration = SIMULATED[seed % len(SIMULATED)]
            sensors, unit = ("mpu6050+hmc5983", "ahrs500ga")[seed // 10 % 2], ("random", "calibrated")[seed % 2]
            made = simulate(name, frame="ENU", duration=duration, seed=seed, sensors=sensors, unit=unit)
            track = AttitudeTrack(t=made.truth.t, q_nb=made.truth.q_nb, frame="ENU", north="true")
            yield f"sim/{name}-{duration:g}s-{seed}", Recording(imu=made.imu, track=track, name=name)


def planted(imu: ImuData, rng: np.random.Generator) -> Planted:
    axes, units, delays, values = {}, {}, {}, {}
    for name in imu.triads:
        axes[name] = ARRANGEMENTS[rng.integers(48)]
        units[name] = str(rng.choice(WRONG_UNITS[name]))
        delays[name] = 0.0 if name == "gyr" else float(rng.uniform(-0.2, 0.2))
        v = getattr(imu, name)
        known = np.isfinite(v).all(axis=1)
        late = np.stack([np.interp(imu.t - delays[name], imu.t[known], v[known, i]) for i in range(3)], axis=1)
        outside = (imu.t - delays[name] < imu.t[0]) | (imu.t - delays[name] > imu.t[-1])
        late[~known | outside] = np.nan
        values[name] = late @ axes[name].T / float(to_si(1.0, units[name], KIND[name]))
    return values, axes, units, delays


def evidence(recording: Recording, name: str, arranged: np.ndarray) -> float:
    """Least sum of squares by which another arrangement contradicts the true attitude; see above."""
    imu, track = recording.imu, recording.track
    rows = np.clip(np.searchsorted(track.t, imu.t), 1, len(track.t) - 1)
    dcm = dcm_from_quat(np.nan_to_num(track.q_nb[rows], nan=0.5))
    measured = getattr(imu, name)
    known = np.isfinite(measured).all(axis=1) & np.isfinite(track.q_nb[rows]).all(axis=1)
    in_space = np.einsum("nij,nj->ni", dcm, measured)[known]
    steady = track.frame.up * 9.81 if name == "acc" else np.median(in_space, axis=0)
    true = np.einsum("nji,j->ni", dcm, steady)
    length = float(np.linalg.norm(steady))
    edges = np.arange(imu.t[0], imu.t[-1] + BIN, BIN)
    at = np.clip(np.searchsorted(track.t, 0.5 * (edges[1:] + edges[:-1])), 1, len(track.t) - 1)
    share = np.clip((0.5 * (edges[1:] + edges[:-1]) - track.t[at - 1]) / (track.t[at] - track.t[at - 1]), 0.0, 1.0)
    q = quat_slerp(np.nan_to_num(track.q_nb[at - 1], nan=0.5), np.nan_to_num(track.q_nb[at], nan=0.5), share)
    turns = rotvec_from_quat(quat_multiply(quat_conjugate(q[:-1]), q[1:]))
    turned, back = (dcm_from_quat(quat_chained(sign * turns)) for sign in (1.0, -1.0))
    best = 0.0
    for size in (25, 50):
        signal = Samples(imu.t, np.where(known[:, None], true / length, np.nan)).means(edges)
        noise = Samples(imu.t, np.where(known[:, None], (measured - true) / length, np.nan)).means(edges)
        seen, counts = _changed(*_products(turned, signal, size, 0))
        pushed, also = _changed(*_products(turned, noise, size, 0))
        if not (counts & also).any():
            continue
        m = ARRANGEMENTS[:24].transpose(0, 2, 1).reshape(24, 9)
        other = np.sum((seen @ m.T) ** 2, axis=1)  # (n, 24)
        mirrored = np.sum((_changed(*_products(back, signal, size, 0))[0] @ m.T) ** 2, axis=1)
        var = np.sum((pushed @ np.eye(3).ravel()) ** 2, axis=1) / 2.0
        sd2 = np.median(var[counts & also]) / 0.693 + FLOOR**2
        total = np.concatenate((other.sum(axis=0)[1:], mirrored.sum(axis=0))) / (2.0 * sd2)
        best = max(best, float(total.min()))
    return best


def _axes(
    label: str, recording: Recording, before: Examination, after: Examination, planted_: Planted, all_: Score
) -> None:
    """Count what was found of the axes and the delay of each vector sensor."""
    _, axes, _, delays = planted_
    kind = label.split("/", maxsplit=1)[0]
    delayed = {f.sensor: f for f in after.answers.values() if f.question == "delay"}
    for name, sensor in after.sensors.items():
        tally = all_.tallies.setdefault(f"{kind} {name}", Tally())
        found, expected = sensor.found, np.linalg.det(axes[name]) * axes[name] @ axes["gyr"].T
        right = found is not None and bool((sensor.axes == expected).all())
        seen = (score := evidence(recording, name, expected)) >= SEEN
        wrong = sensor.answer is Trust.SURE and not right
        tally.count(seen, right and sensor.known, wrong)
        if found is not None and (wrong or (seen and not (right and sensor.known))):
            print(
                f"{label} {name}: {'right' if right else 'WRONG'} {sensor.answer} evidence {score:.1f} odds e^"
                f"{found.margin:.1f} explained {found.explained:.2f} halves agree {found.agrees}, windows "
                f"{'differ' if found.contradicted else 'agree'}, scale {found.scale:.4g}",
                flush=True,
            )
        old = before.sensors[name]
        if right and delayed[name].answer is Trust.SURE and old.known and old.found.delay_sd < 2e-3:
            error = found.delay - old.found.delay - delays[name]
            all_.late.setdefault(f"{kind} {name}", []).append(error)
            if abs(error) > 2e-3:
                print(f"{label} {name}: delay off by {1e3 * error:.2f} ms, sd {1e3 * found.delay_sd:.2f}", flush=True)


def _units(label: str, after: Examination, units: dict[str, str], all_: Score) -> None:
    """Count what was found of the units."""
    for one in after.answers.values():
        if one.question == "unit" and one.answer is not Trust.UNKNOWN:
            tally = all_.tallies.setdefault(f"{label.split('/', maxsplit=1)[0]} {one.sensor} unit", Tally())
            right = after.numbers.get(one.sensor, {}).get("unit") == units[one.sensor]
            tally.count(True, right, not right and one.answer is Trust.SURE)
            if not right:
                print(f"{label} {one.sensor}: {one.value}, but it is {units[one.sensor]}; {one.answer}, {one.why}")


def _with_factor(imu: ImuData, what: str, k: float) -> tuple[ImuData, float]:
    """The recording with one factor, and by how much the rates then turn too fast, or the force is too large."""
    t, values = np.array(imu.t), {name: np.array(getattr(imu, name)) for name in imu.triads}
    if what == "counter":
        k = 1e-3 / float(np.median(np.diff(t)))
        t = 1e-3 * np.arange(t.size)
    elif what == "time":
        t = t * k
    else:
        values["gyr" if what == "rates" else "acc"] *= k
    meta = replace(imu.meta, unit_check=False, gyr_range=None, acc_range=None)
    return ImuData(t=t, meta=meta, **values), k


def own_gain(recording: Recording) -> float:
    """By how much the rates of a recording turn faster than its reference, over windows of half a second."""
    imu, track = recording.imu, recording.track
    at = np.searchsorted(imu.t, np.arange(max(imu.t[0], track.t[0]), min(imu.t[-1], track.t[-1]), 0.5))
    q = track.q_nb[np.searchsorted(track.t, imu.t[at]).clip(0, len(track) - 1)]
    seen = rotvec_from_quat(quat_multiply(quat_conjugate(q[:-1]), q[1:]))
    q = quat_chained(whole(imu.t, imu.gyr)[:-1] * np.diff(imu.t)[:, np.newaxis])[at]
    turned = rotvec_from_quat(quat_multiply(quat_conjugate(q[:-1]), q[1:]))
    rows = np.isfinite(seen).all(axis=1) & (np.linalg.norm(seen, axis=1) < 2.0)
    fitted = np.linalg.lstsq(np.column_stack((seen, np.ones(len(seen))))[rows], turned[rows])[0][:3]
    return float(np.linalg.norm(seen[rows] @ fitted) / np.linalg.norm(seen[rows]))


def _shown(recording: Recording, size: float) -> bool:
    """Whether rates that turn by a factor too fast are seen to in the middle, beyond what a gain explains."""
    imu, middle = recording.imu, len(recording.imu) // 2
    rows = slice(max(0, middle - 2000), middle + 2000)  # what takes a search
    of = {name: whole(imu.t, getattr(imu, name))[rows] for name in imu.triads}
    t_ns = np.round((imu.t[rows] - imu.t[rows][0]) * 1e9).astype(np.int64)
    right = Motion(t_ns, of["gyr"], of["acc"], of.get("mag"), None, None)
    wrong = right._replace(gyr=right.gyr * (size * GAIN if size < 1.0 else size / GAIN))
    return unrest(right, wrong)[0] > SEEN


def _factor(label: str, recording: Recording, rng: np.random.Generator, before: Examination, all_: Score) -> None:
    """Count whether a planted factor is named, and whether anything is called wrong and sure that was not before."""
    what, k = FACTORS[rng.integers(len(FACTORS))]
    imu, size = _with_factor(recording.imu, what, k)
    if "acc" not in imu.triads or abs(np.log(size)) <= np.log(GAIN):
        return
    diagnosis = (after := Examination(imu, label, Declared(None), None)).diagnosis()
    slower = (imu.t[-1] - imu.t[0]) / (recording.imu.t[-1] - recording.imu.t[0])
    sensor = "acc" if what == "force" else "gyr"
    right, wrong = False, []
    for it in (it for it in diagnosis.findings if it.wrong):
        factor = it.finding.values.get("factor")
        if (it.sensor, it.question) == (sensor, "unit") and factor is not None and it.finding.code != "doctor.unit":
            off = np.log(factor * size if what == "force" else factor / (size * own_gain(recording)))
            sd = it.finding.values.get("sd", 0.0) / factor
            right |= (named := abs(off) < np.log(GAIN) + 3.0 * sd or what == "force")
            wrong += [] if named else [it]
        elif it.question == "delay":  # that of the recording, in its new time, is no fault of the doctor
            new, old = (each.sensors[it.sensor].found for each in (after, before))
            off = abs(new.delay - old.delay * slower)
            wrong += [it] if off > 3.0 * np.hypot(new.delay_sd, old.delay_sd * slower) else []
        elif not before.answers[it.sensor, it.question].wrong:
            wrong.append(it)
    tally = all_.tallies.setdefault(f"{label.split('/', maxsplit=1)[0]} factor of {what}", Tally())
    seen = what == "force" or _shown(recording, size)
    tally.count(seen, right, any(it.answer is Trust.SURE for it in wrong))
    if wrong or (seen and not right):
        said = [f"{it.sensor} {it.question} {it.answer}: {it.value}" for it in diagnosis.findings if it.wrong]
        unit = next(it for it in diagnosis.findings if (it.sensor, it.question) == (sensor, "unit"))
        print(
            f"{label} {what} × {size:.3g}: {'; '.join(said) or f'{unit.answer} {unit.value}; {unit.why}'}", flush=True
        )


def main() -> None:
    p = argparse.ArgumentParser(description=__doc__)
    p.add_argument("--kinds", nargs="+", default=["broad", "foreign", "simulated"])
    p.add_argument("--simulated", type=int, default=200)
    p.add_argument("--seed", type=int, default=20240501, help="of what is planted")
    args = p.parse_args()
    all_, rng, used = Score({}, {}), np.random.default_rng(args.seed), time.process_time()
    second = np.random.default_rng(args.seed + 1)
    for label, recording in recordings(args.kinds, args.simulated):
        imu = recording.imu
        if imu is None or "gyr" not in imu.triads:
            continue
        before = Examination(imu, label, Declared(None), None)
        before.diagnosis()
        meta = replace(imu.meta, unit_check=False, gyr_range=None, acc_range=None, mag_range=None)
        changed = planted(imu, rng)
        after = Examination(ImuData(t=imu.t, meta=meta, **changed[0]), label, Declared(None), None)
        after.diagnosis()
        _axes(label, recording, before, after, changed, all_)
        _units(label, after, changed[2], all_)
        _factor(label, recording, second, before, all_)
    for name, tally in all_.tallies.items():
        other = "" if name.endswith("unit") else f", {tally.hidden_found} of {tally.hidden} others"
        what = "answered" if name.endswith("unit") else "observable"
        print(
            f"{name}: found {tally.found} of {tally.observable} {what}{other}; sure and wrong {tally.confident_wrong}"
        )
    for name, errors in all_.late.items():
        e = 1e3 * np.array(errors)
        rms, largest = np.sqrt(np.mean(e * e)), np.abs(e).max()
        print(f"{name}: delay of {len(e)} sure ones, rms {rms:.2f} ms, largest {largest:.2f} ms")
    print(f"{time.process_time() - used:.0f} s of CPU")


if __name__ == "__main__":
    main()
