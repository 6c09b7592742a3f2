"""Magnetometer of a unit at work, simulated and real: `calibrate mag --in-use` beside the package magyc.

Simulated: a hand, a drone, a boat and a ship that leans by 3°, for ten minutes or an hour, at 50 Hz. Hard iron of
15 µT, soft iron of 5 to 15 % along random axes, noise of 0.3 µT, and a magnetometer that is turned by 1.5° against the
case, as in recordings of real units, or not at all, which is what magyc takes for granted. Rates scatter by 0.05 °/s,
their bias is up to 1 °/s and walks by 0.02 °/s in ten minutes, and their gain is off by up to 1 % per entry. The field
is even, or wanders by 0.5 µT over minutes, or passes steel of 20 µT for some seconds, once in two minutes. Real: every
recording of a folder that carries a reference attitude, beside the same fit by the rates of that, which have no errors
of a gyroscope.

Prints heading errors over inclinations up to 45° (the ship: 5°), root mean square, without a card, by magyc's four
methods, of means at 10 Hz, and by ours with what it predicts; medians over the seeds. magyc wants other versions of
numpy and jax than Plumbob, so it runs by another Python:

    python -m venv magyc && magyc/bin/pip install magyc==1.0.0
    python -m benchmarks.in_use [--peer magyc/bin/python] [--seeds 10] [--minutes 10,60] [--real FOLDER]
"""

import argparse
import json
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from benchmarks.harness.calibration_world import field_n, in_body, random_axes
from benchmarks.harness.room import Room, room_of
from benchmarks.simulated_rooms import turning
from plumbob.calibration.fit import CaptureRefusedError
from plumbob.calibration.mag import fit_mag_in_use
from plumbob.calibration.mag.with_gyr import SHEET_GAIN_SD
from plumbob.calibration.predicted import TILT_RANGE
from plumbob.core.check import Floats
from plumbob.core.errors import PlumbobError
from plumbob.core.units import deg, dps, to_deg
from plumbob.data.cards import UNITS, TriadCalibration
from plumbob.fleet.experiments.trials import read_trial
from plumbob.rotations import (
    dcm_from_quat,
    quat_conjugate,
    quat_from_euler_zyx,
    quat_from_rotvec,
    quat_multiply,
    rotvec_from_quat,
)

RATE = 50.0  # Hz
DIP = deg(60.0)
SCENES = {"hand": None, "drone": deg(20.0), "boat": deg(8.0), "ship": deg(3.0)}  # inclination; None: all attitudes
FIELDS = ("even", "wandering", "steel", "even, not turned")
TURN = deg(1.5)
PEERS = ("ls", "nls", "bfg", "ifg")
PEER = """
import json, sys
import numpy as np
from magyc import magyc_bfg, magyc_ifg, magyc_ls, magyc_nls
data = np.load(sys.argv[1])
found = {}
for method in (magyc_ls, magyc_nls, magyc_bfg, magyc_ifg):
    try:
        hard, soft, *_ = method(data["mag"], data["gyr"], data["t"])
        found[method.__name__[6:]] = [np.asarray(hard).tolist(), np.asarray(soft).tolist()]
    except Exception as error:
        print(f"{method.__name__}: {error}", file=sys.stderr)
print(json.dumps(found))
"""


class Capture(NamedTuple):
    """What a unit measured, the truth about its magnetometer, and the inclination up to which headings count, rad."""

    room: Room
    t: Floats
    mag: Floats
    gyr: Floats
    tilt_range: float


def motion(rng: np.random.Generator, scene: str, t: Floats) -> tuple[Floats, Floats]:
    """Attitude (N, 4) and rate (N, 3), rad/s."""
    lean = SCENES[scene]
    if lean is None:
        return turning(rng, t)

    def waves(*frequencies: float) -> Floats:
        return np.asarray(sum(np.sin(2.0 * np.pi * (f * t + rng.uniform())) for f in frequencies))

    roll, pitch = 0.7 * lean * waves(0.11, 0.17, 0.23), 0.5 * lean * waves(0.09, 0.14, 0.2)
    yaw = deg(120.0) * waves(0.004, 0.011, 0.021) + deg(5.0) * waves(0.1)
    q_nb = quat_from_euler_zyx(np.stack((roll, pitch, yaw), axis=1))
    between = rotvec_from_quat(quat_multiply(quat_conjugate(q_nb[:-1]), q_nb[1:])) * RATE
    return q_nb, np.concatenate((between[:1], 0.5 * (between[1:] + between[:-1]), between[-1:]))


def departure(rng: np.random.Generator, field: str, t: Floats) -> Floats:
    """Departure of the field from what it is as a rule, (N, 3), µT, in the axes of the place."""
    off = np.zeros((len(t), 3))
    if field == "wandering":
        for f in (0.001, 0.003, 0.01):
            off += 0.5 * np.sin(2.0 * np.pi * (f * t[:, np.newaxis] + rng.uniform(size=3))) * rng.normal(size=3)
    if field == "steel":
        for _ in range(round(t[-1] / 120.0)):
            off += 20.0 * np.exp(-(((t - rng.uniform(0.0, t[-1])) / 5.0) ** 2))[:, np.newaxis] * random_axes(rng)[0]
    return off


