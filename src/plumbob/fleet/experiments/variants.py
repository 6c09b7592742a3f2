"""Recordings made harder in a stated way, to see what an estimate loses by it: the same change to every recording.

Each change takes samples and returns others; what is drawn comes from a seed. Motion begins where the rate,
averaged over a second, first exceeds `MOVING`.
"""

from collections.abc import Callable, Mapping
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbob.core.check import Floats
from plumbob.core.errors import ParameterError, ShapeError, UnitError, unknown_name
from plumbob.core.units import Quantity, dps, parse, split, to_dps
from plumbob.data import AttitudeTrack, ImuData
from plumbob.data.reading import read_at
from plumbob.rotations import quat_conjugate, quat_rotate

SEED: Final = 1
MOVING: Final = dps(20.0)  # a unit is in motion at rates above this, rad/s
MARGIN: Final = 10.0  # gaps begin this long after the motion begins, and before the recording ends, s
ACC_EVERY, MAG_EVERY = 2, 5  # asynchronous stamps: specific forces between the rates, and every fifth row a field


def turning(imu: ImuData) -> Floats:
    """Size of the rate, averaged over a second around each sample, (N,), rad/s."""
    size = np.linalg.norm(np.nan_to_num(imu.usable("gyr")), axis=1)
    count = max(1, round(1.0 / float(np.median(np.diff(imu.t)))))
    mean: Floats = np.convolve(size, np.full(count, 1.0 / count), "same")[: size.size]
    return mean


def motion_begins(imu: ImuData) -> float:
    """Time at which a recording's motion begins, s."""
    moving = turning(imu) > MOVING
    if not moving.any():
        raise ShapeError(f"there is no motion in it: the mean rate of a second never exceeds {to_dps(MOVING):.0f} °/s.")
    return float(imu.t[np.argmax(moving)])


class _Change(NamedTuple):
    """What a change is made of: the reference, how much as text with a unit, and the seed."""

    reference: AttitudeTrack
    text: str
    seed: int

    def number(self, quantity: Quantity) -> float:
        return parse(self.text, quantity)


def _late_start(imu: ImuData, change: _Change) -> ImuData:
    """Without all before a time after the motion begins."""
    after = change.number(Quantity.TIME)
    first = int(np.searchsorted(imu.t, motion_begins(imu) + after))
    if first >= len(imu) - 1:
        raise ShapeError(f"it ends less than {after:g} s after its motion begins.")
    return imu[first:]


def _gaps(imu: ImuData, change: _Change) -> ImuData:
    """Without the samples of some stretches of one length, at times drawn from the motion."""
    count, _, text = change.text.partition("x")
    if not count.strip().isdigit() or not text:
        raise ParameterError(f"gaps needs their number and length, as 5x1s, but got '{change.text}'.")
    length = parse(text, Quantity.TIME)
    low, high = motion_begins(imu) + MARGIN, float(imu.t[-1]) - MARGIN
    if not low < high:
        raise ShapeError(f"it is too short for gaps: they lie {MARGIN:g} s from the start and the end of its motion.")
    keep = np.ones(len(imu), dtype=np.bool_)
    for begin in np.random.default_rng(change.seed).uniform(low, high, int(count)):
        keep &= ~((imu.t > begin) & (imu.t < begin + length))
    triads = {name: getattr(imu, name)[keep] for name in imu.triads}
    temp_c = None if imu.temp_c is None else imu.temp_c[keep]
    return ImuData(t=imu.t[keep], **triads, temp_c=temp_c, flags=imu.flags[keep], meta=imu.meta)


def _wrong_field(imu: ImuData, change: _Change) -> ImuData:
    """With fields that are constant in the reference's frame for a time; nothing where it is not known."""
    for part in change.text.split(";"):
        field, _, when = part.partition(":")
        when, _, since = when.partition("@")
        begin, _, end = when.partition("-")
        if not end or since.strip() not in {"", "motion"}:
            raise ParameterError(
                f"wrong_field needs field and times, as '15,-10,20uT:0s-20s', or '...:30s-90s@motion' where they count "
                f"from the start of the motion, but got '{change.text}'."
            )
        zero = motion_begins(imu) if since else float(imu.t[0])
        vector, (first, last) = _vector(field, Quantity.FIELD), (zero + parse(t, Quantity.TIME) for t in (begin, end))
        rows = (imu.t >= first) & (imu.t < last)
        q_nb = read_at(change.reference, imu.t_ns[rows]).q_nb
        mag = _triad(imu, "mag").copy()
        mag[rows] += np.nan_to_num(quat_rotate(quat_conjugate(q_nb), np.broadcast_to(vector, (len(q_nb), 3))))
        imu = imu.corrected(meta=imu.meta, mag=mag)
    return imu


