"""The filter object: validates, remembers, and calls one step, whether data come whole, in chunks or one by one.

A filter module holds the algorithm: ``Params`` (what a user sets), ``coefficients`` (what the kernel reads), ``STATE``
(how many own numbers evolve) and ``step``. Nothing else loops over samples.
"""

import math
import operator
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Annotated, Any, NamedTuple, Protocol, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from plumbob import check, clock, flags
from plumbob._jit import Kernel, njit, specialise
from plumbob.check import Floats
from plumbob.constants import IMPOSSIBLE_ACCELERATION, IMPOSSIBLE_FIELD, IMPOSSIBLE_RATE
from plumbob.data import TRIADS, AttitudeTrack, ImuData, ImuSample
from plumbob.errors import ClockError, DecodeError, FrameError, ParameterError, ShapeError
from plumbob.filters.admission import judge
from plumbob.filters.layout import BIAS, HEADED, OWN, STAGE, Q
from plumbob.params import Spec, build, describe, shown
from plumbob.rotations import Frame, North, quat_normalize
from plumbob.units import Quantity

STATE_VERSION = 1
WRONG_SHAPE = -1
_INVALID = flags.GYR_INVALID | flags.ACC_INVALID | flags.MAG_INVALID
_ABSENT = check.read_only(np.full(3, np.nan))


class CommonParams(NamedTuple):
    """What every filter takes besides its own parameters."""

    declination: Annotated[
        float | None, Spec(Quantity.ANGLE, "magnetic declination, east positive; off: headings are magnetic", -4, 4)
    ] = None
    max_gap: Annotated[float, Spec(Quantity.TIME, "a longer step is not integrated: the filter starts again", 0)] = 1.0
    mag: Annotated[bool, Spec(Quantity.RATIO, "use the magnetometer; off: headings count from a free zero")] = True


class FilterModule(Protocol):
    """What a filter's file must hold."""

    SUMMARY: str
    REFERENCES: tuple[str, ...]
    NEEDS: tuple[str, ...]
    STATE: int
    Params: Any
    step: Kernel[..., int]

    @staticmethod
    def coefficients(params: Any) -> tuple[float, ...]:
        """Own coefficients of the kernel."""
        ...


@dataclass(frozen=True, slots=True)
class Loops:
    """The two ways to call a filter's step."""

    batch: Kernel[..., None]
    single: Kernel[..., int]


@njit
def step(
    c: Floats, x: Floats, dt: float,
    gx: float, gy: float, gz: float, ax: float, ay: float, az: float, mx: float, my: float, mz: float,
) -> int:  # fmt: skip
    """Stand in for the step of a filter, which `loops_of` puts here."""
    return 0


@njit
def _batch(
    c: Floats, x: Floats, dt: Floats, gyr: Floats, acc: Floats, mag: Floats,
    q_nb: Floats, bias_b: Floats, found: NDArray[np.uint32],
) -> None:  # fmt: skip
    for i in range(dt.shape[0]):
        found[i] = step(
            c, x, dt[i],
            gyr[i, 0], gyr[i, 1], gyr[i, 2], acc[i, 0], acc[i, 1], acc[i, 2], mag[i, 0], mag[i, 1], mag[i, 2],
        )  # fmt: skip
        q_nb[i, 0], q_nb[i, 1], q_nb[i, 2], q_nb[i, 3] = x[Q], x[Q + 1], x[Q + 2], x[Q + 3]
        bias_b[i, 0], bias_b[i, 1], bias_b[i, 2] = x[BIAS], x[BIAS + 1], x[BIAS + 2]


