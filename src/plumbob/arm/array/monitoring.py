"""The monitor of an array: which unit contradicts the others, since when, and what is measured without it."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from plumbob.arm.array import channels
from plumbob.arm.array.tracker import OF_TRIAD, OUT, SCALE, STATE, TRIAD_SIZE, UNIT_SIZE, start_unit, take_rows
from plumbob.core import check, flags
from plumbob.core.check import Floats
from plumbob.core.errors import ParameterError, ShapeError
from plumbob.core.result import Described, plain
from plumbob.core.series import Series
from plumbob.core.units import dps
from plumbob.data import TRIADS, ImuData, ImuMeta
from plumbob.data.array import ImuArray, UnitMount
from plumbob.data.cards import NoiseCard

if TYPE_CHECKING:
    from plumbob.door.reading import Source

KINDS: Final = ("good", "suspect", "deviates", "noisy", "frozen", "dead")
"""What a unit's triad may be, by its number in a word of `Monitored.words`."""
CHUNK: Final = 4096  # rows that `monitor` takes at a time; the result does not depend on it


class MonitoringSettings(NamedTuple):
    """How an array is watched; numbers in SI."""

    tau: float = 1.0  # deviations are averaged over this, s
    alarm: float = 5.5  # a mean deviation of so many standard deviations is an alarm
    noisy: float = 4.5  # so is a noise whose variance is so many times the expected one
    readmit: float = 5.0  # a unit that agrees again for this long is taken in again, s
    dead: float = 0.5  # a unit without a value for this long, while others have some, is dead, s
    adapt: float = 30.0  # the scale of the noise is learned over this, s; 0: it is as given
    learn: float = 3.0  # no alarm before, s
    # gyr_bias, acc_bias, mag_bias: standard deviation of a unit's bias at the start, rad/s, m/s², µT
    gyr_bias: float = dps(1.0)
    acc_bias: float = 0.3
    mag_bias: float = 5.0
    # gyr_walk, acc_walk, mag_walk: random walk of it, per √s
    gyr_walk: float = dps(0.002)
    acc_walk: float = 5e-4
    mag_walk: float = 5e-3
    scale: float = 0.01  # standard deviation of a unit's scale and alignment at the start
    scale_walk: float = 1e-5  # random walk of it, 1/√s

    def coefficients(self, step: float) -> Floats:
        """What the kernel reads."""
        if (
            not all(np.isfinite(value) and value >= 0.0 for value in self)
            or min(self.tau, self.alarm, self.noisy) <= 0.0
        ):
            raise ParameterError(f"the settings of a monitor must be positive numbers, but they are {self}.")
        coefficients = [self.tau, self.alarm, self.noisy, self.readmit, self.dead, step, self.adapt, self.learn]
        for triad in TRIADS:
            of = {letter: float(getattr(self, f"{triad}_{letter}")) ** 2 for letter in ("bias", "walk")}
            coefficients += [of["bias"], self.scale**2, of["walk"], self.scale_walk**2]
        return np.array(coefficients)


@dataclass(frozen=True, slots=True)
class TriadFault:
    """One time for which a unit's triad was left out, in s, NaN at the end where it lasts; `kind`: of `KINDS`."""

    unit: str
    triad: str
    kind: str
    begin: float
    end: float


