"""Trackers of an array: each unit's bias, scale and alignment against the mean of all, and what deviates from them.

For units of equal noise, a Kalman filter with a bias for each unit is the same as a filter on the mean rate and, for
each unit, a small one on its parity: what it measures beyond the mean. So an array costs one filter, and for each unit
a few numbers, which are kept here. Each sensor axis has four: a bias, and how much of the body's x, y and z it has too
much of (scale and misalignment). Their covariance is that of the unit, for all its axes see the same motion.

Their innovations are white as long as nothing breaks. Two means of them, over `tau`, are looked at: of the innovations,
which a bias, a wrong scale or swapped axes move, and of their squares, which noise does. The scale of the noise is
learned, slowly from all and quickly from the other units, so that what all units feel, as a motion that no model has,
is not blamed on one of them. A third look is at values that stay the same while the other units' change.

What deviates is suspect: its trackers wait. Where one unit deviates clearly more than any other it is left out, and
taken in again when it has agreed for a while. What it is corrected by stays, and so does the reference of all: the
combined value does not jump when a unit goes.
"""

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from plumbob.arm.array.solve import add_axis, inverse3, times
from plumbob.core import flags
from plumbob.core.check import Floats
from plumbob.core.kernels import kernel

TH: Final = 0  # bias, and share of x, y and z, of each axis: 12
COV: Final = 12  # their covariance, 10 upper entries by rows
MEAN: Final = 22  # of the innovations over their standard deviations, of each axis
SQUARE: Final = 25  # and of their squares
LAST: Final = 28  # last value of each axis
SAME: Final = 31  # for how many samples each axis has said the same while others have changed
CHANGING: Final = 34  # share of samples in which each axis changes
SAMPLES: Final = 37
ABSENT: Final = 38  # for how long there has been no value, s
STATE: Final = 39
REASON: Final = 40
AGREES: Final = 41  # for how long it has agreed again, s
SCORE: Final = 42
INNOVATION: Final = 43  # of each axis over its standard deviation; NaN where there is none
KEPT: Final = 46  # trackers of some seconds before, twice 12: a fault may have got into those of now
UNSURE: Final = 70  # share of an innovation's variance that is the trackers' own
UNIT_SIZE: Final = 71

SCALE: Final = 0  # variance of the noise over the given one
COUNT: Final = 1
SPREAD: Final = 2  # variance of MEAN
LAST_T: Final = 3
UNCLEAR: Final = 4  # for how long an alarm has had no culprit, s
BEFORE: Final = 5  # last value of the body, 3
KEPT_T: Final = 8  # when the trackers were kept last, s
KEPT_COUNT: Final = 9
TRIAD_SIZE: Final = 10

TAU: Final = 0
ALARM: Final = 1  # standard deviations of MEAN
NOISY: Final = 2  # SQUARE that is an alarm
READMIT: Final = 3
DEAD: Final = 4
STEP: Final = 5  # nominal step, s
ADAPT: Final = 6  # time constant of SCALE, s; 0: it stays one
LEARN: Final = 7  # no alarm before, s
OF_TRIAD: Final = 8  # then for each triad: variances of bias and scale at the start, and what they gain each second, 4

GOOD: Final = 0.0
SUSPECT: Final = 1.0
OUT: Final = 2.0
DEVIATES, IS_NOISY, IS_FROZEN, IS_DEAD = 1.0, 2.0, 3.0, 4.0

BECOMES_SUSPECT: Final = 0.73  # share of an alarm above which a unit is suspect: 4 of 5.5 standard deviations,
AGAIN_GOOD: Final = 0.55  # and below which it is not any more
CLEAR: Final = 0.75  # the second unit must deviate by less than this share of the first, or nothing is isolated
UNCLEAR_FOR: Final = 1.0  # where three and more units do not make it clear within this, s, it is said that they cannot
KEEP: Final = 2.0
"""The trackers are kept this often, s; where a unit is left out, those of one to two such times before count again."""
SIGNED: Final = 3.0  # squares of more than so many times the square of the mean are noise, and less a deviation
LARGEST: Final = 30.0
"""The largest innovation counts as so many standard deviations at most, so that it can be forgotten again."""
BELIEVED: Final = 6.0  # from one that is larger, nothing is learned
RARE: Final = 21.0  # minus the logarithm of the chance that a live axis says the same for so long: once in 10⁹
FAST_FROM: Final = 4  # fewest units of which the others tell the scale of the noise within `tau`


