"""Are wrong axes named? Each sensor in turn is given each of the 48 arrangements of its axes, and calibrated with.

Captures are simulated ones (turned by hand, slowly, leaning by 25° at most) and a minute of each room of BROAD
[Laidig2021]. Right is: axes as they are, accepted without a word on them; others, named with the line of a profile that
puts them right, by a refusal or a remark; and all axes of magnetometer or accelerometer negated, which is the field of
the other hemisphere, told as a field that points up. `silent` is a card that says nothing of axes, `other` a refusal
that does not; a capture that is refused with right axes too is judged by the wrong ones alone, of all axes negated not.
Prints what the sensors say of each other for all arrangements, and what calibrations with every seventh say.
Run: python -m benchmarks.axes [--every K] [BROAD folder]
"""

import argparse
import os
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from plumbob.calibration.calibrate_mag import calibrate_mag
from plumbob.calibration.fit import CaptureRefusedError
from plumbob.calibration.mag.axes import arrangements, suspects
from plumbob.core.errors import CalibrationError
from plumbob.data import ImuData, ImuMeta
from plumbob.fleet.experiments.trials import read_trial
from plumbob.rotations import axes_letters, every_axes

sys.path[:0] = [str(Path(__file__).resolve().parents[1])]

from tests.helpers import mag_scene  # noqa: E402

MODES = ("auto", "none", "acc", "gyr")
SENSORS = ("mag", "acc", "gyr")
LASTING, RATE = 60.0, 50.0
"""Part of a room's recording that counts, s, and the rate that it is thinned to, Hz."""


def simulated(seed: int = 0) -> Iterator[tuple[str, ImuData]]:
    """Captures of units that are known to be right, each with its own iron, noise and biases."""
    rng = np.random.default_rng(seed)
    for name, (t, q_nb, rates) in {
        "turned by hand": mag_scene.tumbling(rng, duration=LASTING, rate=RATE),
        "turned slowly": mag_scene.trajectory(rng, duration=2.0 * LASTING, rate=RATE, tilt=np.pi),
        "leaning by 25°": mag_scene.trajectory(rng, duration=LASTING, rate=RATE, tilt=np.radians(25.0)),
    }.items():
        mag = mag_scene.field(rng, mag_scene.unit_of(rng), q_nb)
        gyr = mag_scene.rates(rng, rates) + np.radians(3.0) * rng.normal(size=3)
        yield name, ImuData(t=t, gyr=gyr, acc=mag_scene.force(rng, q_nb), mag=mag, meta=ImuMeta(device="SN1"))


def rooms(folder: Path) -> Iterator[tuple[str, ImuData]]:
    """The first minute of turning of each recording in a room, thinned."""
    for name in mag_scene.TURNED:
        imu, _ = read_trial(folder / name)
        moving = np.flatnonzero(np.linalg.norm(imu.usable("gyr"), axis=1) > np.radians(20.0))
        step = max(1, round((len(imu) - 1) / float(imu.t[-1] - imu.t[0]) / RATE))
        first = int(moving[0])
        stop = int(np.searchsorted(imu.t, imu.t[first] + LASTING))
        kept = np.arange(first, stop, step)
        triads = {triad: imu.usable(triad)[kept] for triad in imu.triads}
        yield name[:20], ImuData(t=imu.t[kept] - imu.t[first], meta=ImuMeta(device="SN1"), **triads)


def turned(imu: ImuData, sensor: str, way: np.ndarray) -> ImuData:
    """The capture with other axes of one sensor."""
    return imu.corrected(meta=imu.meta, **{sensor: imu.usable(sensor) @ way.T})


def verdict(imu: ImuData, sensor: str, way: np.ndarray, mode: str) -> str:
    """What a calibration says of a capture with these axes of one sensor: right, silent, or other."""
    try:
        told = " ".join(map(str, calibrate_mag(turned(imu, sensor, way), with_=mode).remarks))
        card = True
    except CaptureRefusedError as refused:
        told, card = str(refused), False
    except CalibrationError as error:
        told, card = str(error), False
    return judged(told, sensor, way, card=card)


def judged(told: str, sensor: str, way: np.ndarray, *, card: bool) -> str:
    """Whether what was told is right of these axes."""
    first = told.split("South of the magnetic equator", maxsplit=1)[0]
    of_axes = [word for word in ("axes = ", "FIELD POINTS UP") if word in first]
    if np.array_equal(way, np.eye(3)):
        return "wrongly named" if of_axes else "right" if card else "refused"
    named = f'[{sensor}] axes = "{axes_letters(way.T)}"' in first
    if named or (np.array_equal(way, -np.eye(3)) and sensor != "gyr" and "FIELD POINTS UP" in first):
        return "right"
    if not card and not of_axes:
        return "refused" if np.array_equal(way, -np.eye(3)) and sensor != "gyr" else "other"
    return "wrongly named" if of_axes else "silent"


def evidence(imu: ImuData, sensor: str, way: np.ndarray) -> str:
    """What the sensors say of each other with these axes of one of them: right, silent, or wrongly named."""
    other = turned(imu, sensor, way)
    found = suspects(
        arrangements(imu.t, other.usable("mag"), acc=other.usable("acc"), gyr=other.usable("gyr")),
    )
    true = way if sensor == "gyr" else np.linalg.det(way) * way  # but for the sign, which the dip tells
    if np.array_equal(true, np.eye(3)):
        return "wrongly named" if found else "right"
    right = len(found) == 1 and found[0].triad == sensor and np.array_equal(found[0].way, true)
    return "right" if right else "wrongly named" if found else "silent"


def table(rows: Iterator[tuple[str, list[str]]], of: int) -> None:
    """Print how many of each row are right, and the share of all; what is refused for other reasons does not count."""
    whole: Counter[str] = Counter()
    for name, verdicts in rows:
        count = Counter(verdicts)
        whole += count
        others = ", ".join(f"{number} {one}" for one, number in count.items() if one != "right")
        print(f"{name:40} {count['right']:3} of {of} {others}".rstrip(), flush=True)
    counted = whole.total() - whole["refused"]
    print(f"right: {whole['right']} of {counted}, {100.0 * whole['right'] / counted:.2f} %")


def main() -> None:
    """Print both tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", nargs="?", type=Path, default=Path(os.environ.get("PLUMBOB_DATA", ".")) / "broad")
    parser.add_argument("--every", type=int, default=7, help="arrangements that are calibrated with: every so many")
    args = parser.parse_args()
    captures = [*simulated(), *(rooms(args.folder) if args.folder.is_dir() else ())]
    ways, some = every_axes(), every_axes()[:: args.every]
    print("What the sensors say of each other, whatever is calibrated")
    table(
        ((f"{name}: {one}", [evidence(imu, one, way) for way in ways]) for name, imu in captures for one in SENSORS),
        len(ways),
    )
    print("What 'calibrate mag' says")
    table(
        (
            (f"{name} --with {mode}: {one}", [verdict(imu, one, way, mode) for way in some])
            for name, imu in captures
            for mode in MODES
            for one in SENSORS
        ),
        len(some),
    )


if __name__ == "__main__":
    sys.exit(main())