@njit
def _single(c: Floats, x: Floats, dt: float, gyr: Floats, acc: Floats, mag: Floats) -> int:
    if gyr.shape[0] != 3 or acc.shape[0] != 3 or mag.shape[0] != 3:
        return WRONG_SHAPE
    no_gyr, gx, gy, gz = judge(gyr[0], gyr[1], gyr[2], IMPOSSIBLE_RATE, flags.GYR_ABSENT, flags.GYR_INVALID)
    no_acc, ax, ay, az = judge(acc[0], acc[1], acc[2], IMPOSSIBLE_ACCELERATION, flags.ACC_ABSENT, flags.ACC_INVALID)
    no_mag, mx, my, mz = judge(mag[0], mag[1], mag[2], IMPOSSIBLE_FIELD, flags.MAG_ABSENT, flags.MAG_INVALID)
    return no_gyr | no_acc | no_mag | step(c, x, dt, gx, gy, gz, ax, ay, az, mx, my, mz)


def loops_of(name: str, module: FilterModule) -> Loops:
    """Batch and single-sample entry of a filter, compiled around its step."""
    return Loops(
        batch=specialise(_batch, f"batch_{name}", step=module.step),
        single=specialise(_single, f"single_{name}", step=module.step),
    )


class Filter:
    """An estimator with its parameters and its state.

    Parameters
    ----------
    name : str
        As listed by `filter_names`.
    frame : Frame
        Navigation frame of the result; there is no default.
    params : Mapping, optional
        Parameters by name; numbers in SI, text with its unit. Unknown names are refused.
    init : array_like (4,), optional
        Attitude q_nb to start from; without it the first samples give tilt and heading.

    Attributes
    ----------
    name, frame : str, Frame
        As given.
    params : NamedTuple
        The filter's own parameters, SI.
    common : CommonParams
        Declination, gap limit, use of the magnetometer.

    Raises
    ------
    ParameterError
        If the filter or a parameter is unknown.
    FrameError
        If no frame is given.

    Examples
    --------
    >>> from plumbob import Filter, Frame
    >>> Filter("mahony", frame=Frame.NED, params={"kp": 0.5, "gate": "0.08 g"}).params.gate
    0.784532
    """

    def __init__(
        self, name: str, *, frame: Frame, params: Mapping[str, Any] | None = None, init: ArrayLike | None = None
    ) -> None:
        from plumbob.filters import load

        if not isinstance(frame, Frame):
            raise FrameError(f"frame must be a Frame ({', '.join(Frame)}), but it is {frame!r}.")
        self.name = name
        self.frame = frame
        self.module = load(name)
        self.params, self.common = _split_params(name, self.module, dict(params or {}))
        self._loops = _cached_loops(name, self.module)
        self._c = _coefficients(self.module, self.params, self.common, frame)
        self._single: Callable[..., int] = self._compile_single  # numba is imported when it is needed, and not here
        self._init = None if init is None else _attitude(init)
        self.reset()

    def reset(self) -> None:
        """Forget every sample; parameters and start attitude stay."""
        self._x: Floats = np.zeros(OWN + self.module.STATE)
        self._x[Q] = 1.0
        self._last_ns: int | None = None
        if self._init is not None:
            self._x[Q : Q + 4] = self._init
            self._x[STAGE] = HEADED

    @property
    def q_nb(self) -> Floats:
        """Attitude now, (4,)."""
        return self._x[Q : Q + 4].copy()

    @property
    def bias_b(self) -> Floats:
        """Gyroscope bias now, rad/s, (3,); zero for a filter that estimates none."""
        return self._x[BIAS : BIAS + 3].copy()

    def process(self, data: ImuData) -> AttitudeTrack:
        """Take a recording, or its next chunk, and return the attitude at each of its samples.

        Raises
        ------
        ShapeError
            If the recording lacks a triad that the filter needs.
        """
        if not isinstance(data, ImuData):
            raise ShapeError(f"process takes an ImuData, but got {type(data).__name__}; of a Recording take its .imu.")
        self._require(data.triads)
        dt = clock.steps(data.t, self._last_ns)
        mag = data.usable("mag") if self.common.mag else check.read_only(np.full((len(data), 3), np.nan))
        q_nb, bias_b, found = self._batch(dt, data.usable("gyr"), data.usable("acc"), mag)
        last = int(data.t_ns[-1])
        self._last_ns = last if self._last_ns is None else max(self._last_ns, last)
        return AttitudeTrack.trusted(
            t=data.t,
            q_nb=q_nb,
            frame=self.frame,
            north=self._north("mag" in data.triads),
            bias_b=bias_b,
            flags=found | data.flags,
            source=self.describe(),
        )

    def _batch(self, dt: Floats, gyr: Floats, acc: Floats, mag: Floats) -> tuple[Floats, Floats, NDArray[np.uint32]]:
        n = dt.size
        q_nb, bias_b, found = np.empty((n, 4)), np.empty((n, 3)), np.empty(n, dtype=np.uint32)
        self._loops.batch.compiled(self._c, self._x, dt, gyr, acc, mag, q_nb, bias_b, found)
        return q_nb, bias_b, found

    def update(self, sample: ImuSample) -> int:
        """Take the next sample and return its flags; `q_nb` is then the attitude at its time.

        What `ImuData` finds in a recording is found here too, absent and impossible values; what only the source knows,
        the ends of ranges and lost packets, are the flags of the sample.

        Raises
        ------
        ShapeError
            If a triad has not the shape (3,).
        ClockError
            If the time is no whole number of ns.
        """
        last, bad, t_ns = self._last_ns, sample.flags, sample.t_ns
        if t_ns.__class__ is not int:
            t_ns = _whole(t_ns)
        dt = 0.0 if last is None else (t_ns - last) / 1e9
        gyr, acc, mag = sample.gyr, sample.acc, sample.mag
        if gyr is None or acc is None or mag is None or bad & _INVALID or not self.common.mag:
            gyr, acc, mag = self._usable(sample)
        try:
            found = self._single(self._c, self._x, dt, gyr, acc, mag)
        except Exception:  # numba's, where an array has not one axis
            _require_triads(gyr, acc, mag)
            raise
        if found < 0:
            _require_triads(gyr, acc, mag)
        if not found & flags.TIME_FAULT:  # a late or repeated sample must not turn the clock back
            self._last_ns = t_ns
        return found | bad

    def _usable(self, sample: ImuSample) -> tuple[Floats, Floats, Floats]:
        """Triads of a sample, NaN where absent, invalid or not wanted."""
        bad = sample.flags
        return (
            _ABSENT if sample.gyr is None or bad & flags.GYR_INVALID else sample.gyr,
            _ABSENT if sample.acc is None or bad & flags.ACC_INVALID else sample.acc,
            _ABSENT if sample.mag is None or bad & flags.MAG_INVALID or not self.common.mag else sample.mag,
        )

    def _compile_single(self, *args: Any) -> int:
        self._single = self._loops.single.compiled
        return self._single(*args)

    def warm_up(self) -> None:
        """Compile now, so that the first live sample does not wait."""
        none = check.read_only(np.empty((0, 3)))  # as a recording's arrays are: numba tells them from writable ones
        self._batch(np.empty(0), none, none, none)
        for triad in (_ABSENT, _ABSENT.copy()):
            self._loops.single.compiled(self._c, self._x.copy(), 0.0, triad, triad, triad)

    def save(self) -> dict[str, Any]:
        """Everything needed to go on later, ready for JSON, which keeps every bit of a float."""
        return {
            "kind": "plumbob filter state",
            "version": STATE_VERSION,
            "filter": self.name,
            "frame": str(self.frame),
            "params": {**self.params._asdict(), **self.common._asdict()},
            "init": None if self._init is None else self._init.tolist(),
            "last_ns": self._last_ns,
            "state": self._x.tolist(),
        }

    @classmethod
    def restore(cls, saved: Mapping[str, Any]) -> Self:
        """Filter that goes on where `save` was called.

        Raises
        ------
        DecodeError
            If the mapping is no saved state, or of another version.
        """
        if not isinstance(saved, Mapping) or saved.get("kind") != "plumbob filter state":
            raise DecodeError("this is no saved filter state; give what Filter.save() returned.")
        if saved.get("version") != STATE_VERSION:
            raise DecodeError(f"the saved state has version {saved.get('version')}, but this is {STATE_VERSION}.")
        missing = {"filter", "frame", "params", "init", "last_ns", "state"} - set(saved)
        if missing:
            raise DecodeError(f"the saved state lacks {', '.join(sorted(missing))}.")
        filter_ = cls(saved["filter"], frame=Frame.parse(saved["frame"]), params=saved["params"], init=saved["init"])
        state = check.column("state", saved["state"])
        if state.shape != filter_._x.shape or not np.isfinite(state).all():
            raise DecodeError(f"the saved state must be {filter_._x.size} finite numbers, but has {state.size}.")
        filter_._x = state.copy()
        filter_._last_ns = None if saved["last_ns"] is None else _whole(saved["last_ns"])
        return filter_

    def __repr__(self) -> str:
        return f"<Filter {self.describe()} in {self.frame}>"

    def describe(self) -> str:
        """Name and parameters in one line, for provenance."""
        pairs = ((p, getattr(holder, p.name)) for holder in (self.params, self.common) for p in describe(type(holder)))
        return f"{self.name}({', '.join(f'{p.name}={shown(p, value)}' for p, value in pairs)})"

    def _require(self, triads: tuple[str, ...]) -> None:
        missing = [name for name in self.module.NEEDS if name not in triads]
        if missing:
            raise ShapeError(
                f"{self.name} needs {', '.join(self.module.NEEDS)}, but the recording has no {', '.join(missing)}."
            )

    def _north(self, has_mag: bool) -> North:
        if not (has_mag and self.common.mag):
            return North.FREE
        return North.MAGNETIC if self.common.declination is None else North.TRUE


