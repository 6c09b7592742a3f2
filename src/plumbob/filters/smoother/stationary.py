"""A gyroscope that says that the unit turns while gravity and field stand still: its bias has jumped.

A turn moves what is not its axis, in the sensor's own axes by as much as it says. Where both together move by less than
a quarter of that, nothing turned. What a turn does to the force is what it does to the vertical: a vehicle that turns
about that takes its own acceleration with it. So the attitude is in doubt; and where all is calm besides, the rate is
the bias.
"""

import math
from typing import Final

import numpy as np

from plumbob.core.check import Floats
from plumbob.core.kernels import kernel
from plumbob.core.units import deg
from plumbob.filters.smoother.keyframes import turned_by
from plumbob.filters.smoother.model import SIZE, TH, B, V
from plumbob.rotations.kernels import third_row

SEEN: Final = deg(1.0)  # a turn that would move them by this, rad, shows;
CLEAR: Final = deg(3.0)
"""by this, it is clear."""
STILL: Final = 0.25  # they stand still if they move by less than this share of it
FIRST: Final = 0.5  # where they were is a mean over this, s, where they are
LATEST: Final = 0.3
"""one over this."""
AFRESH: Final = 4.0  # without a contradiction the comparison begins again after this, s,
FARTHEST: Final = deg(30.0)
"""or beyond this, rad: a whole turn brings them back."""
HOLDS: Final = 5.0  # the doubt stays for so long, s

STOOD: Final = 0  # for how long it has been compared, s
TURN: Final = 1  # what the gyroscope turned meanwhile, rad, 3
THEN: Final = 4  # force, field and that turn where it began, 9
LATER: Final = 13  # and now, 9
UNTIL: Final = 22  # time until which the attitude is in doubt, s
JUMPED: Final = 23  # time of the last jump, s
MISLED: Final = 24  # time at which the attitude was lost last, s, by a jump that is not seen or by a wrong scale
UP: Final = 25  # the vertical in body axes where it began, 3
PLACES: Final = 28


def fresh() -> Floats:
    """Nothing has been compared yet."""
    state = np.zeros(PLACES)
    state[UNTIL : MISLED + 1] = -math.inf
    return state


@kernel
def means(acc: Floats, mag: Floats, begin: int, end: int, out: Floats) -> None:
    """Mean force and field of the samples behind `begin`, up to and with `end`; NaN without any."""
    for axis in range(3):
        force, field, count = 0.0, 0.0, 0
        for s in range(begin + 1, end + 1):
            force += acc[s, axis]
            if not math.isnan(mag[s, axis]):
                field += mag[s, axis]
                count += 1
        out[axis] = force / (end - begin)
        out[3 + axis] = field / count if count else math.nan


@kernel
def moved(state: Floats, at: int, turned: int) -> tuple[float, float]:
    """Squares of the angles, rad, by which a direction should have moved, as `turned` does, and by which it did."""
    size2, turned2, off2 = 0.0, 0.0, 0.0
    for i in range(3):
        size2 += state[THEN + at + i] ** 2
        turned2 += state[turned + i] ** 2
        off2 += (state[LATER + at + i] - state[THEN + at + i]) ** 2
    if not size2 > 0.0 or math.isnan(off2):
        return 0.0, 0.0
    expected2 = 0.0
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        turn_j, turn_k = state[LATER + 6 + j] - state[THEN + 6 + j], state[LATER + 6 + k] - state[THEN + 6 + k]
        expected2 += (turn_j * state[turned + k] - turn_k * state[turned + j]) ** 2
    return expected2 / turned2, off2 / size2


@kernel
def stands(state: Floats, vectors: Floats, attitude: Floats, rate: Floats, dt: float, now: float) -> float:
    """Compare mean force and field of a step, the first six of `vectors`, with a turn at a rate (3,).

    Returns the square of the angle, rad, by which they should have moved and did not; zero without a contradiction.
    """
    begun = state[STOOD] > 0.0
    state[STOOD] += dt
    if not begun:
        state[UP], state[UP + 1], state[UP + 2] = third_row(attitude[0], attitude[1], attitude[2], attitude[3])
    for i in range(3):
        before = state[TURN + i] if begun else 0.0
        state[TURN + i], vectors[6 + i] = before + rate[i] * dt, before + 0.5 * rate[i] * dt
    for i in range(9):
        if not begun or math.isnan(state[THEN + i]):
            state[THEN + i] = state[LATER + i] = vectors[i]
        elif not math.isnan(vectors[i]):
            if state[STOOD] < FIRST:
                state[THEN + i] += dt / state[STOOD] * (vectors[i] - state[THEN + i])
            state[LATER + i] += min(dt / LATEST, 1.0) * (vectors[i] - state[LATER + i])
    if state[STOOD] >= FIRST + LATEST:
        force, field = moved(state, 0, UP), moved(state, 3, THEN + 3)
        expected2, off2 = force[0] + field[0], force[1] + field[1]
        if expected2 > SEEN * SEEN and off2 < STILL * STILL * expected2:
            if expected2 > CLEAR * CLEAR:
                state[UNTIL] = now + HOLDS
            return expected2
    turn2 = state[TURN] ** 2 + state[TURN + 1] ** 2 + state[TURN + 2] ** 2
    if state[STOOD] > AFRESH or turn2 > FARTHEST * FARTHEST:
        state[STOOD] = 0.0
    return 0.0


@kernel
def take_bias(state: Floats, time: float, attitude: Floats, x: Floats, p: Floats, band: float, before: float) -> None:
    """Take the rate for the bias, known to a band, rad/s; what was turned by it goes back.

    It may have jumped up to `before`, s, before it was compared.
    """
    turned_by(attitude, -state[TURN], -state[TURN + 1], -state[TURN + 2])
    rate2, turn2 = 0.0, 0.0
    for i in range(3):
        rate = state[TURN + i] / state[STOOD]
        x[B + i] += rate
        rate2 += rate * rate
        turn2 += state[TURN + i] ** 2
    for i in (B, B + 1, B + 2, V, V + 1):
        for j in range(SIZE):
            p[i, j] = p[j, i] = 0.0
    for i in range(3):
        p[B + i, B + i] = band * band
        p[TH + i, TH + i] += rate2 * before * before + 0.25 * turn2
    for i in (V, V + 1):
        x[i], p[i, i] = 0.0, band
    state[STOOD], state[JUMPED] = 0.0, time