@kernel
def start_unit(x: Floats, bias_var: float, scale_var: float) -> None:
    """State of a unit's triad before its first value (UNIT_SIZE,)."""
    for k in range(UNIT_SIZE):
        x[k] = 0.0
    x[COV] = bias_var
    x[COV + 4], x[COV + 7], x[COV + 9] = scale_var, scale_var, scale_var
    for k in range(3):
        x[SQUARE + k], x[LAST + k], x[CHANGING + k] = 1.0, math.nan, 1.0


@kernel
def grow(x: Floats, bias_var: float, scale_var: float) -> None:
    """Let time pass: bias and scale walk."""
    x[COV] += bias_var
    x[COV + 4] += scale_var
    x[COV + 7] += scale_var
    x[COV + 9] += scale_var


@kernel
def gain(x: Floats, h1: float, h2: float, h3: float) -> tuple[float, float, float, float, float]:
    """P h, and hᵀ P h, of a measurement h = (1, h1, h2, h3)."""
    p = COV
    k0 = x[p] + x[p + 1] * h1 + x[p + 2] * h2 + x[p + 3] * h3
    k1 = x[p + 1] + x[p + 4] * h1 + x[p + 5] * h2 + x[p + 6] * h3
    k2 = x[p + 2] + x[p + 5] * h1 + x[p + 7] * h2 + x[p + 8] * h3
    k3 = x[p + 3] + x[p + 6] * h1 + x[p + 8] * h2 + x[p + 9] * h3
    return k0, k1, k2, k3, k0 + k1 * h1 + k2 * h2 + k3 * h3


@kernel
def shrink(x: Floats, k0: float, k1: float, k2: float, k3: float, s: float) -> None:
    """Covariance after a measurement of gain k/s."""
    p, i = COV, 1.0 / s
    x[p] -= i * k0 * k0
    x[p + 1] -= i * k0 * k1
    x[p + 2] -= i * k0 * k2
    x[p + 3] -= i * k0 * k3
    x[p + 4] -= i * k1 * k1
    x[p + 5] -= i * k1 * k2
    x[p + 6] -= i * k1 * k3
    x[p + 7] -= i * k2 * k2
    x[p + 8] -= i * k2 * k3
    x[p + 9] -= i * k3 * k3


@kernel
def body_value(
    y: Floats, axes: Floats, weight: Floats, x: Floats, h: Floats, corrected: bool, out: bool,
    a: Floats, inverse: Floats, body: Floats,
) -> int:  # fmt: skip
    """Value of the body `body` (3,) from the sensor axes y (U, 3); returns how many units took part.

    Those that are out are left out unless `out`; `corrected` takes off what the trackers know of each axis at h.
    """
    a[:, :] = 0.0
    b0, b1, b2, units = 0.0, 0.0, 0.0, 0
    for u in range(y.shape[0]):
        if x[u, STATE] == OUT and not out:
            continue
        took = 0
        for k in range(3):
            value = y[u, k]
            if math.isnan(value):
                continue
            took = 1
            if corrected:
                p = TH + 4 * k
                value -= x[u, p] + x[u, p + 1] * h[0] + x[u, p + 2] * h[1] + x[u, p + 3] * h[2]
            c0, c1, c2, w = axes[u, k, 0], axes[u, k, 1], axes[u, k, 2], weight[u, k]
            add_axis(a, c0, c1, c2, w)
            b0 += w * c0 * value
            b1 += w * c1 * value
            b2 += w * c2 * value
        units += took
    if not inverse3(a, inverse):
        return 0
    body[0], body[1], body[2] = times(inverse, b0, b1, b2)
    return units