_LOOPS: dict[str, Loops] = {}


def _cached_loops(name: str, module: FilterModule) -> Loops:
    if name not in _LOOPS:
        _LOOPS[name] = loops_of(name, module)
    return _LOOPS[name]


def _split_params(name: str, module: FilterModule, values: dict[str, Any]) -> tuple[Any, CommonParams]:
    own = {p.name for p in describe(module.Params)}
    shared = {p.name for p in describe(CommonParams)}
    unknown = [k for k in values if k not in own | shared]
    if unknown:
        known = ", ".join(p.name for p in (*describe(module.Params), *describe(CommonParams)))
        raise ParameterError(f"{name} has no parameter '{unknown[0]}'; known are {known}.")
    return (
        build(module.Params, {k: v for k, v in values.items() if k in own}, of=name),
        build(CommonParams, {k: v for k, v in values.items() if k in shared}, of=name),
    )


def _coefficients(module: FilterModule, params: Any, common: CommonParams, frame: Frame) -> Floats:
    angle = common.declination or 0.0
    north = math.cos(angle) * frame.north + math.sin(angle) * frame.east
    return np.array([frame.up[2], north[0], north[1], common.max_gap, *module.coefficients(params)], dtype=np.float64)


def _whole(t_ns: Any) -> int:
    try:
        return operator.index(t_ns)
    except TypeError:
        raise ClockError(f"t_ns must be a whole number of nanoseconds, but it is {t_ns!r}.") from None


def _require_triads(*triads: Floats) -> None:
    for name, value in zip(TRIADS, triads, strict=True):
        if np.shape(value) != (3,):
            raise ShapeError(f"{name} of a sample must have shape (3,), but its shape is {np.shape(value)}.")


def _attitude(init: ArrayLike) -> Floats:
    q = check.last_axis("init", init, 4)
    if q.shape != (4,) or not np.isfinite(q).all():
        raise ShapeError(f"init must be one finite quaternion of shape (4,), but its shape is {q.shape}.")
    return quat_normalize(q)
