"""Whose axes are wrong: how magnetometer, accelerometer and gyroscope are arranged, by what they see of a motion.

A triad with wrong axes measures ``P v`` of a vector v in the axes of the case, P one of the 48 signed permutations, of
which 24 are left-handed. Three pairs of triads tell of it, whatever the attitudes were:

* The field keeps one dip: ``(A u) · X P h`` is constant over all attitudes only for ``X = ± A Pᵀ``, u the vertical, h
  the field, A and P the arrangements of accelerometer and magnetometer. The sign is that of the dip.
* Field and vertical are constant in space, so they turn in the body as the rates say: ``P h`` as by the rates
  ``det(P) P Gᵀ`` of the measured ones, G the arrangement of the gyroscope, and ``A u`` as by ``det(A) A Gᵀ``. All axes
  of a triad that is not the gyroscope may be negated, and nothing shows.

Turned back by the rates over some seconds, the means of field and specific force stay where they are; what pushes a
unit by hand averages out there. Two triads that agree convict the third; of two alone, one is wrong. All of it is a
choice among few arrangements, so hard and soft iron of tens of percents do no harm, and what a capture does not tell is
left open.

Whether a measured field turns as a gyroscope says: a mirrored or wrongly turned magnetometer does not.

A field that is constant in space changes in the axes of the unit as ``du/dt = −ω × u``. Both sides are integrated over
a tenth of a second, which no noise has to be differentiated for, and the change is regressed on what the rates predict.
"""

from collections.abc import Sequence
from operator import attrgetter
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbob.core.check import Floats
from plumbob.rotations import dcm_from_quat, every_axes, quat_chained, skew

# Of the measured change on the predicted one: a wrong sign of one axis makes −1/3 where all axes turn alike.
LEAST_SLOPE: Final = 0.5

MOST_UNKNOWN: Final = 0.05  # standard deviation beyond which a regression tells nothing
_WINDOW: Final = 0.1
_LONGEST: Final = 0.3
_CHUNK: Final = 20_000


class Agreement(NamedTuple):
    """How the field's change agrees with the one that the rates predict."""

    slope: float  # of the one on the other
    rate_bias: Floats  # (3,), of the rates, rad/s
    turn: Floats | None  # (3, 3), from the gyroscope's axes to those of a calibrated field; None where nothing shows it


def agreement(t: Floats, mag: Floats, gyr: Floats) -> Agreement | None:
    """Agreement of field and rates; None where the capture does not tell.

    Neither field nor rates (N, 3) need be calibrated: constant biases of both are found too. Rows with NaN do not
    count.
    """
    rows, change = _equations(t, mag, gyr)
    along = rows[:, :, [0, 4, 8]].sum(axis=2)
    columns = np.concatenate((along[:, :, np.newaxis], rows[:, :, 9:]), axis=2)
    solution = _solution(columns, change)
    if solution is None or solution[1][0] > MOST_UNKNOWN:
        return None
    gain, rotation = _solution(rows[:, :, :12], change), None
    if gain is not None and gain[1][:9].max() <= MOST_UNKNOWN:
        u, _, vt = np.linalg.svd(gain[0][:9].reshape(3, 3))
        rotation = u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt
    return Agreement(float(solution[0][0]), np.asarray(-solution[0][1:4] / solution[0][0]), rotation)