@dataclass(frozen=True, eq=False, repr=False)
class Monitored(Series, Described):
    """What a monitor has made of an array, or of a part of a stream.

    Attributes
    ----------
    imu : ImuData
        The virtual unit in body axes, without the units that are left out; its flags are `UNIT_SUSPECT`,
        `UNIT_EXCLUDED` and `CANNOT_ISOLATE`, and what all units said.
    words : ndarray (N, U) of uint32
        State of each unit: four bits for each triad, gyr lowest, of which the number is a place in `KINDS`.
    names : tuple of str
        Names of the units.
    noise : NoiseCard or None
        Of the virtual unit, with all units.
    """

    imu: ImuData
    words: NDArray[np.uint32]
    names: tuple[str, ...]
    noise: NoiseCard | None = None

    def __len__(self) -> int:
        return len(self.imu)

    def state(self, triad: str) -> NDArray[np.uint32]:
        """State of a triad of each unit (N, U), as places in `KINDS`."""
        return (self.words >> np.uint32(4 * TRIADS.index(check.one_of("triad", triad, TRIADS)))) & np.uint32(15)

    def excluded(self, triad: str) -> NDArray[np.bool_]:
        """True where a unit's triad is left out (N, U)."""
        out: NDArray[np.bool_] = self.state(triad) > 1
        return out

    @property
    def faults(self) -> tuple[TriadFault, ...]:
        """Every time for which a unit's triad was left out, in order of time."""
        return tuple(sorted(self._faults(), key=lambda fault: fault.begin))

    def _faults(self) -> Iterator[TriadFault]:
        t = self.imu.t
        for triad in TRIADS:
            state = self.state(triad)
            for u in np.flatnonzero((state > 1).any(axis=0)).tolist():
                for start, stop in check.runs(state[:, u] > 1):
                    end = float(t[stop]) if stop < t.size else float("nan")
                    kind = KINDS[int(np.bincount(state[start:stop, u]).argmax())]  # what it was called longest
                    yield TriadFault(self.names[u], triad, kind, float(t[start]), end)

    def facts(self) -> Mapping[str, str]:
        """Units, samples and faults."""
        return {"units": ", ".join(self.names), "faults": str(len(self.faults)), **self.imu.facts()}

    def columns(self) -> Mapping[str, NDArray[Any]]:
        """Of the virtual unit."""
        return self.imu.columns()

    def summary(self) -> dict[str, Any]:
        """All findings, as JSON can hold them."""
        return dict(
            plain(
                {
                    "units": list(self.names),
                    "samples": len(self),
                    "duration_s": float(self.imu.t[-1] - self.imu.t[0]),
                    "flags": flags.counts(self.imu.flags),
                    "faults": list(self.faults),
                }
            )
        )


class Monitor:
    """Watch an array as its samples come; cut anywhere, a stream gives the same bits.

    Parameters
    ----------
    mounts : mapping of str to UnitMount
        How each unit sits on the body, its noise card with it; see `ImuArray.mounts`.
    step : float
        Nominal time between two samples, s: what one sample's noise is follows from it.
    settings : MonitoringSettings, optional
        Times and thresholds.

    Attributes
    ----------
    names : tuple of str
        Names of the units.
    """

    def __init__(
        self, mounts: Mapping[str, UnitMount], *, step: float, settings: MonitoringSettings | None = None
    ) -> None:
        self.names = tuple(mounts)
        if not self.names:
            raise ShapeError("a monitor needs at least one unit, but no mount was given.")
        if not 0.0 < check.number("step", step, "s") < np.inf:
            raise ParameterError(f"step must be a positive number of seconds, but it is {step}.")
        self.settings = settings or MonitoringSettings()
        self._mounts = dict(mounts)
        self._axes, self._levers = channels.directions(mounts), channels.levers(mounts)
        self._c = self.settings.coefficients(step)
        self._weight = np.ascontiguousarray([step / channels.densities(mounts, triad) ** 2 for triad in TRIADS])
        units = len(self.names)
        self._x = np.zeros((3, units, UNIT_SIZE))
        self._g = np.zeros((3, TRIAD_SIZE))
        self._h = np.zeros((4, 3))
        self._room = (np.zeros((3, 3)), np.zeros((3, 3)), np.zeros(3), np.zeros(units))
        self.reset()

    @classmethod
    def from_array(cls, array: ImuArray, *, settings: MonitoringSettings | None = None) -> Self:
        """One that watches the units of these samples, by their mounts and the time between them."""
        return cls(array.mounts, step=channels.nominal_step(array), settings=settings)

    def reset(self) -> None:
        """Forget every sample."""
        self._g[:], self._h[:] = 0.0, 0.0
        self._g[:, SCALE] = 1.0
        at = OF_TRIAD
        for triad in range(3):
            for u in range(len(self.names)):
                start_unit(self._x[triad, u], float(self._c[at + 4 * triad]), float(self._c[at + 4 * triad + 1]))

    def take(self, array: ImuArray) -> Monitored:
        """Take the next samples, of the same units; an error if its units are others."""
        if array.names != self.names:
            raise ParameterError(
                f"this monitor watches {', '.join(self.names)}, but the samples are of {', '.join(array.names)}. "
                "Make a monitor for each array."
            )
        y = np.ascontiguousarray(np.stack([channels.stacked(array, triad) for triad in TRIADS], axis=1))
        values = np.empty((len(array), 3, 3))
        words = np.zeros((len(array), len(self.names)), dtype=np.uint32)
        row = common_flags(array)
        a, inverse, use, room = self._room
        take_rows(
            np.ascontiguousarray(array.t), y, self._x, self._g, self._c, self._axes, self._weight, self._levers,
            bool(self._levers.any()), a, inverse, self._h, use, room, values, words, row,
        )  # fmt: skip
        return Monitored(virtual(array, values, row), words, self.names, channels.combined_noise(array, _name(array)))

    @property
    def relative(self) -> dict[str, Floats]:
        """What each sensor axis has beyond the mean, by triad, (U, 3, 4): bias, and its share of the body's x, y, z."""
        return {triad: self._x[i, :, :12].reshape(-1, 3, 4).copy() for i, triad in enumerate(TRIADS)}

    @property
    def left_out(self) -> dict[str, tuple[str, ...]]:
        """Units that are left out now, by triad."""
        return {
            triad: tuple(name for u, name in enumerate(self.names) if self._x[i, u, STATE] == OUT)
            for i, triad in enumerate(TRIADS)
        }