def _block_means(imu: ImuData, change: _Change) -> ImuData:
    """At about a lower rate: means of whole blocks, each with the stamp of its last sample."""
    rate = change.number(Quantity.FREQUENCY)
    size = round(1.0 / (rate * float(np.median(np.diff(imu.t)))))
    if size < 2:
        raise ShapeError(f"its own rate is too low for means at {rate:g} Hz.")
    last = np.arange(size - 1, len(imu), size)
    blocks = {name: _triad(imu, name)[: last.size * size].reshape(-1, size, 3).mean(axis=1) for name in imu.triads}
    flags = np.bitwise_or.reduce(imu.flags[: last.size * size].reshape(-1, size), axis=1)
    return ImuData(t=imu.t[last], **blocks, flags=flags, meta=imu.meta)


def without_mag(imu: ImuData) -> ImuData:
    """Without a magnetometer."""
    return ImuData(t=imu.t, gyr=imu.gyr, acc=imu.acc, temp_c=imu.temp_c, flags=imu.flags, meta=imu.meta)


def _asynchronous(imu: ImuData, _: _Change) -> ImuData:
    """With rates and specific forces in alternate rows, and a field in every fifth, as of sensors with own clocks."""
    row = np.arange(len(imu))
    odd = row % ACC_EVERY == 1
    return _absent(imu, {"gyr": odd, "acc": ~odd, "mag": row % MAG_EVERY != 0})


def _missing(imu: ImuData, change: _Change) -> ImuData:
    """Without the values of a share of the rows, drawn row by row; their stamps stay."""
    lost = np.random.default_rng(change.seed).random(len(imu)) < change.number(Quantity.RATIO)
    return _absent(imu, dict.fromkeys(imu.triads, lost))


def _absent(imu: ImuData, lost: Mapping[str, NDArray[np.bool_]]) -> ImuData:
    triads = {name: np.where(lost[name][:, np.newaxis], np.nan, getattr(imu, name)) for name in imu.triads}
    return imu.corrected(meta=imu.meta, **triads)


def _with_offset(imu: ImuData, name: str, offset: Floats) -> ImuData:
    """With a constant in body axes (3,) added to a triad: a bias of the gyroscope, a hard iron."""
    return imu.corrected(meta=imu.meta, **{name: _triad(imu, name) + offset})


def _triad(imu: ImuData, name: str) -> Floats:
    if name not in imu.triads:
        raise ShapeError(f"it has no {name} that could be changed, only {', '.join(imu.triads)}.")
    return imu.usable(name)


def _vector(text: str, quantity: Quantity) -> Floats:
    """Three numbers before one unit, as '15,-10,20uT', or one for all axes."""
    parts = text.split(",")
    unit = split(parts[-1])[1]
    values = [parse(part if i == len(parts) - 1 else f"{part}{unit}", quantity) for i, part in enumerate(parts)]
    if len(values) not in {1, 3}:
        raise UnitError(
            f"'{text}' has {len(values)} numbers, but one for each axis, as 2,-2,2dps, or one for all goes."
        )
    return np.broadcast_to(np.array(values), 3)


# By name, in the order in which they are made: first what happens to the body, then to its samples.
_CHANGES: Final[Mapping[str, Callable[[ImuData, _Change], ImuData]]] = {
    "start": _late_start,
    "wrong_field": _wrong_field,
    "hard_iron": lambda imu, change: _with_offset(imu, "mag", _vector(change.text, Quantity.FIELD)),
    "scale": lambda imu, change: imu.corrected(
        meta=imu.meta, gyr=_triad(imu, "gyr") * (1.0 + change.number(Quantity.RATIO))
    ),
    "bias": lambda imu, change: _with_offset(imu, "gyr", _vector(change.text, Quantity.RATE)),
    "no_mag": lambda imu, _: without_mag(imu),
    "gaps": _gaps,
    "rate": _block_means,
    "asynchronous": _asynchronous,
    "missing": _missing,
}
CHANGES: Final = tuple(_CHANGES)


def changed(imu: ImuData, reference: AttitudeTrack, changes: Mapping[str, str], *, seed: int = SEED) -> ImuData:
    """Samples with changes made by their names: how much as text with a unit, as ``{"gaps": "5x1s"}``.

    A wrong field is constant in the frame of the `reference`; what is drawn comes from the seed.
    """
    if unknown := changes.keys() - _CHANGES.keys():
        raise unknown_name("change", min(unknown), CHANGES)
    for name, make in _CHANGES.items():
        if name in changes:
            imu = make(imu, _Change(reference, changes[name], seed))
    return imu
