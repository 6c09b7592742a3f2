"""Magnetometers turned by hand in simulated rooms: what their cards predict beside the truth, by length and gradient.

A hand turns the unit about all its axes at some 60°/s. The sensor sits 5 to 30 cm off the point that it is turned
about, that point wanders by some 10 cm, and the field changes by a gradient of no preferred direction. Each unit has a
hard iron of 10 µT, a soft iron of 10 to 20 % along random axes and noise of 0.2 µT; rates scatter by 0.05 °/s and are
off by up to 1 °/s and 1 %, and the specific force is that of the moving hand. Prints, for each gradient and length and
with and without the other sensors, what `python -m benchmarks.harness rooms` prints, and the bars that are missed.
Run: python -m benchmarks.simulated_rooms [rooms] [gradients, µT/m] [lengths, s]
"""

import sys
from collections.abc import Iterator

import numpy as np

from benchmarks.harness.bar import Bar, bar_lines
from benchmarks.harness.calibration_world import field_n, in_body, random_axes
from benchmarks.harness.room import Room
from benchmarks.harness.rooms import WAYS, Rooms, trial_of
from plumbob.core.check import Floats
from plumbob.core.constants import G0
from plumbob.core.units import deg, dps
from plumbob.data import ImuData, ImuMeta
from plumbob.rotations import Frame, quat_from_rotvec, quat_multiply, quat_rotate

GRADIENTS = (0.3, 1.0, 3.0)  # µT/m, root mean square over directions: outdoors, a large room, a laboratory
LENGTHS = (15.0, 30.0, 60.0)  # s
RATE = 50.0  # Hz
MOST_OFF = 1.5  # error over predicted, root mean square
MOST_WORSE = 5.0  # %


def turning(rng: np.random.Generator, t: Floats) -> tuple[Floats, Floats]:
    """Attitude (N, 4) and rate (N, 3), rad/s, of a unit that a hand turns about all its axes, at some 60°/s."""
    waves = [np.sin(2.0 * np.pi * (f * t[:, np.newaxis] + rng.uniform(size=3))) for f in (0.03, 0.07, 0.13)]
    rate_b = 0.5 * sum(rng.normal(size=3) * wave for wave in waves)
    q_nb = [quat_from_rotvec(np.pi * random_axes(rng)[0])]
    for step in quat_from_rotvec(0.5 * (rate_b[1:] + rate_b[:-1]) / RATE):
        q_nb.append(quat_multiply(q_nb[-1], step))
    return np.array(q_nb), rate_b


def place(rng: np.random.Generator, t: Floats, q_nb: Floats) -> Floats:
    """Where the sensor is, (N, 3), m: on an arm that turns with the unit, about a point that wanders."""
    arm = rng.uniform(0.05, 0.3) * random_axes(rng)[0]
    slow, quick = (np.sin(2.0 * np.pi * (rng.uniform(*f, 3) * t[:, np.newaxis] + rng.uniform(size=3))) for f in
                   ((0.01, 0.05), (0.05, 0.2)))  # fmt: skip
    return quat_rotate(q_nb, arm) + 0.1 * slow + 0.05 * quick


def uneven(rng: np.random.Generator, gradient: float) -> Floats:
    """Gradient (3, 3) of a field without sources, µT/m, of no preferred direction."""
    one = rng.normal(size=(3, 3))
    one = one + one.T - np.eye(3) * 2.0 * np.trace(one) / 3.0
    return np.asarray(one * gradient * np.sqrt(3.0) / np.linalg.norm(one))


def in_room(seed: int, gradient: float, duration: float) -> tuple[Room, ImuData]:
    """Room, with the truth about the magnetometer, and what the unit measures in it."""
    rng = np.random.default_rng([seed, round(10.0 * gradient), round(duration)])
    t = np.arange(round(duration * RATE)) / RATE
    q_nb, rate_b = turning(rng, t)
    at_n = place(rng, t, q_nb)
    even_n = field_n(deg(60.0))
    off_n = at_n @ uneven(rng, gradient)
    axes = random_axes(rng)
    response = np.eye(3) + axes @ np.diag(rng.uniform(0.1, 0.2, 3) * rng.choice((-1.0, 1.0), 3)) @ axes.T
    hard = 10.0 * random_axes(rng)[0]
    mag = in_body(q_nb, even_n + off_n) @ response.T + hard + 0.2 * rng.normal(size=at_n.shape)
    moved_n = np.gradient(np.gradient(at_n, t, axis=0), t, axis=0) + G0 * Frame.NED.up
    gain = np.eye(3) + rng.uniform(-0.01, 0.01, (3, 3))
    gyr = rate_b @ gain.T + dps(rng.uniform(-1.0, 1.0, 3)) + dps(0.05) * rng.normal(size=rate_b.shape)
    size = np.cbrt(np.linalg.det(response))
    mean_n = even_n + off_n.mean(axis=0)
    room = Room(size * np.linalg.inv(response), hard, mean_n * size, float(np.sqrt(np.mean(off_n**2))), 0.0)
    return room, ImuData(t=t, mag=mag, gyr=gyr, acc=in_body(q_nb, moved_n), meta=ImuMeta(device="SIM"))


def measured(count: int, gradient: float, duration: float) -> Rooms:
    """Cards of some rooms."""
    made = (in_room(seed, gradient, duration) for seed in range(count))
    return Rooms({str(k): trial_of(room, imu) for k, (room, imu) in enumerate(made)}, {})


def bars(title: str, rooms: Rooms) -> Iterator[Bar]:
    """What cards should keep: honest figures in each grade, none beyond it, and hardly one worse than none."""
    for way in WAYS:
        for grade, share in rooms.shares(way).items():
            name = f"{title}, {way}, {grade}"
            yield Bar(f"{name}: error over predicted", share.ratio, 0.0, MOST_OFF)
            if grade in {"good", "fair"}:
                yield Bar(f"{name}: beyond the grade", share.beyond, 0.0, 0.0)
                yield Bar(f"{name}: worse than none", share.worse, 0.0, 0.0)
            else:
                yield Bar(f"{name}: worse than none, %", 100.0 * share.worse / share.cards, 0.0, MOST_WORSE)


def main() -> None:
    """Print the tables and the bars."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 200
    gradients, lengths = (
        tuple(map(float, sys.argv[k].split(","))) if len(sys.argv) > k else default
        for k, default in ((2, GRADIENTS), (3, LENGTHS))
    )
    found = []
    for gradient in gradients:
        for length in lengths:
            title = f"{gradient:g} µT/m, {length:g} s"
            rooms = measured(count, gradient, length)
            print(f"\n{title}, {count} rooms", *rooms.by_grade(), sep="\n", flush=True)
            found += bars(title, rooms)
    print("", *bar_lines(found), sep="\n")


if __name__ == "__main__":
    main()