def capture(seed: int, scene: str, field: str, minutes: float) -> Capture:
    """Simulate."""
    rng = np.random.default_rng([seed, list(SCENES).index(scene), FIELDS.index(field), round(minutes)])
    t = np.arange(round(60.0 * minutes * RATE)) / RATE
    q_nb, rate_b = motion(rng, scene, t)
    even_n, axes = field_n(DIP), random_axes(rng)
    response = np.eye(3) + axes @ np.diag(rng.uniform(0.05, 0.15, 3) * rng.choice((-1.0, 1.0), 3)) @ axes.T
    if not field.endswith("not turned"):
        response = dcm_from_quat(quat_from_rotvec(TURN * random_axes(rng)[0])) @ response
    hard = 15.0 * random_axes(rng)[0]
    mag = in_body(q_nb, even_n + departure(rng, field, t)) @ response.T + hard + 0.3 * rng.normal(size=(len(t), 3))
    walk = dps(0.02) * np.sqrt(1.0 / (600.0 * RATE)) * np.cumsum(rng.normal(size=mag.shape), axis=0)
    gain = np.eye(3) + rng.uniform(-0.01, 0.01, (3, 3))
    gyr = rate_b @ gain.T + dps(rng.uniform(-1.0, 1.0, 3)) + walk + dps(0.05) * rng.normal(size=mag.shape)
    size = np.cbrt(np.linalg.det(response))
    room = Room(size * np.linalg.inv(response), hard, even_n * size, 0.0, 0.0)
    return Capture(room, t, mag, gyr, deg(5.0) if scene == "ship" else TILT_RANGE)


def real(folder: Path) -> Iterator[tuple[str, Capture]]:
    """Recordings with a reference, whole."""
    for path in sorted(p for p in folder.iterdir() if p.is_file()):
        try:
            imu, reference = read_trial(path)
            room = room_of(imu, reference)
        except PlumbobError:
            continue
        known = np.isfinite(imu.usable("gyr")).all(axis=1)
        yield path.stem, Capture(room, imu.t[known], imu.usable("mag")[known], imu.usable("gyr")[known], TILT_RANGE)


def ours(case: Capture) -> tuple[float, float] | str:
    """Heading error and predicted one, °; or why it was refused."""
    try:
        found = fit_mag_in_use(
            case.t, case.mag, case.gyr, dip=_dip(case.room), gyr_gain_sd=SHEET_GAIN_SD, tilt_range=case.tilt_range
        ).calibration
    except CaptureRefusedError as refused:
        return refused.reasons[0].kind
    assert found.quality is not None and found.quality.heading_sd is not None
    return _off(case, found), float(to_deg(found.quality.heading_sd))


def theirs(case: Capture, python: str | None) -> dict[str, float]:
    """Heading error, °, by each of magyc's methods that came to an end."""
    if python is None:
        return {}
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "capture.npz"
        np.savez(file, **_thinned(case))
        done = subprocess.run([python, "-c", PEER, str(file)], capture_output=True, text=True, check=True)
    found: Mapping[str, tuple[list[float], list[list[float]]]] = json.loads(done.stdout.splitlines()[-1])
    return {name: _off(case, _card(np.array(hard), np.linalg.inv(soft))) for name, (hard, soft) in found.items()}


def _thinned(case: Capture) -> dict[str, Floats]:
    """Means at 10 Hz, the rate of magyc's own simulations; whole records take it minutes."""
    present = np.isfinite(case.mag).all(axis=1)
    step = max(1, round(0.1 / float(np.median(np.diff(case.t[present])))))
    count = np.count_nonzero(present) // step
    columns = {"t": case.t[present, np.newaxis], "mag": case.mag[present], "gyr": case.gyr[present]}
    means = {name: rows[: count * step].reshape(count, step, -1).mean(axis=1) for name, rows in columns.items()}
    return {**means, "t": means["t"][:, 0]}


def _card(bias: Floats, matrix: Floats) -> TriadCalibration:
    return TriadCalibration(matrix=matrix, bias=bias, unit_in=UNITS["mag"], unit_out=UNITS["mag"])


def _off(case: Capture, card: TriadCalibration | None) -> float:
    return float(to_deg(case.room.heading_off(card, case.tilt_range)))


def _dip(room: Room) -> float:
    """Dip of a room's field, whose axes point up or down."""
    return float(np.arctan2(abs(room.field[2]), np.hypot(room.field[0], room.field[1])))


def row(title: str, cases: list[Capture], python: str | None) -> str:
    """Line of the table: medians, and of ours the predicted error, error over predicted (rms), and what was refused."""
    fits = [ours(case) for case in cases]
    made = np.array([one for one in fits if not isinstance(one, str)]).reshape(-1, 2)
    peers = [theirs(case, python) for case in cases]
    cells = [np.median([_off(case, None) for case in cases])]
    cells += [np.median([one.get(name, np.nan) for one in peers]) for name in PEERS]
    told = "".join(f"{cell:8.2f}" for cell in cells)
    if not len(made):
        return f"{title:44}{told}     refused: {fits[0]}"
    ratio = np.sqrt(np.mean((made[:, 0] / made[:, 1]) ** 2))
    own = f"{np.median(made[:, 0]):8.2f}{np.max(made[:, 0]):8.2f}{np.median(made[:, 1]):11.2f}{ratio:8.2f}"
    return f"{title:44}{told}{own}{len(cases) - len(made):9}"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--peer", metavar="PYTHON", help="a Python that has magyc; without it, ours alone")
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--minutes", default="10,60")
    parser.add_argument("--real", type=Path, metavar="FOLDER")
    args = parser.parse_args()
    head = "".join(f"{name:>8}" for name in ("none", *PEERS, "ours", "worst"))
    print(f"{'heading error, °':44}{head}  predicted   ratio  refused", flush=True)
    for minutes in map(float, args.minutes.split(",")):
        for scene in SCENES:
            for field in FIELDS:
                cases = [capture(seed, scene, field, minutes) for seed in range(args.seeds)]
                print(row(f"{scene}, field {field}, {minutes:g} min", cases, args.peer), flush=True)
    for name, case in real(args.real) if args.real else ():
        print(row(name, [case], args.peer), flush=True)


if __name__ == "__main__":
    sys.exit(main())