def monitor(array: "ImuArray | Source | Sequence[Source]", *, settings: MonitoringSettings | None = None) -> Monitored:
    """Watch an array: which units contradict the others, and what the rest of them measure.

    Parameters
    ----------
    array : ImuArray, or what `plumbob.read_array` reads
        The units; the noise cards of their mounts say what may be noise. Where none has one, the noise that the values
        show is taken, at least that of a common part. A `Monitor` of a stream takes that of a common part.
    settings : MonitoringSettings, optional
        Times and thresholds.

    Returns
    -------
    Monitored
        The virtual unit, the state of each unit, and faults.

    Examples
    --------
    >>> from plumbob.arm.array import monitor  # doctest: +SKIP
    >>> print(monitor(array).text())  # doctest: +SKIP
    """
    from plumbob.door.reading import opened_array

    array = opened_array(array)
    has_card = any(mount.noise is not None for mount in array.mounts.values())
    array = channels.with_noise(channels.aligned(array))
    watch = Monitor.from_array(array, settings=settings)
    parts = [watch.take(part) for part in array.chunks(CHUNK)]
    imu = ImuData.joined([part.imu for part in parts])
    return Monitored(
        imu, np.concatenate([part.words for part in parts]), array.names, parts[0].noise if has_card else None
    )


def common_flags(array: ImuArray) -> NDArray[np.uint32]:
    """Flags (N,) that all units have, and gaps and faults of time, which one is enough for."""
    words = [imu.flags for imu in array.units.values()]
    every = np.bitwise_and.reduce(words)
    any_ = np.bitwise_or.reduce(words) & np.uint32(flags.GAP | flags.TIME_FAULT)
    common: NDArray[np.uint32] = (every | any_).astype(np.uint32)
    return common


def virtual(array: ImuArray, values: Floats, row: NDArray[np.uint32]) -> ImuData:
    """Virtual unit (N, triads, 3) in body axes; a triad that no unit has is left out."""
    first = next(iter(array.units.values()))
    has = [any(getattr(imu, triad) is not None for imu in array.units.values()) for triad in TRIADS]
    triads = {triad: np.ascontiguousarray(values[:, i]) for i, triad in enumerate(TRIADS) if has[i]}
    meta = ImuMeta(
        device=_name(array), rate_nominal=first.meta.rate_nominal, t0_ns=first.meta.t0_ns, frame=first.meta.frame,
        north=first.meta.north, declination=first.meta.declination, calibration=first.meta.calibration,
        unit_check=False,
    )  # fmt: skip
    temps = [imu.temp_c for imu in array.units.values() if imu.temp_c is not None]
    return ImuData.live(first.t_ns, triads, temp_c=np.mean(temps, axis=0) if temps else None, flags=row, meta=meta)


def _name(array: ImuArray) -> str:
    return f"array of {', '.join(array.names)}"[:80]
