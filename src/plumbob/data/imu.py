"""The two central types: what sensors said, and what an attitude was or is believed to be.

Both are frozen, hold read-only C-contiguous float64 arrays, and are validated once, when they are made. Arrays that
somebody could still write to are copied; to hand over large ones without a copy, set ``array.flags.writeable = False``.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import MISSING, dataclass, field, fields, replace
from numbers import Integral, Real
from typing import Any, Self, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from plumbob.core import check, flags
from plumbob.core.check import Floats
from plumbob.core.constants import G0, IMPOSSIBLE_ACCELERATION, IMPOSSIBLE_FIELD, IMPOSSIBLE_RATE
from plumbob.core.errors import ClockError, ShapeError, UnitError
from plumbob.core.series import Series
from plumbob.core.time import is_gap, to_ns, to_s
from plumbob.core.units import to_deg
from plumbob.data.sample import UNITS, ImuSample
from plumbob.rotations import Frame, North, body_axes, euler_zyx_from_quat

Half = tuple[float, ...]
Made = TypeVar("Made")
TRIADS = ("gyr", "acc", "mag")
TITLES = {"gyr": "gyroscope", "acc": "accelerometer", "mag": "magnetometer"}
UNCALIBRATED = "NONE: these sensor values are uncalibrated"
"""What stands in every output about sensor values that no calibration card has been applied to."""

BLOCK = 1 << 14  # Samples that are looked at together where a recording is judged as a whole

ENOUGH = 100  # Fewest samples by whose typical size a recording's units are judged

TRIAD_FLAGS = {
    "gyr": (flags.GYR_ABSENT, flags.GYR_CLIPPED, flags.GYR_INVALID),
    "acc": (flags.ACC_ABSENT, flags.ACC_CLIPPED, flags.ACC_INVALID),
    "mag": (flags.MAG_ABSENT, flags.MAG_CLIPPED, flags.MAG_INVALID),
}
"""By triad: the flags that say absent, clipped and invalid."""
_IMPOSSIBLE = {"gyr": IMPOSSIBLE_RATE, "acc": IMPOSSIBLE_ACCELERATION, "mag": IMPOSSIBLE_FIELD}
_SI = {"gyr": "rad/s", "acc": "m/s²", "mag": "µT"}

Range = float | tuple[float, float, float] | None
"""Full scale of a triad: one number for all its axes, one for each, or not known."""


@dataclass(frozen=True, slots=True)
class ImuMeta:
    """What is known about a recording besides its numbers.

    Attributes
    ----------
    device : str
        Name of the sensor unit.
    gyr_range, acc_range, mag_range : float or tuple of 3 floats or None
        Full scale of each triad, rad/s, m/s², µT; of each body axis where they differ. Values at it are flagged as
        clipped.
    rate_nominal : float or None
        Sampling rate as configured, Hz; for display only, mathematics uses the measured steps.
    t0_ns : int
        UTC of t = 0, ns since 1970; 0 where unknown.
    axes : str
        How the body axes lie in the sensor case, as in `plumbob.rotations.body_axes`.
    frame : Frame or None
        Navigation frame that attitudes of this recording are meant in, where someone said so.
    north : North or None
        What headings of this recording's reference count from, where known.
    declination : float or None
        Magnetic declination at the place, east positive, rad, from −π to π, where known.
    calibration : str or None
        Name of the calibration card that has been applied; None says uncalibrated.
    gyr_left, acc_left, mag_left : tuple of 78 floats or None
        What errors the calibration leaves, as `plumbob.data.cards.residuals` has it, of a gyroscope perhaps 120; None:
        nothing of a calibrated recording, and of an uncalibrated one all that the data sheet of a common part allows.
        Of a gyroscope, whose errors are estimated, None says that nothing is known.
    unit_check : bool
        Refuse a recording whose typical size does not fit its units. Switch off for a centrifuge or a drop tower; it is
        off where a format said the units.
    """

    device: str = "unknown"
    gyr_range: Range = None
    acc_range: Range = None
    mag_range: Range = None
    rate_nominal: float | None = None
    t0_ns: int = 0
    axes: str = "x y z"
    frame: Frame | None = None
    north: North | None = None
    declination: float | None = None
    calibration: str | None = None
    gyr_left: Half | None = field(default=None, repr=False)
    acc_left: Half | None = field(default=None, repr=False)
    mag_left: Half | None = field(default=None, repr=False)
    unit_check: bool = True

    def __post_init__(self) -> None:
        """Validate ranges and names."""
        for name in TRIADS:
            if (full_scale := getattr(self, f"{name}_range")) is not None:
                object.__setattr__(self, f"{name}_range", _checked_range(name, full_scale))
            if (half := getattr(self, f"{name}_left")) is not None:
                object.__setattr__(self, f"{name}_left", _checked_half(f"{name}_left", half))
        if self.rate_nominal is not None and not 0.0 < check.number("rate_nominal", self.rate_nominal, "Hz") < np.inf:
            raise ShapeError(f"rate_nominal must be a positive number of Hz, or None, but it is {self.rate_nominal}.")
        for name, kind in (("frame", Frame), ("north", North)):
            if getattr(self, name) is not None:
                object.__setattr__(self, name, kind.parse(getattr(self, name)))
        if not isinstance(self.t0_ns, Integral) or isinstance(self.t0_ns, bool):
            raise ShapeError(f"t0_ns must be an int, UTC in ns since 1970, but it is {self.t0_ns!r}.")
        object.__setattr__(self, "t0_ns", int(self.t0_ns))
        if (angle := self.declination) is not None:
            if not isinstance(angle, Real) or isinstance(angle, bool):
                raise ShapeError(
                    f"declination must be a number in rad, or None, but it is {angle!r}; use units.deg(...)."
                )
            if not abs(float(angle)) <= np.pi:
                raise UnitError(
                    f"declination must be an angle in rad from −π to π, but it is {angle}; use units.deg(...)."
                )
            object.__setattr__(self, "declination", float(angle))
        body_axes(self.axes)

    @property
    def left(self) -> tuple[Half, Half]:
        """What errors are left of accelerometer and magnetometer, as far as is known."""
        from plumbob.data.cards.residuals import NOTHING, uncalibrated

        acc, mag = (uncalibrated("acc"), uncalibrated("mag")) if self.calibration is None else (NOTHING, NOTHING)
        return acc if self.acc_left is None else self.acc_left, mag if self.mag_left is None else self.mag_left

    def full_scale(self, name: str) -> Floats | None:
        """Full scale of the three axes of a triad (3,), in the unit of its values; None where it is not known."""
        limit: Range = getattr(self, f"{name}_range")
        return None if limit is None else np.broadcast_to(np.asarray(limit, dtype=np.float64), 3)

    def rotated(self, dcm: Floats) -> Self:
        """Meta of a recording whose triads a matrix has turned: each range is the greatest value of the turned axis."""
        ranges: dict[str, Any] = {}
        for name in TRIADS:
            full_scale = self.full_scale(name)
            if full_scale is not None:
                ranges[f"{name}_range"] = np.minimum(np.abs(dcm) @ full_scale, _IMPOSSIBLE[name])
        return replace(self, **ranges)


def calibration_told(calibration: str | None) -> str:
    """Name of the card that has been applied, or `UNCALIBRATED`; the one place that words it."""
    return UNCALIBRATED if calibration is None else calibration


@dataclass(frozen=True, eq=False, repr=False)
class ImuData(Series):
    """Samples of a gyroscope, an accelerometer and a magnetometer on one time line.

    A triad that the unit does not have is None; one that has no value in some samples (a slower magnetometer, a lost
    packet) is NaN there. Time is kept to the nanosecond. Arrays are read-only; what insists on writable ones (some of
    SciPy does) takes a ``.copy()``.

    Parameters
    ----------
    t : array_like (N,)
        Time since the start of the recording, s, strictly increasing; equal steps are not needed.
    gyr : array_like (N, 3), optional
        Angular rate of the body in body axes, rad/s.
    acc : array_like (N, 3), optional
        Specific force in body axes, m/s²: at rest it points up and measures +g.
    mag : array_like (N, 3), optional
        Magnetic flux density in body axes, µT.
    temp_c : array_like (N,), optional
        Temperature, °C.
    flags : array_like (N,), optional
        Flags already known, from `plumbob.core.flags`; clipped, invalid and gap are added here. Absent is not taken
        over but read from the values: it means NaN.
    meta : ImuMeta
        What else is known.
    load : array_like (N, K) or (N,), optional
        Throttle, currents or speeds of motors at each sample, whose field a card takes off the magnetometer.

    Raises
    ------
    ShapeError
        If lengths or shapes differ, or a triad holds no number at all.
    ClockError
        If time is not finite and increasing.
    UnitError
        If the values cannot be in the unit that they should be in.
    """

    t: Floats
    gyr: Floats | None = None
    acc: Floats | None = None
    mag: Floats | None = None
    temp_c: Floats | None = None
    flags: NDArray[np.uint32] = field(default=None)  # type: ignore[arg-type]
    meta: ImuMeta = field(default_factory=ImuMeta)
    load: Floats | None = None

    def __post_init__(self) -> None:
        """Validate everything, once."""
        check.kind("meta", self.meta, ImuMeta)
        t_ns, seconds = _stamps(self.t)
        given: Any = self.flags
        marks = np.zeros(t_ns.size, dtype=np.uint32) if given is None else check.bits("flags", given, t_ns.size)
        marks[1:][is_gap(np.diff(t_ns))] |= flags.GAP
        values: dict[str, NDArray[Any]] = {"t": seconds, "flags": marks}
        for name in TRIADS:
            if (triad := getattr(self, name)) is not None:
                values[name] = check.rows(name, triad, 3, t_ns.size)
        if self.temp_c is not None:
            values["temp_c"] = check.column("temp_c", self.temp_c, t_ns.size)
        if self.load is not None:
            load = np.asarray(self.load).reshape(len(self.load), -1)
            values["load"] = check.rows("load", load, load.shape[1], t_ns.size)
        _mark(marks, values, self.meta)
        for name, array in values.items():
            object.__setattr__(self, name, check.read_only(array))
        if not self.triads:
            raise ShapeError("a recording needs at least one of gyr, acc and mag, but none was given.")
        self.require_possible()

    @classmethod
    def live(
        cls,
        t_ns: NDArray[np.int64],
        triads: Mapping[str, Floats],
        *,
        temp_c: Floats | None = None,
        flags: NDArray[np.uint32],
        meta: ImuMeta,
    ) -> Self:
        """Part of a stream: each row is judged by itself, so that it does not matter how the stream was cut.

        What only a whole recording can tell is left out: gaps, which the flags say, and whether the unit is plausible.
        Times, ns, increase from part to part, and every part has the same triads; one may be absent in all rows of a
        part. The arrays are handed over and must not change any more.
        """
        marks = flags.copy()
        _mark(marks, triads, meta)
        values = {name: triads.get(name) for name in TRIADS}
        state = {"t": to_s(t_ns), **values, "temp_c": temp_c, "flags": marks, "meta": meta}
        return _filled(object.__new__(cls), state)

    def __len__(self) -> int:
        return int(self.t.size)

    def columns(self) -> Mapping[str, NDArray[Any]]:
        """Time, the triads by axis, temperature and flags, by name."""
        columns: dict[str, NDArray[Any]] = {"t [s]": self.t}
        for name in self.triads:
            values = getattr(self, name)
            columns |= {f"{name}_{axis} [{UNITS[name]}]": values[:, i] for i, axis in enumerate("xyz")}
        return columns | ({} if self.temp_c is None else {"temp_c [degC]": self.temp_c}) | {"flags": self.flags}

    def facts(self) -> Mapping[str, str]:
        """What it is, in words: samples, sensors, device, frame and calibration."""
        columns = (*self.triads, *(() if self.temp_c is None else ("temp_c",)))
        return {
            "samples": _extent(self.t),
            "sensors": ", ".join(columns),
            "device": self.meta.device,
            "frame": str(self.meta.frame or "not named"),
            "calibration": self.meta.calibration or "none",
        }

    @property
    def t_ns(self) -> NDArray[np.int64]:
        """Time since the start, integer ns."""
        return to_ns(self.t)

    @property
    def triads(self) -> tuple[str, ...]:
        """Names of the triads that this recording has."""
        return tuple(name for name in TRIADS if getattr(self, name) is not None)

    def __setstate__(self, state: dict[str, Any]) -> None:
        _filled(self, state)

    def __getitem__(self, rows: slice) -> "ImuData":
        """Samples of a slice with step 1, with their times and flags unchanged; no copy is made."""
        start, stop = self._bounds(rows)
        state = {f.name: getattr(self, f.name) for f in fields(self)}
        part = {k: v[start:stop] if isinstance(v, np.ndarray) else v for k, v in state.items()}
        return _filled(object.__new__(type(self)), part)

    def picked(self, rows: NDArray[np.bool_]) -> Self:
        """Samples that a mask (N,) marks, with their times and flags unchanged."""
        state = {f.name: getattr(self, f.name) for f in fields(self)}
        part = {k: v[rows] if isinstance(v, np.ndarray) else v for k, v in state.items()}
        return _filled(object.__new__(type(self)), part)

    def flagged(self, words: NDArray[np.uint32]) -> Self:
        """The same samples with more flags (N,)."""
        state = {f.name: getattr(self, f.name) for f in fields(self)}
        return _filled(object.__new__(type(self)), state | {"flags": self.flags | words})

    def _bounds(self, rows: slice) -> tuple[int, int]:
        """First row of a slice, and the one behind its last."""
        if not isinstance(rows, slice):
            raise ShapeError(f"a recording must be cut by a slice, as in data[10:20], not by {type(rows).__name__}.")
        start, stop, step = rows.indices(len(self))
        if step != 1 or stop <= start:
            count = len(range(start, stop, step))
            raise ShapeError(
                f"a recording must be cut by a non-empty slice of step 1, but {rows} selects {count} of {len(self)}."
            )
        return start, stop

    @classmethod
    def joined(cls, parts: "Sequence[ImuData]") -> "ImuData":
        """One recording of parts that follow each other, as slices of one do."""
        first = parts[0]
        if len(parts) == 1:
            return first
        state = {f.name: getattr(first, f.name) for f in fields(ImuData)}
        for name, value in state.items():
            if isinstance(value, np.ndarray):
                state[name] = np.concatenate([getattr(part, name) for part in parts])
        return _filled(object.__new__(ImuData), state)

    def each(self, change: "Callable[[ImuData], ImuData]") -> "ImuData":
        """Recording whose parts, cut anywhere, are those of this one after a change that judges each row by itself."""
        return change(self)

    def only(self, *triads: str) -> "ImuData":
        """The same recording for who asks for these triads, or ``temp_c``, alone: nothing else needs to be read."""
        return self

    def gathered(self, of: "Callable[[ImuData], NDArray[Any]]") -> NDArray[Any]:
        """What a function has of each sample, (N, …), block by block: what it takes meanwhile does not grow."""
        rows, at = None, 0
        for part in self.chunks(BLOCK):
            values = of(part)
            if rows is None:
                rows = np.empty((len(self), *values.shape[1:]), dtype=values.dtype)
            rows[at : at + len(values)] = values
            at += len(values)
        assert rows is not None
        return rows

    def chunks(self, size: int) -> "Iterator[ImuData]":
        """Cut the recording in consecutive parts of `size` samples; the last may be shorter."""
        if not isinstance(size, Integral) or size < 1:
            raise ShapeError(f"size must be a whole number of at least 1, but it is {check.said(size)}.")
        for start in range(0, len(self), int(size)):
            yield self[start : start + int(size)]

    def samples(self) -> Iterator[ImuSample]:
        """Yield the samples one by one, as a live source would."""
        values = np.column_stack(
            [np.full((len(self), 3), np.nan) if v is None else v for v in (self.gyr, self.acc, self.mag)]
        )
        temp_c = [None] * len(self) if self.temp_c is None else self.temp_c.tolist()
        yield from map(ImuSample.packed, self.t_ns.tolist(), values, temp_c, self.flags.tolist())

    def usable(self, name: str) -> Floats:
        """Triad (N, 3) as a filter should see it, read-only: absent and invalid samples are NaN on all three axes.

        Parameters
        ----------
        name : {"gyr", "acc", "mag"}
            Which triad.
        """
        value: Floats | None = getattr(self, check.one_of("name", name, TRIADS))
        if value is None:
            return check.read_only(np.full((len(self), 3), np.nan))
        absent, _, invalid = TRIAD_FLAGS[name]
        out = (self.flags & np.uint32(absent | invalid)) != 0
        if not out.any() or np.isnan(value[out]).all():
            return value
        return check.read_only(np.where(out[:, np.newaxis], np.nan, value))

    def unit_doubts(self) -> tuple[str, ...]:
        """Why triads are hardly in their units, in words: what `unit_check` refuses, where it is switched off."""
        return tuple(doubt[0] for name in self.triads if (doubt := self._unit_doubt(name)))

    def require_possible(self) -> None:
        """Refuse triads without a number, and values that their unit makes impossible, as `ImuData` does when made."""
        for name in self.triads:
            reader = self.only(name)  # a unit may lack an axis, but not all of them
            if not any(np.isfinite(getattr(part, name)).any() for part in reader.chunks(BLOCK)):
                missing = np.concatenate([np.isnan(getattr(part, name)).any(axis=1) for part in reader.chunks(BLOCK)])
                what = "is NaN" if missing.all() else "has no finite number"
                raise ShapeError(f"{name} {what} in all {missing.size} samples; pass {name}=None if the unit has none.")
            if self.meta.unit_check and _CHECKED.get() and (doubt := self._unit_doubt(name)):
                raise UnitError(". ".join(doubt))

    def _unit_doubt(self, name: str) -> tuple[str, str] | None:
        """Why a triad is unlikely to be in its unit, and what to do; None where it may well be."""
        first, size, count = "", 0, 0
        full_scale, norm = self.meta.full_scale(name), list[Floats]()
        limit = _limit(name, full_scale)
        for part in self.only(name).chunks(BLOCK):
            triad = getattr(part, name)
            wrong = ~known_rows(triad, np.nextafter(limit, np.inf)) & known_rows(triad)  # infinity has no unit
            if not first and wrong.any():
                i = int(np.argmax(wrong))
                axis = int(np.argmax(np.abs(triad[i]) / limit))
                value = f"{name}[{size + i}, {axis}] = {triad[i, axis]:.6g} {_SI[name]}"
                first = f"{value}, but its {_bound(name, full_scale, axis)}"
            size, count = size + wrong.size, count + int(np.count_nonzero(wrong))
            if name != "gyr":
                sizes = norms(triad)
                norm.append(sizes[np.isfinite(sizes) & ~wrong])
        if count > max(1, 0.01 * size):
            return f"{first}, and {count} of {size} samples exceed it", _ADVICE[name]
        sizes = np.concatenate(norm) if norm else np.empty(0)
        low, high = (0.5 * G0, 2.5 * G0) if name == "acc" else (5.0, 2000.0)
        few = sizes.size < ENOUGH or 2 * min(map(np.count_nonzero, (sizes >= low, sizes <= high))) > sizes.size + 1
        if few or low <= (typical := median(sizes)) <= high:  # which takes long, and more than half of them say it
            return None
        usual = f"{low:.3g} to {high:.3g} {_SI[name]}"
        zeros = int(np.count_nonzero(sizes == 0.0))
        if 2 * zeros > sizes.size:
            return (
                f"|{name}| is exactly zero in {zeros} of {sizes.size} samples, but on Earth it lies in {usual}",
                f"The sensor was off or its columns were never filled: make those samples NaN, or leave {name} out.",
            )
        return (
            f"|{name}| is {typical:.4g} {_SI[name]} in the middle of {sizes.size} samples, but on Earth it lies in "
            f"{usual}{_guess(name, typical)}",
            _ADVICE[name],
        )

    def corrected(self, *, meta: ImuMeta, **triads: Floats) -> Self:
        """Return the same samples with corrected values of some triads.

        Nothing is judged again, so that a part of a recording can be corrected as the whole. Flags stay, because they
        say what the sensor measured: a value at the end of its range is clipped, whatever a calibration makes of it.
        Absent alone is read from the new values: it means NaN.
        """
        state = {f.name: getattr(self, f.name) for f in fields(self)} | {"meta": meta}
        marks = self.flags.copy()
        for name, value in triads.items():
            if name not in self.triads:
                raise ShapeError(f"the recording has no {name} to correct, only {', '.join(self.triads)}.")
            state[name] = check.read_only(check.rows(name, value, 3, len(self)))
            absent, _, invalid = TRIAD_FLAGS[name]
            missing = np.isnan(state[name]).any(axis=1)
            marks[~missing] &= ~np.uint32(absent)
            marks[missing & (self.flags & np.uint32(invalid) == 0)] |= absent
        return _filled(object.__new__(type(self)), state | {"flags": marks})

    @classmethod
    def from_streams(
        cls,
        t: Floats,
        *,
        gyr: Floats | None = None,
        acc: Floats | None = None,
        t_mag: Floats,
        mag: Floats,
        meta: ImuMeta | None = None,
    ) -> Self:
        """Join a magnetometer that has its own time stamps: each of its samples goes to the next inertial sample.

        Later, not nearest, because a live filter has a magnetic sample only once it has arrived. Where two fall on one
        inertial sample, the last wins; those after the last inertial sample are left out. Times are compared to the
        nanosecond.

        Parameters
        ----------
        t : array_like (N,)
            Inertial time, s.
        gyr, acc : array_like (N, 3), optional
            Rates, rad/s, and specific force, m/s².
        t_mag : array_like (M,)
            Magnetometer time on the same clock, s.
        mag : array_like (M, 3)
            Flux density, µT.
        meta : ImuMeta, optional
            What else is known.

        Raises
        ------
        ClockError
            If a clock does not increase, or no magnetic sample lies before the end of the inertial ones.
        """
        inertial, times = check.column("t", t), check.column("t_mag", t_mag)
        check.increasing_time("t", inertial)
        check.increasing_time("t_mag", times)
        values = check.rows("mag", mag, 3, times.size)
        place = np.searchsorted(to_ns(inertial), to_ns(times))
        inside = (place < inertial.size) & ~np.isnan(values).any(axis=1)
        if not inside.any():
            raise ClockError(
                f"no sample of mag, at {times[0]:.9g} to {times[-1]:.9g} s, has an inertial one after it: those are at "
                f"{inertial[0]:.9g} to {inertial[-1]:.9g} s. Put both on one clock."
            )
        joined = np.full((inertial.size, 3), np.nan)
        joined[place[inside]] = values[inside]
        return cls(t=inertial, gyr=gyr, acc=acc, mag=joined, meta=ImuMeta() if meta is None else meta)


@dataclass(frozen=True, eq=False, repr=False)
class AttitudeTrack(Series):
    """Attitude over time: an estimate or a reference.

    Parameters
    ----------
    t : array_like (N,)
        Time since the start of the recording, s, strictly increasing.
    q_nb : array_like (N, 4)
        Body to navigation, wxyz, normalised here; NaN rows where the attitude is not known.
    frame : Frame
        Navigation frame.
    north : North
        What the heading counts from.
    bias_b : array_like (N, 3), optional
        Estimated gyroscope bias in body axes, rad/s.
    cov_b : array_like (N, 3, 3), optional
        Covariance of the attitude error as a rotation vector in body axes, rad².
    flags : array_like (N,), optional
        Flags, from `plumbob.core.flags`.
    score : array_like (N,) of bool, optional
        Which samples count in an evaluation (a data set's movement mask); all where None.
    mag_weight : array_like (N,), optional
        How far the field was believed at each sample, 0 to 1; NaN where there was none to believe.
    source : str
        Where it comes from: filter and parameters, or reference system.

    Raises
    ------
    ShapeError
        If lengths or shapes differ, or a norm is not 1 within 1e-3.
    ClockError
        If time is not finite and increasing.
    FrameError
        If no frame is given.
    """

    t: Floats
    q_nb: Floats
    frame: Frame
    north: North
    bias_b: Floats | None = None
    cov_b: Floats | None = None
    flags: NDArray[np.uint32] | None = None
    score: NDArray[np.bool_] | None = None
    mag_weight: Floats | None = None
    source: str = ""

    def __post_init__(self) -> None:
        """Validate everything, once."""
        object.__setattr__(self, "frame", Frame.parse(self.frame))
        object.__setattr__(self, "north", North.parse(self.north))
        t = _stamps(self.t)[1]
        q = check.rows("q_nb", self.q_nb, 4, t.size)
        check.unit_norm("q_nb", q, tolerance=1e-3)  # files hold rounded digits
        square = np.sum(q * q, axis=1, keepdims=True)
        # What is already normalised to the last bits stays as it is, so that storing a track changes nothing.
        q = np.where(np.abs(square - 1.0) < 1e-12, q, q / np.sqrt(square))
        values: dict[str, NDArray[Any]] = {"t": t, "q_nb": q}
        if self.bias_b is not None:
            values["bias_b"] = check.rows("bias_b", self.bias_b, 3, t.size)
        if self.cov_b is not None:
            values["cov_b"] = cov = check.floats("cov_b", self.cov_b)
            if cov.shape != (t.size, 3, 3):
                raise ShapeError(f"cov_b must have shape ({t.size}, 3, 3), but its shape is {cov.shape}.")
        if self.flags is not None:
            values["flags"] = check.bits("flags", self.flags, t.size)
        if self.score is not None:
            values["score"] = check.mask("score", self.score, t.size)
        if self.mag_weight is not None:
            values["mag_weight"] = check.column("mag_weight", self.mag_weight, t.size)
        for name, array in values.items():
            object.__setattr__(self, name, check.read_only(array))

    def __setstate__(self, state: dict[str, Any]) -> None:
        _filled(self, state)

    def __len__(self) -> int:
        return int(self.t.size)

    def facts(self) -> Mapping[str, str]:
        """What it is, in words: samples, frame, what headings count from, what else it has, and its source."""
        more = [name for name in ("bias_b", "cov_b", "flags", "score", "mag_weight") if getattr(self, name) is not None]
        return {
            "samples": _extent(self.t),
            "known": str(int(np.count_nonzero(self.known))),
            "frame": str(self.frame),
            "north": str(self.north),
            "with": ", ".join(more) or "nothing else",
            "source": self.source.partition("(")[0] or "not named",
        }

    def columns(self) -> Mapping[str, NDArray[Any]]:
        """Time, the quaternion, its angles in degrees, and the gyroscope's bias where it is estimated, by name."""
        angles = to_deg(self.euler_zyx)
        columns = {"t [s]": self.t} | {f"q_{axis}": self.q_nb[:, i] for i, axis in enumerate("wxyz")}
        columns |= {f"{name} [deg]": angles[:, i] for i, name in enumerate(("yaw", "pitch", "roll"))}
        if self.bias_b is not None:
            columns |= {f"bias_{axis} [rad/s]": self.bias_b[:, i] for i, axis in enumerate("xyz")}
        return columns

    @property
    def euler_zyx(self) -> Floats:
        """Yaw, pitch, roll (N, 3), rad: about z, then y, then x, as `plumbob.rotations.euler_zyx_from_quat`.

        Yaw counts from the navigation frame's x axis, North in NED and NWU and East in ENU, about its z axis; NaN where
        the attitude is not known. `units.to_deg` gives degrees, for a person to read.
        """
        return euler_zyx_from_quat(self.q_nb)

    @property
    def gap_distance(self) -> Floats:
        """Time to the nearest gap, s, (N,), to the sample before or behind it; infinite where there is none."""
        distance = np.full(self.t.size, np.inf)
        if self.flags is None:
            return distance
        behind = np.flatnonzero(self.flags & np.uint32(flags.GAP))
        edges = self.t[np.unique(np.concatenate((behind, behind[behind > 0] - 1)))]
        if edges.size:
            after = np.minimum(np.searchsorted(edges, self.t), edges.size - 1)
            distance = np.minimum(np.abs(self.t - edges[after]), np.abs(self.t - edges[np.maximum(after - 1, 0)]))
        return distance

    @property
    def yaw(self) -> Floats:
        """Yaw (N,), rad, in (−π, π]; see `euler_zyx`."""
        return self.euler_zyx[:, 0]

    @property
    def pitch(self) -> Floats:
        """Pitch (N,), rad, in [−π/2, π/2]; see `euler_zyx`."""
        return self.euler_zyx[:, 1]

    @property
    def roll(self) -> Floats:
        """Roll (N,), rad, in (−π, π]; see `euler_zyx`."""
        return self.euler_zyx[:, 2]

    @property
    def end(self) -> Self:
        """The last sample, a copy."""
        state = {f.name: getattr(self, f.name) for f in fields(self)}
        return self.trusted(**{k: v[-1:].copy() if isinstance(v, np.ndarray) else v for k, v in state.items()})

    @property
    def known(self) -> NDArray[np.bool_]:
        """True where the attitude is known, (N,)."""
        return np.asarray(np.isfinite(self.q_nb).all(axis=1))

    @classmethod
    def trusted(cls, **values: Any) -> Self:
        """Track of arrays that are known to be valid and are handed over: nothing is judged or copied."""
        defaults = {f.name: f.default for f in fields(cls) if f.default is not MISSING}
        return _filled(object.__new__(cls), defaults | values)

    @classmethod
    def joined(cls, parts: Iterable[Self], count: int) -> Self:
        """One track of `count` samples of parts that follow each other; what is not an array is that of the last."""
        state: dict[str, Any] = {}
        at = 0
        for part in parts:
            for name, value in ((f.name, getattr(part, f.name)) for f in fields(cls)):
                if not isinstance(value, np.ndarray) or len(value) == count:
                    state[name] = value
                    continue
                if not at:
                    state[name] = np.empty((count, *value.shape[1:]), dtype=value.dtype)
                state[name][at : at + len(value)] = value
            at += len(part)
        return cls.trusted(**state)

    def with_attitude(self, q_nb: Floats, **changes: Any) -> Self:
        """Return the same track with another attitude (N, 4) and, where given, other fields."""
        return replace(self, q_nb=q_nb, **changes)


def _filled(made: Made, state: dict[str, Any]) -> Made:
    """A frozen object with its values, which are valid: arrays that nobody else writes to."""
    for name, value in state.items():
        if isinstance(value, np.ndarray):
            value.flags.writeable = False
        object.__setattr__(made, name, value)
    return made


def _extent(t: Floats) -> str:
    if t.size < 2:
        return f"{t.size}"
    return f"{t.size} in {t[-1] - t[0]:.6g} s at {1.0 / float(np.median(np.diff(t))):.5g} Hz"


def _stamps(t: ArrayLike) -> tuple[NDArray[np.int64], Floats]:
    """Times, s, as whole nanoseconds, which must increase, and these in seconds."""
    check.increasing_time("t", seconds := check.column("t", t))
    t_ns = to_ns(seconds)
    check.increasing_time("t, rounded to nanoseconds,", rounded := to_s(t_ns))
    return t_ns, rounded


def _checked_half(name: str, value: Any) -> Half:
    half = check.column(name, value, 120 if name == "gyr_left" and np.size(value) > 78 else 78)
    if not np.isfinite(half).all():
        raise ShapeError(f"{name} must hold finite numbers, but it does not.")
    return tuple(half.tolist())


def _checked_range(name: str, given: Any) -> Range:
    """Range of a triad; one number where all axes have the same."""
    axes = check.floats(f"{name}_range", given)
    if axes.shape not in {(), (3,)}:
        raise ShapeError(
            f"{name}_range must be one number for all axes, three for x, y and z, or None, but its shape is "
            f"{axes.shape}."
        )
    unit = _SI[name]
    for full_scale in axes.ravel().tolist():
        if not full_scale > 0.0:
            raise UnitError(f"{name}_range must be a positive full scale in {unit}, or None, but it is {full_scale}.")
        if full_scale > _IMPOSSIBLE[name]:
            raise UnitError(
                f"{name}_range = {full_scale:.6g} {unit}, but no MEMS part measures beyond {_IMPOSSIBLE[name]:g} "
                f"{unit}. Ranges have the units of their values: {name}_range=units.{_CONVERTER[name]}(...)."
            )
    x, y, z = np.broadcast_to(axes, 3).tolist()
    return float(x) if x == y == z else (x, y, z)


_CHECKED: ContextVar[bool] = ContextVar("unit_check", default=True)


@contextmanager
def units_unchecked() -> Iterator[None]:
    """Take recordings whatever their size, as who looks for the right units has to."""
    token = _CHECKED.set(False)
    try:
        yield
    finally:
        _CHECKED.reset(token)


def norms(triad: Floats) -> Floats:
    """Magnitude of each sample of a triad, (N,)."""
    # An absurd value gives an infinite norm, which a median leaves out; a signalling NaN is a NaN like any other.
    with np.errstate(over="ignore", invalid="ignore"):
        norm: Floats = np.sqrt(triad[:, 0] ** 2 + triad[:, 1] ** 2 + triad[:, 2] ** 2)
    return norm


def median(values: Floats) -> float:
    """Median of the finite ones, NaN where there are none; puts the values in another order, and needs no room."""
    finite = np.isfinite(values)
    count = int(np.count_nonzero(finite))
    if not count:
        return float("nan")
    if count < values.size:
        values[~finite] = np.inf
    low, high = (count - 1) // 2, count // 2
    values.partition((low, high))
    return float(0.5 * (values[low] + values[high]))


def _limit(name: str, full_scale: Floats | None) -> Floats:
    """Largest value of each axis that can be true, (3,)."""
    reach = np.inf if full_scale is None else 1.05 * full_scale
    return np.broadcast_to(np.minimum(_IMPOSSIBLE[name], reach), 3)


def _mark(marks: NDArray[np.uint32], triads: Mapping[str, Floats], meta: ImuMeta) -> None:
    """Flag the rows (N,) of triads, each by itself: absent, impossible, at the end of the range of an axis."""
    for name, (absent, clipped, invalid) in TRIAD_FLAGS.items():
        if name not in triads:
            marks |= np.uint32(absent)
            continue
        marks &= ~np.uint32(absent)
        triad, full_scale = triads[name], meta.full_scale(name)
        limit = _limit(name, full_scale)
        end = np.inf if full_scale is None else 0.999 * full_scale  # the last code below full scale is already the end
        odd = np.flatnonzero(~known_rows(triad, np.minimum(limit, end)))
        size = np.abs(triad[odd])
        missing = ~_in_all(~np.isnan(size))
        too_big = ~missing & ~_in_all(size <= limit)
        marks[odd[missing]] |= absent
        marks[odd[too_big]] |= invalid
        marks[odd[~missing & ~too_big & ~_in_all(size < end)]] |= clipped


def _in_all(marks: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """What holds of all three components of a row; several times as fast as ``all(axis=1)``."""
    return np.asarray(marks[:, 0] & marks[:, 1] & marks[:, 2])


def known_rows(triad: Floats, limit: float | Floats = np.inf) -> NDArray[np.bool_]:
    """Which rows of a triad (N, 3) hold finite numbers throughout, (N,), or such whose sizes are below a limit."""
    is_plain = max(-triad.min(initial=0.0), triad.max(initial=0.0)) < np.min(limit)  # two looks, without a copy
    return np.ones(len(triad), dtype=np.bool_) if is_plain else _in_all(np.abs(triad) < limit)


_CONVERTER = {"gyr": "dps", "acc": "g", "mag": "gauss"}
_ADVICE = {
    "gyr": "If the source holds °/s, convert it: units.dps(gyr), or unit = 'dps' in its profile.",
    "acc": "If the source holds g, convert it: units.g(acc), or unit = 'g' in its profile; for a centrifuge or a drop "
    "set unit_check=False.",
    "mag": "If the source holds gauss or nT, convert it: units.gauss(mag) or units.to_si(mag, 'nT'), or unit = 'gauss' "
    "in its profile; if 1 is the field of the place, 'relative'.",
}


def _bound(name: str, full_scale: Floats | None, axis: int) -> str:
    if full_scale is None:
        return f"limit is {_IMPOSSIBLE[name]:g} {_SI[name]}"
    end = float(full_scale[axis])
    degrees = f" ({to_deg(end):.6g} °/s)" if name == "gyr" else ""
    return f"range is ±{end:.6g} {_SI[name]}{degrees}"


def _guess(name: str, typical: float) -> str:
    guesses = {
        "acc": ((0.5, 2.5, "g"), (500.0, 2500.0, "mg"), (1e3, 7e4, "raw counts")),
        "mag": ((0.1, 1.0, "gauss"), (2e3, 1e5, "nT or raw counts"), (0.0, 1e-3, "tesla")),
    }
    return next((f"; it looks like {unit}" for low, high, unit in guesses[name] if low <= typical <= high), "")