@kernel
def middle(y: Floats, axes: Floats, x: Floats, h: Floats, room: Floats, body: Floats) -> None:
    """Middle value of the units that are in and have all three axes, of each axis of the body."""
    for j in range(3):
        count = 0
        for u in range(y.shape[0]):
            if x[u, STATE] == OUT:
                continue
            value = 0.0
            for k in range(3):
                p = TH + 4 * k
                error = x[u, p] + x[u, p + 1] * h[0] + x[u, p + 2] * h[1] + x[u, p + 3] * h[2]
                value += axes[u, k, j] * (y[u, k] - error)
            if math.isnan(value):
                continue
            at = count
            while at > 0 and room[at - 1] > value:
                room[at] = room[at - 1]
                at -= 1
            room[at] = value
            count += 1
        if count > 0:
            body[j] = 0.5 * (room[(count - 1) // 2] + room[count // 2])


@kernel
def innovate(
    x: Floats, y: Floats, axes: Floats, weight: Floats, inverse: Floats, h: Floats, scale: float, use: Floats
) -> None:
    """Take one sample of one unit (3,) against the body's value h.

    `use` gains squares of innovations over their expectation, their number, and the largest.
    """
    k0, k1, k2, k3, spread = gain(x, h[0], h[1], h[2])
    best = 0.0
    for k in range(3):
        x[INNOVATION + k] = math.nan
        if math.isnan(y[k]):
            continue
        p, noise = TH + 4 * k, scale / weight[k]
        s = spread + noise
        x[UNSURE] = spread / s
        c0, c1, c2 = axes[k, 0], axes[k, 1], axes[k, 2]
        share = weight[k] * (
            c0 * (inverse[0, 0] * c0 + 2.0 * inverse[0, 1] * c1 + 2.0 * inverse[0, 2] * c2)
            + c1 * (inverse[1, 1] * c1 + 2.0 * inverse[1, 2] * c2)
            + c2 * inverse[2, 2] * c2
        )  # what of the mean's value is this axis's own
        v = y[k] - (x[p] + x[p + 1] * h[0] + x[p + 2] * h[1] + x[p + 3] * h[2]) - (c0 * h[0] + c1 * h[1] + c2 * h[2])
        var = s + noise * share if x[STATE] == OUT else s * (1.0 - share)
        if var <= 1e-6 * noise:
            continue  # nobody else sees this direction
        e = v / math.sqrt(var)
        x[INNOVATION + k] = e
        use[2] = max(use[2], abs(e))
        if x[STATE] == GOOD and abs(e) < BELIEVED:
            use[0] += e * e
            use[1] += 1.0
            g = v / s
            x[p] += g * k0
            x[p + 1] += g * k1
            x[p + 2] += g * k2
            x[p + 3] += g * k3
            best = s if best == 0.0 else min(best, s)
    if best > 0.0:
        shrink(x, k0, k1, k2, k3, best)


@kernel
def average(x: Floats, mix: float, share: float) -> None:
    """Take the last innovations of a unit into their means, each counted by this share."""
    for k in range(3):
        e = share * x[INNOVATION + k]
        if math.isnan(e):
            continue
        x[MEAN + k] += mix * (e - x[MEAN + k])
        x[SQUARE + k] += mix * (e * e - x[SQUARE + k])


@kernel
def see_changes(x: Floats, y: Floats, changed: bool) -> None:
    """Count for how long each axis of a unit has said the same, while `changed` says that the others moved on."""
    for k in range(3):
        if math.isnan(y[k]):
            continue
        same = y[k] == x[LAST + k]
        if not same:
            x[SAME + k] = 0.0
        elif changed:
            x[SAME + k] += 1.0
        if changed and x[STATE] != OUT:
            weight = max(1.0 / (x[SAMPLES] + 1.0), 0.005)
            x[CHANGING + k] += weight * ((0.0 if same else 1.0) - x[CHANGING + k])
        x[LAST + k] = y[k]


@kernel
def is_frozen(x: Floats) -> bool:
    """True where an axis has said the same for longer than chance explains."""
    if x[SAMPLES] < 30.0:
        return False
    for k in range(3):
        live = min(max(x[CHANGING + k], 1e-4), 0.98)
        if x[SAME + k] > RARE / -math.log(1.0 - live):
            return True
    return False


@kernel
def alarm_score(x: Floats, c: Floats, spread: float, others: float) -> tuple[float, float]:
    """How far a unit is on the way to an alarm, which is 1, by its mean innovation and by their squares."""
    mean = square = 0.0
    for k in range(3):
        mean = max(mean, abs(x[MEAN + k]))
        square = max(square, x[SQUARE + k])
    if x[STATE] == OUT:  # its trackers wait, and what they do not know is the same in every sample
        spread += x[UNSURE]
    return mean / (c[ALARM] * math.sqrt(spread * others)), square / (c[NOISY] * others)


@kernel
def leave_out(x: Floats, reason: float) -> None:
    """Leave a unit out."""
    x[STATE], x[REASON], x[AGREES] = OUT, reason, 0.0


@kernel
def keep(x: Floats, g: Floats, t: float) -> None:
    """Keep the trackers of all units now and then."""
    if g[KEPT_COUNT] > 0.0 and t - g[KEPT_T] < KEEP:
        return
    g[KEPT_T] = t
    g[KEPT_COUNT] += 1.0
    for u in range(x.shape[0]):
        for k in range(12):
            x[u, KEPT + 12 + k] = x[u, KEPT + k]
            x[u, KEPT + k] = x[u, TH + k]


@kernel
def settle_others(x: Floats, g: Floats, but: int) -> None:
    """Forget what the unit that was left out has moved meanwhile: trackers of all, innovations of those that are in."""
    for u in range(x.shape[0]):
        if g[KEPT_COUNT] > 2.0 and (u == but or x[u, STATE] != OUT):
            for k in range(12):
                x[u, TH + k] = x[u, KEPT + 12 + k]
                x[u, KEPT + k] = x[u, KEPT + 12 + k]
        if u != but and x[u, STATE] != OUT:
            for k in range(3):
                x[u, MEAN + k], x[u, SQUARE + k] = 0.0, 1.0
            x[u, STATE] = GOOD


@kernel
def fault_kind(x: Floats) -> float:
    """Whether a unit deviates, with a sign that lasts, or is noisy."""
    mean = square = 0.0
    for k in range(3):
        mean = max(mean, abs(x[MEAN + k]))
        square = max(square, x[SQUARE + k])
    return IS_NOISY if square > SIGNED * mean * mean else DEVIATES


@kernel
def score_all(x: Floats, g: Floats, c: Floats) -> int:
    """Give each unit its score, against the noise that the others have; returns how many units are in."""
    total, inside = 0.0, 0
    for u in range(x.shape[0]):
        if x[u, STATE] != OUT and x[u, ABSENT] == 0.0:
            total += x[u, SQUARE] + x[u, SQUARE + 1] + x[u, SQUARE + 2]
            inside += 1
    for u in range(x.shape[0]):
        squares, rest = 0.0, inside
        if x[u, STATE] != OUT:
            squares, rest = x[u, SQUARE] + x[u, SQUARE + 1] + x[u, SQUARE + 2], inside - 1
        others = max(1.0, (total - squares) / (3.0 * rest)) if inside >= FAST_FROM else 1.0
        mean, square = alarm_score(x[u], c, g[SPREAD], others)
        x[u, SCORE] = max(mean, square)
        if x[u, STATE] != OUT or (x[u, REASON] <= IS_NOISY and x[u, SCORE] > 1.0):
            x[u, REASON] = fault_kind(x[u])
    return inside


@kernel
def suspect(x: Floats) -> None:
    """Let the trackers of a unit wait as long as it deviates."""
    if x[STATE] == GOOD and x[SCORE] > BECOMES_SUSPECT:
        x[STATE] = SUSPECT
    elif x[STATE] == SUSPECT and x[SCORE] < AGAIN_GOOD:
        x[STATE] = GOOD


@kernel
def judge(x: Floats, g: Floats, c: Floats, dt: float) -> bool:
    """Decide about each unit of a triad, x (U, UNIT_SIZE); True where units contradict and none can be isolated."""
    inside = score_all(x, g, c)
    first, best, second = -1, 0.0, 0.0
    for u in range(x.shape[0]):
        if x[u, ABSENT] > 0.0:
            continue
        if x[u, STATE] == OUT:
            readmit(x[u], c, dt)
        elif inside > 1 and is_frozen(x[u]):
            leave_out(x[u], IS_FROZEN)
            settle_others(x, g, u)
        else:
            suspect(x[u])
            if x[u, SCORE] > best:
                first, second, best = u, best, x[u, SCORE]
            else:
                second = max(second, x[u, SCORE])
    clear = inside > 2 and second <= CLEAR * best
    if best > 1.0 and clear:
        leave_out(x[first], x[first, REASON])
        settle_others(x, g, first)
    if best <= 1.0 or clear:
        g[UNCLEAR] = 0.0
        return False
    g[UNCLEAR] += dt
    unclear: bool = inside <= 2 or g[UNCLEAR] > UNCLEAR_FOR
    return unclear


@kernel
def readmit(x: Floats, c: Floats, dt: float) -> None:
    """Take a unit in again that has agreed for long enough."""
    x[AGREES] = x[AGREES] + dt if x[SCORE] < AGAIN_GOOD and not is_frozen(x) else 0.0
    if x[AGREES] > c[READMIT]:
        x[STATE], x[REASON] = GOOD, 0.0


@kernel
def note_absence(x: Floats, y: Floats, c: Floats, dt: float) -> None:
    """Count for how long each unit has had no value while others had; then it is dead."""
    for u in range(x.shape[0]):
        if math.isnan(y[u, 0]) and math.isnan(y[u, 1]) and math.isnan(y[u, 2]):
            x[u, ABSENT] += dt
            x[u, AGREES] = 0.0
            if x[u, ABSENT] > c[DEAD] and x[u, STATE] != OUT:
                leave_out(x[u], IS_DEAD)
        else:
            x[u, ABSENT] = 0.0


@kernel
def changes(x: Floats, y: Floats) -> float:
    """Share of the units whose values are not those of before."""
    moved = present = 0.0
    for u in range(y.shape[0]):
        if math.isnan(y[u, 0]) and math.isnan(y[u, 1]) and math.isnan(y[u, 2]):
            continue
        present += 1.0
        for k in range(3):
            if not math.isnan(y[u, k]) and y[u, k] != x[u, LAST + k]:
                moved += 1.0
                break
    return moved / max(present, 1.0)


@kernel
def adapt(g: Floats, c: Floats, dt: float, use: Floats) -> None:
    """Learn the scale of the noise from squares over their expectation."""
    if c[ADAPT] > 0.0 and use[1] > 0.0:
        weight = max(dt / c[ADAPT], 1.0 / (20.0 + g[COUNT]))
        g[SCALE] = max(1e-3, g[SCALE] * (1.0 + min(weight, 1.0) * (min(use[0] / use[1], 10.0) - 1.0)))


@kernel
def take_triad(
    t: float, triad: int, x: Floats, g: Floats, c: Floats, y: Floats, axes: Floats, weight: Floats,
    a: Floats, inverse: Floats, h: Floats, body: Floats, use: Floats, room: Floats,
) -> int:  # fmt: skip
    """Take one sample of a triad of all units (U, 3); the body's value goes to `body`, and what is wrong is returned.

    Returns
    -------
    int
        Flags of the row.
    """
    units = body_value(y, axes, weight, x, h, False, False, a, inverse, h)
    everyone = units == 0  # better all than nothing
    if everyone:
        units = body_value(y, axes, weight, x, h, False, True, a, inverse, h)
    if units == 0:
        body[0] = body[1] = body[2] = math.nan
        return 0
    dt = c[STEP] if g[COUNT] == 0.0 else t - g[LAST_T]
    g[LAST_T] = t
    g[COUNT] += 1.0
    body_value(y, axes, weight, x, h, True, everyone, a, inverse, body)
    h[0], h[1], h[2] = body[0], body[1], body[2]
    mix = 1.0 - math.exp(-dt / c[TAU])
    g[SPREAD] = (1.0 - mix) * (1.0 - mix) * g[SPREAD] + mix * mix
    at, moved = OF_TRIAD + 4 * triad, changes(x, y)
    use[0] = use[1] = use[2] = 0.0
    note_absence(x, y, c, dt)
    for u in range(y.shape[0]):
        grow(x[u], c[at + 2] * dt, c[at + 3] * dt)
        if x[u, ABSENT] == 0.0:
            innovate(x[u], y[u], axes[u], weight[u], inverse, h, g[SCALE], use)
            see_changes(x[u], y[u], moved > 0.5)
            x[u, SAMPLES] += 1.0
    share = min(1.0, LARGEST / max(use[2], 1.0))  # of all units alike: who deviates most must stay so
    for u in range(y.shape[0]):
        if x[u, ABSENT] == 0.0:
            average(x[u], mix, share)
    adapt(g, c, dt, use)
    keep(x, g, t)
    unclear = c[STEP] * g[COUNT] > c[LEARN] and judge(x, g, c, dt)
    found_flags = flags.CANNOT_ISOLATE if unclear else 0
    if unclear and units > 2:
        middle(y, axes, x, h, room, body)
    for u in range(y.shape[0]):
        if x[u, STATE] == OUT:
            found_flags |= flags.UNIT_EXCLUDED
        elif x[u, STATE] == SUSPECT:
            found_flags |= flags.UNIT_SUSPECT
    return found_flags


@kernel
def take_lever(y: Floats, axes: Floats, levers: Floats, w: Floats, turn: Floats) -> None:
    """Take off what turning makes an accelerometer at a lever feel, of all units (U, 3), in place."""
    size = w[0] * w[0] + w[1] * w[1] + w[2] * w[2]
    for u in range(y.shape[0]):
        r0, r1, r2 = levers[u, 0], levers[u, 1], levers[u, 2]
        along = w[0] * r0 + w[1] * r1 + w[2] * r2
        f0 = turn[1] * r2 - turn[2] * r1 + w[0] * along - size * r0
        f1 = turn[2] * r0 - turn[0] * r2 + w[1] * along - size * r1
        f2 = turn[0] * r1 - turn[1] * r0 + w[2] * along - size * r2
        for k in range(3):
            y[u, k] -= axes[u, k, 0] * f0 + axes[u, k, 1] * f1 + axes[u, k, 2] * f2


@kernel
def take_rows(
    t: Floats, y: Floats, x: Floats, g: Floats, c: Floats, axes: Floats, weight: Floats, levers: Floats, leans: bool,
    a: Floats, inverse: Floats, h: Floats, use: Floats, room: Floats, body: Floats, words: NDArray[np.uint32],
    row_flags: NDArray[np.uint32],
) -> None:  # fmt: skip
    """Take samples y (N, triads, U, 3), which it may change; gives values of the body (N, triads, 3) and words (N, U).

    A word has the state of each triad; see `state_word`.
    """
    for i in range(t.shape[0]):
        said = 0
        for triad in range(3):
            if triad == 1 and leans:
                rate = g[0]
                since = t[i] - rate[LAST_T]  # zero where this row has a rate
                if rate[COUNT] > 1.0 and since == 0.0:
                    take_lever(y[i, 1], axes, levers, h[0], h[3])
            before = g[triad, LAST_T]
            said |= take_triad(
                t[i], triad, x[triad], g[triad], c, y[i, triad], axes, weight[triad], a, inverse, h[triad],
                body[i, triad], use, room,
            )  # fmt: skip
            if triad == 0:
                step = t[i] - before
                for k in range(3):
                    has_step = g[0, COUNT] > 1.0 and step > 0.0
                    h[3, k] = (h[0, k] - g[0, BEFORE + k]) / step if has_step else 0.0
                    g[0, BEFORE + k] = h[0, k]
        row_flags[i] |= said
        for u in range(y.shape[2]):
            words[i, u] = state_word(x[0, u], 0) | state_word(x[1, u], 1) | state_word(x[2, u], 2)


@kernel
def state_word(x: Floats, triad: int) -> int:
    """State of a unit's triad: 0 good, 1 suspect, 2 deviates, 3 noisy, 4 frozen, 5 dead, in four bits at 4 × triad."""
    state = 0
    if x[STATE] == SUSPECT:
        state = 1
    elif x[STATE] == OUT:
        state = 1 + int(x[REASON])
    return state << (4 * triad)