def _equations(t: Floats, mag: Floats, gyr: Floats) -> tuple[Floats, Floats]:
    """Derivatives (n, 3, 18) of the change of each window, and the change (n, 3).

    Columns: gain of the rates, row by row; their bias; hard iron; the product of both biases.
    """
    valid = np.isfinite(mag).all(axis=1) & np.isfinite(gyr).all(axis=1)
    if not valid.any():
        return np.zeros((0, 3, 18)), np.zeros((0, 3))
    t, mag, gyr = t[valid], mag[valid], gyr[valid]
    size = max(1, round(_WINDOW / float(np.median(np.diff(t))))) if len(t) > 1 else 1
    step = size * max(1, _CHUNK // size)
    rows, changes = list[Floats](), list[Floats]()
    for start in range(0, len(t), step):
        count = (min(step + 1, len(t) - start) - 1) // size
        edges = start + np.arange(count + 1) * size
        gapless = np.diff(t[edges]) <= _LONGEST
        of = slice(start, int(edges[-1]) + 1)
        by_field, by_rate = skew(mag[of]), skew(gyr[of])
        gain = (by_field[:, :, :, np.newaxis] * gyr[of, np.newaxis, np.newaxis, :]).reshape(-1, 3, 9)
        constant = np.broadcast_to(np.eye(3), by_field.shape)
        at = np.concatenate((gain, by_field, by_rate, constant), axis=2)  # the change of the field per second
        each = 0.5 * (at[1:] + at[:-1]) * np.diff(t[of])[:, np.newaxis, np.newaxis]
        rows.append(each.reshape(count, size, 3, at.shape[2]).sum(axis=1)[gapless])
        changes.append(np.diff(mag[edges], axis=0)[gapless])
    return np.concatenate(rows), np.concatenate(changes)


def _solution(columns: Floats, change: Floats) -> tuple[Floats, Floats] | None:
    """Solution and its standard deviations; None where the columns do not tell it."""
    rows, right = columns.reshape(-1, columns.shape[2]), change.ravel()
    scale = np.linalg.norm(rows, axis=0)
    if len(right) <= 2 * rows.shape[1] or not np.all(scale > 0.0):
        return None
    scaled = rows / scale
    normal = scaled.T @ scaled
    if np.linalg.cond(normal) > 1.0 / np.finfo(np.float64).eps:
        return None
    solution = np.linalg.solve(normal, scaled.T @ right)
    residual = right - scaled @ solution
    variance = float(residual @ residual) / (len(right) - len(solution))
    return solution / scale, np.sqrt(variance * np.diag(np.linalg.inv(normal))) / scale


CLEARLY: Final = 3.0  # times the least squares that an arrangement must leave to be excluded
QUIET: Final = 0.05  # departure of the specific force from its usual length, of itself, up to which it is the vertical
FEWEST_DIRECTIONS: Final = 14  # fewest samples in which a dip is looked for
SPAN: Final = 4.0  # s over which vectors are turned back: pushes average out, and a gyroscope errs by few degrees
_KEPT: Final = 0.3  # scatter of the field along the vertical, of its size, beyond which nothing keeps a dip
_LEAST: Final = 0.1  # scatter that iron may make
_SOME: Final = 5000
_PARTS: Final = 4  # of a window
_GAPS: Final = 1.2  # times the time that a window should take
_FEWEST_WINDOWS: Final = 4
_WINDOWS: Final = 60
_FOLLOWED: Final = 0.2  # squares, of the vectors', beyond which nothing turns as the rates say
_LEAST_SQUARES: Final = 1e-3  # which errors of 3 % may leave
_TINY: Final = 1e-300
_ROUNDS: Final = 3  # until the bias is settled
_SAME: Final = np.eye(3)
_TURNS: Final = tuple(way for way in every_axes() if np.linalg.det(way) > 0.0)


class Suspect(NamedTuple):
    """A triad whose axes are wrong."""

    triad: str  # "mag", "acc" or "gyr"
    # (3, 3), Its arrangement: measured = way @ true. Of magnetometer and accelerometer, the opposite says the same but
    # for the sign of the dip, and the right-handed one is given.
    way: Floats
    beside: str  # the triad that it is held against; of two, one
    sure: bool  # whether two other triads agree, so that it cannot be one of them


class Arrangements(NamedTuple):
    """Arrangement that each pair of triads shows, None where it shows none or several; two of them tell the third."""

    dip: Floats | None  # (3, 3), ``± P Aᵀ``, of which the right-handed one stands for both
    field: Floats | None  # (3, 3), ``det(P) P Gᵀ``
    force: Floats | None  # (3, 3), ``det(A) A Gᵀ``


def arrangements(t: Floats, mag: Floats, *, acc: Floats, gyr: Floats) -> Arrangements:
    """What the pairs of triads tell of their axes, calibrated or not; rows with NaN do not count."""
    ways = [_keeping_dip(mag, acc)]
    rows = _windows(t, np.flatnonzero(np.isfinite(gyr).all(axis=1)))
    # no hand pushes the field, so it tells the bias of the rates and their sense, by which the force is turned back
    bias, turned, fits = np.zeros(3), list[_TurnedBack](), list[_Followed]()
    for _ in range(_ROUNDS if len(rows) >= _FEWEST_WINDOWS else 0):
        turned = [_turned_by(t, gyr - bias, rows, sense) for sense in (1.0, -1.0)]
        fits = [fit for back in turned for fit in _way_fits(back, mag, _TURNS, offset=True)]
        bias = bias + min(fits, key=attrgetter("misfit")).bias if fits else bias
    ways.append(_not_excluded(fits))
    senses = {float(np.linalg.det(way)) for way in ways[1]} or {1.0, -1.0}
    by_force = [fit for back in turned if back.sense in senses for fit in _way_fits(back, acc, _TURNS, offset=False)]
    ways.append(_not_excluded(by_force))
    dip, field, force = (each[0] if len(each) == 1 else None for each in ways)
    if field is not None and force is not None:
        dip = field @ force.T
    elif dip is not None and force is not None:
        field = dip @ force
    elif dip is not None and field is not None:
        force = dip.T @ field
    return Arrangements(dip, field, force)


def wander(t: Floats, field: Floats, gyr: Floats) -> float | None:
    """Root mean square angle, rad, by which a calibrated field, turned back by the rates, wanders over `SPAN`.

    A constant bias of the rates is found; None where there are not enough samples.
    """
    rows = _windows(t, np.flatnonzero(np.isfinite(gyr).all(axis=1)))
    bias, misfit = np.zeros(3), None
    for _ in range(_ROUNDS if rows.size else 0):
        fits = _way_fits(_turned_by(t, gyr - bias, rows, 1.0), field, [_SAME], offset=False)
        bias, misfit = (bias + fits[0].bias, fits[0].misfit) if fits else (bias, None)
    return None if misfit is None else float(np.sqrt(misfit))


def suspects(found: Arrangements) -> tuple[Suspect, ...]:
    """Triads whose axes are wrong; none where they are right, or the capture does not tell."""
    dip, field, force = found
    if dip is None:
        return () if field is None or np.array_equal(_SAME, field) else (_by_turn_alone(field),)
    if field is None or force is None:
        return () if np.array_equal(_SAME, dip) else (Suspect("mag", dip, "acc", sure=False),)
    if np.array_equal(_SAME, field):
        return () if np.array_equal(_SAME, force) else (Suspect("acc", dip.T, "mag", sure=True),)
    if np.array_equal(_SAME, dip):
        return (Suspect("gyr", field.T, "acc", sure=True),)
    if np.array_equal(_SAME, force):
        return (Suspect("mag", dip, "acc", sure=True),)
    return (Suspect("mag", dip, "acc", sure=False), Suspect("gyr", force.T, "acc", sure=False))


def _by_turn_alone(field: Floats) -> Suspect:
    """Suspect by field and rates: only a gyroscope makes the one left-handed against the other."""
    if np.linalg.det(field) < 0.0:
        return Suspect("gyr", field.T, "mag", sure=False)
    return Suspect("mag", field, "gyr", sure=False)


def _keeping_dip(mag: Floats, acc: Floats) -> tuple[Floats, ...]:
    """Right-handed arrangements of the magnetometer in which the field (N, 3) keeps one angle to the vertical."""
    size = np.linalg.norm(acc, axis=1)
    valid = np.isfinite(mag).all(axis=1) & np.isfinite(size)
    if valid.any():
        usual = float(np.median(size[valid]))
        valid[valid] = np.abs(size[valid] - usual) <= QUIET * usual
    count = int(np.count_nonzero(valid))
    if count < FEWEST_DIRECTIONS or not size[valid].all():
        return ()
    step = -(-count // _SOME)
    mag, up = mag[valid][::step], (acc[valid] / size[valid, np.newaxis])[::step]
    mag = mag - mag.mean(axis=0)
    strength = float(np.mean(np.sum(mag * mag, axis=1)))
    rows = np.column_stack((np.ones(len(up)), up))  # hard iron is along the vertical as that turns
    share = (len(up) - rows.shape[1]) * strength
    along = np.sum(up[:, np.newaxis] * (mag @ np.array(_TURNS)).swapaxes(0, 1), axis=2)
    off = along - rows @ np.linalg.lstsq(rows, along, rcond=None)[0]
    fits = list(zip(_TURNS, (np.sum(off * off, axis=0) / share).tolist(), strict=True))
    return _not_excluded(fits, _KEPT**2, _LEAST**2)


class _TurnedBack(NamedTuple):
    """Samples of a capture, W windows of four parts with n samples each, turned back by rates of one sense."""

    rows: NDArray[np.intp]  # (W, 4, n), the samples
    sense: float  # 1.0 for the rates as measured, −1.0 for their opposite, as left-handed axes make them
    turns: Floats  # (W, 4, n, 3, 3), attitudes, against a start that does not matter
    by_bias: Floats  # (W, 4, n, 3, 3), turn since the window's start by a bias of 1, s


class _Followed(NamedTuple):
    """An arrangement of a gyroscope's axes, the squares that it leaves, of all, and the bias of the rates, rad/s."""

    way: Floats
    misfit: float
    bias: Floats


def _not_excluded(
    fits: Sequence[tuple[Floats, float] | _Followed], most: float = _FOLLOWED, least: float = _LEAST_SQUARES
) -> tuple[Floats, ...]:
    """Ways that leave not clearly more than the best one, best first; none where that leaves too much."""
    order = np.argsort([fit[1] for fit in fits], kind="stable").tolist()
    if not order or not fits[order[0]][1] <= most:
        return ()
    limit = max(CLEARLY * fits[order[0]][1], least)
    return tuple(fits[i][0] for i in order if fits[i][1] <= limit)


def _windows(t: Floats, samples: NDArray[np.intp]) -> NDArray[np.intp]:
    """Samples (W, 4, n) of windows without gaps, spread over the capture."""
    if len(samples) < 2:
        return np.zeros((0, _PARTS, 1), dtype=np.intp)
    size = max(1, round(SPAN / _PARTS / float(np.median(np.diff(t[samples])))))
    windows = samples[: len(samples) // (_PARTS * size) * _PARTS * size].reshape(-1, _PARTS, size)
    windows = windows[t[windows[:, -1, -1]] - t[windows[:, 0, 0]] < _GAPS * SPAN]
    return windows[:: 1 + len(windows) // _WINDOWS]


def _turned_by(t: Floats, rates: Floats, rows: NDArray[np.intp], sense: float) -> _TurnedBack:
    flat = rows.ravel()
    step = np.diff(t[flat])[:, np.newaxis]
    turns = dcm_from_quat(quat_chained(0.5 * sense * (rates[flat[1:]] + rates[flat[:-1]]) * step))
    each = 0.5 * (turns[1:] + turns[:-1]) * step[:, :, np.newaxis]
    by_bias = np.concatenate((np.zeros((1, 3, 3)), np.cumsum(each, axis=0))).reshape(*rows.shape, 3, 3)
    return _TurnedBack(rows, sense, turns.reshape(by_bias.shape), by_bias - by_bias[:, :1, :1])


def _way_fits(turned: _TurnedBack, vectors: Floats, ways: Sequence[Floats], *, offset: bool) -> list[_Followed]:
    some = vectors[turned.rows]
    valid = np.asarray(np.isfinite(some).all(axis=3))
    full = np.flatnonzero(np.all(valid.any(axis=2), axis=1))
    if full.size < _FEWEST_WINDOWS:
        return []
    some, valid, turns, by_bias = some[full], valid[full], turned.turns[full], turned.by_bias[full]
    middle = some[valid].mean(axis=0) if offset else np.zeros(3)
    some = np.where(valid[..., np.newaxis], some - middle, 0.0)
    share = valid / valid.sum(axis=2, keepdims=True)
    turns = turns * share[..., np.newaxis, np.newaxis]
    products = np.einsum("wpnij,wpnk->wpijk", turns, some)
    turns, by_bias = turns.sum(axis=2), np.einsum("wpn,wpnij->wpij", share, by_bias)
    fits = []
    for way in ways:
        back = np.einsum("wpijk,kj->wpi", products, way)
        columns = np.concatenate((skew(back) @ by_bias, turns), axis=3) if offset else skew(back) @ by_bias
        about, columns = (each - each.mean(axis=1, keepdims=True) for each in (back, columns))  # means of windows
        rows, values = columns.reshape(-1, columns.shape[3]), about.ravel()
        step = np.asarray(np.linalg.lstsq(rows, values, rcond=None)[0])
        off = values - rows @ step
        share_left = float(off @ off) / max(float(np.sum(back * back)), _TINY)
        fits.append(_Followed(turned.sense * way, share_left, -turned.sense * step[:3]))
    return fits
