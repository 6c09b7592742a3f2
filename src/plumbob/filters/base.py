"""The filter object: validates, remembers, and calls one step, whether data come whole, in chunks or one by one.

A filter module holds the algorithm: ``Params`` (what a user sets), ``coefficients`` (what the kernel reads), ``STATE``
(how many own numbers evolve) and ``step``. Nothing else loops over samples.
"""

import math
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from plumbob.core import check, flags
from plumbob.core.check import Floats
from plumbob.core.constants import G0, IMPOSSIBLE_ACCELERATION, IMPOSSIBLE_FIELD, IMPOSSIBLE_RATE
from plumbob.core.errors import DecodeError, FrameError, ParameterError, PlumbobWarning, ShapeError, unknown_name
from plumbob.core.kernels import Kernel, bare, kernel, specialise
from plumbob.core.params import Spec, build, describe, shown
from plumbob.core.text import FactsText
from plumbob.core.units import Quantity, to_deg
from plumbob.data import AttitudeTrack, ImuData, ImuMeta, calibration_told
from plumbob.data.sample import ImuSample
from plumbob.filters import layout
from plumbob.filters.input_checks import as_one, judge, or_zero, usable, watch
from plumbob.filters.known import BUILT_IN, EXTENSIBLE, SMOOTHER, FilterModule, load
from plumbob.filters.layout import BIAS, BLIND, MAX_GAP, OWN, SEEN, SIZE, STAGE, USE_MAG, Q, tick
from plumbob.filters.settling import settle, trial_time
from plumbob.filters.start import Start, as_start
from plumbob.rotations import Frame, North
from plumbob.rotations.kernels import rotate

if TYPE_CHECKING:
    from pathlib import Path

    from plumbob.data.cards import CalibrationCard, NoiseCard

_UNIT = 1e-6  # a step renormalises to rounding
_LARGEST = 2.0**63  # a time in ns; no other number of a state comes near
STATE_VERSION = 7
SEEN_TAU = 30.0  # the field is taken for its mean over this, s, when errors of its calibration are weighed
_LOOKED_AT = 10_000
"""Samples from whose first ones a caller is warned of a wrong unit or sign; more would cost as much as a filter."""


class CommonParams(NamedTuple):
    """What every filter takes besides its own parameters."""

    declination: Annotated[
        float | None,
        Spec(
            Quantity.ANGLE,
            "magnetic declination, east positive; default: the recording's; off: magnetic",
            -math.pi,
            math.pi,
        ),
    ] = None
    max_gap: Annotated[float, Spec(Quantity.TIME, "a longer step is not integrated: the filter starts again", 0)] = 1.0
    mag: Annotated[bool, Spec(Quantity.RATIO, "use the magnetometer; off: headings count from a free zero")] = True


@dataclass(frozen=True, slots=True)
class Loops:
    """The ways to call a filter's step."""

    batch: Kernel[..., None]
    single: Kernel[..., int]


@kernel
def step(
    c: Floats, x: Floats, dt: float, flags_in: int,
    gx: float, gy: float, gz: float, ax: float, ay: float, az: float, mx: float, my: float, mz: float,
) -> int:  # fmt: skip
    """Stand in for the step of a filter, which `filter_loops` puts here."""
    return 0


@kernel
def look(x: Floats, dt: float, mx: float, my: float, mz: float) -> None:
    """Stand in for `see_field`, where a covariance asks for it."""


@kernel
def see_field(x: Floats, dt: float, mx: float, my: float, mz: float) -> None:
    """Mean level and vertical part of the field over `SEEN_TAU`, against which errors of its calibration weigh."""
    if not usable(mx, my, mz):
        return
    hx, hy, hz = rotate(x[Q], x[Q + 1], x[Q + 2], x[Q + 3], mx, my, mz)
    x[SEEN + 2] += 1.0
    weight = max(1.0 / x[SEEN + 2], dt / (dt + SEEN_TAU))
    x[SEEN] += weight * (math.sqrt(hx * hx + hy * hy) - x[SEEN])
    x[SEEN + 1] += weight * (hz - x[SEEN + 1])


@kernel
def _take(
    c: Floats, x: Floats, t_ns: int, flags_in: int,
    gx: float, gy: float, gz: float, ax: float, ay: float, az: float, mx: float, my: float, mz: float,
) -> int:  # fmt: skip
    said = as_one(or_zero(as_one(gx, gy, gz)), or_zero(as_one(ax, ay, az)), or_zero(as_one(mx, my, mz)))
    dt = tick(x, t_ns, said)
    if dt < 0.0:
        return flags_in | flags.TIME_FAULT
    flags_in |= watch(x, dt, gx, gy, gz, ax, ay, az, mx, my, mz)
    blind = x[STAGE] == BLIND or dt > c[MAX_GAP]
    word = flags_in | step(c, x, dt, flags_in, gx, gy, gz, ax, ay, az, mx, my, mz)
    look(x, dt, mx, my, mz)
    return word | settle(c, x, dt, flags_in, blind, word, gx, gy, gz, ax, ay, az)


@kernel
def _row(
    i: int, c: Floats, x: Floats, t_ns: NDArray[np.int64], flags_in: NDArray[np.uint32],
    gyr: Floats, acc: Floats, mag: Floats, q_nb: Floats, bias_b: Floats, words: NDArray[np.uint32],
) -> None:  # fmt: skip
    words[i] = _take(
        c, x, t_ns[i], int(flags_in[i]),
        gyr[3 * i], gyr[3 * i + 1], gyr[3 * i + 2], acc[3 * i], acc[3 * i + 1], acc[3 * i + 2],
        mag[3 * i], mag[3 * i + 1], mag[3 * i + 2],
    )  # fmt: skip
    q_nb[4 * i], q_nb[4 * i + 1], q_nb[4 * i + 2], q_nb[4 * i + 3] = x[Q], x[Q + 1], x[Q + 2], x[Q + 3]
    bias_b[3 * i], bias_b[3 * i + 1], bias_b[3 * i + 2] = x[BIAS], x[BIAS + 1], x[BIAS + 2]


@kernel
def _batch(
    c: Floats, x: Floats, t_ns: NDArray[np.int64], flags_in: NDArray[np.uint32], gyr: Floats, acc: Floats, mag: Floats,
    q_nb: Floats, bias_b: Floats, words: NDArray[np.uint32], first: int, cov: Floats,
) -> None:  # fmt: skip
    last = cov.shape[1] - 2
    for i in range(t_ns.shape[0]):
        _row(
            i, bare(c), bare(x), bare(t_ns), bare(flags_in), bare(gyr), bare(acc), bare(mag),
            bare(q_nb), bare(bias_b), bare(words),
        )  # fmt: skip
        if cov.shape[0] > 0:  # none where no covariance is kept
            for k in range(last):
                cov[i, k] = x[first + k]
            cov[i, last], cov[i, last + 1] = x[SEEN], x[SEEN + 1]


@kernel
def _single(s: Floats, t_ns: int, word: int, values: Floats) -> int:
    size = int(s[SIZE])
    c, x = bare(s), bare(s[size:])
    gyr_flag, gx, gy, gz = judge(
        word & flags.GYR_INVALID, values[0], values[1], values[2], IMPOSSIBLE_RATE, flags.GYR_ABSENT, flags.GYR_INVALID
    )
    acc_flag, ax, ay, az = judge(
        word & flags.ACC_INVALID, values[3], values[4], values[5],
        IMPOSSIBLE_ACCELERATION, flags.ACC_ABSENT, flags.ACC_INVALID,
    )  # fmt: skip
    mag_flag, mx, my, mz = judge(
        word & flags.MAG_INVALID, values[6], values[7], values[8], IMPOSSIBLE_FIELD, flags.MAG_ABSENT, flags.MAG_INVALID
    )
    if c[USE_MAG] == 0.0:
        mx, my, mz = math.nan, math.nan, math.nan
    return _take(c, x, t_ns, word | gyr_flag | acc_flag | mag_flag, gx, gy, gz, ax, ay, az, mx, my, mz)


@cache  # a name that is registered again means another step
def filter_loops(name: str, step: Kernel[..., int]) -> Loops:
    """Batch and single-sample entries of a filter, compiled around its step."""
    module = load(name)
    look_on = see_field if hasattr(module, "COVARIANCE") else look
    take = specialise(_take, f"take_{name}", step=step, look=look_on)
    row = specialise(_row, f"row_{name}", _take=take)
    return Loops(
        batch=specialise(_batch, f"batch_{name}", inline=True, _row=row),
        single=specialise(_single, f"single_{name}", inline=True, _take=take),
    )


def _try_out(name: str, module: FilterModule) -> None:
    """Refuse the module of another package that cannot take one sample with its defaults."""
    try:
        defaults = {p.name: p.default for p in describe(module.Params)}
        if twice := ", ".join(p.name for p in describe(CommonParams) if p.name in defaults):
            raise ParameterError(f"every filter has the parameter {twice}; Params needs another name")
        params = build(module.Params, defaults, of=name)
        c, x = _coefficients(module, params, CommonParams(), Frame.ENU), np.zeros(OWN + module.STATE)
        x[Q] = 1.0
        word = module.step(c, x, 0.01, 0, 0.0, 0.0, 0.0, 0.0, 0.0, G0, 20.0, 0.0, -40.0)
        if not isinstance(word, int | np.integer):
            raise ParameterError(f"step must return flags, an int, but it returned {check.said(word)}")
        _require_unit(x[np.newaxis, Q : Q + 4])
    except Exception as error:
        raise EXTENSIBLE.unusable(name, error) from error


def _require_unit(q_nb: Floats) -> None:
    """Refuse attitudes (N, 4) that are no rotations."""
    off = np.abs(np.einsum("ij,ij->i", q_nb, q_nb) - 1.0)
    if not (off < _UNIT).all():
        i = int(np.flatnonzero(~(off < _UNIT))[0])
        raise ParameterError(f"step must leave x[Q] a unit quaternion, but sample {i} gave {q_nb[i].tolist()}")


def specialised() -> list[Kernel[..., Any]]:
    """Loops of all filters of which C is made."""
    all_loops = [filter_loops(name, load(name).step) for name in BUILT_IN]
    return [loop for loops in all_loops for loop in (loops.batch, loops.single)]


class AttitudeEstimator(FactsText):
    """What every filter has, and the smoother: parameters of its own and those of all, and what its headings mean."""

    name: str
    frame: Frame
    params: Any
    common: CommonParams
    _init: Start | None
    _decided: bool  # whether the declination was given, so that no recording changes it
    _idle: frozenset[str] = frozenset()  # common parameters that do nothing here
    _shown: tuple[str, ...] = ("params", "common")  # whose values the facts name

    def _set(self, kind: type[Any], given: Mapping[str, Any]) -> None:
        """Take parameters: those of its own kind, and the common ones."""
        own, shared = {p.name for p in describe(kind)}, {p.name for p in describe(CommonParams)} - self._idle
        for name in given:
            if name not in own | shared:
                names = [p.name for p in (*describe(kind), *describe(CommonParams)) if p.name not in self._idle]
                raise unknown_name("parameter", name, names, of=self.name)
        self.params = build(kind, {k: v for k, v in given.items() if k in own}, of=self.name)
        self.common = build(CommonParams, {k: v for k, v in given.items() if k in shared}, of=self.name)
        self._decided = "declination" in given

    def _require(self, needs: Sequence[str], data: ImuData, hint: str = "") -> None:
        """Refuse what is no samples, or samples without a triad that it needs."""
        check.kind("data", data, ImuData, hint="Of a Recording take its .imu.")
        if missing := [name for name in needs if name not in data.triads]:
            raise ShapeError(
                f"{self.name} needs {', '.join(needs)}, but the recording has no {', '.join(missing)}.{hint}"
            )

    def north(self, has_mag: bool) -> North:
        """What headings count from, of samples with or without a magnetometer."""
        if not (has_mag and self.common.mag):
            if self._init is None:
                return North.FREE
            if self._init.north is not None:
                return self._init.north
        return North.MAGNETIC if self.common.declination is None else North.TRUE

    def facts(self) -> Mapping[str, str]:
        """Name, frame, and the parameters that differ from their defaults."""
        changed = [
            f"{p.name}={shown(p, value)}"
            for holder in (getattr(self, name) for name in self._shown)
            for p in describe(type(holder))
            if p.name not in self._idle and (value := getattr(holder, p.name)) != getattr(type(holder)(), p.name)
        ]
        return {"name": self.name, "frame": str(self.frame), "params": ", ".join(changed) or "defaults"}

    def describe(self) -> str:
        """Name and parameters in one line, for provenance."""
        return _described(self.name, self.params, self.common, self._idle)


@cache  # every chunk of a stream carries it
def _described(name: str, params: Any, common: CommonParams, idle: frozenset[str]) -> str:
    pairs = ((p, getattr(holder, p.name)) for holder in (params, common) for p in describe(type(holder)))
    values = ", ".join(f"{p.name}={shown(p, value)}" for p, value in pairs if p.name not in idle)
    return f"{name}({values}) {EXTENSIBLE.whose(name)}".rstrip()


class Filter(AttitudeEstimator):
    """An estimator with its parameters and its state.

    Headings are true where the declination is known, from `params` or else from the meta, and magnetic where it is not;
    the track's ``north`` says which.

    Parameters
    ----------
    name : str
        As listed by `filter_names`.
    frame : Frame or str
        Navigation frame of the result, as ``Frame.ENU`` or ``"ENU"``; there is no default.
    params : Mapping, optional
        Parameters by name; numbers in SI, text with its unit. Unknown names are refused.
    noise : NoiseCard, optional
        Noise of the unit, for filters that take their noise parameters from it; `params` has the last word.
    init : array_like (4,), str or Start, optional
        Attitude q_nb to start from, ``"level"``, or ``"ROLL,PITCH,HEADING"`` with units, as ``"10deg,0deg,90deg"``;
        without it the first samples give tilt and heading.
    meta : ImuMeta, optional
        What is known about the samples that `update` will take; a recording that `process` takes brings its own.
    calibration : CalibrationCard or path, optional
        Card of the unit, by which samples and recordings are corrected first.

    Attributes
    ----------
    name, frame : str, Frame
        As given.
    params : NamedTuple
        The filter's own parameters, SI.
    common : CommonParams
        Declination in use, gap limit, use of the magnetometer.

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
        self,
        name: str,
        *,
        frame: Frame | str,
        params: Mapping[str, Any] | None = None,
        noise: "NoiseCard | None" = None,
        init: Start | ArrayLike | str | None = None,
        meta: ImuMeta | None = None,
        calibration: "CalibrationCard | str | Path | None" = None,
    ) -> None:
        self.name = name
        self.frame = frame = Frame.parse(frame)
        self.module = load(name)
        if name == SMOOTHER:
            raise ParameterError(
                "the smoother has a class of its own: plumbob.FixedLag(frame=...) takes single samples by the same "
                "update, and plumbob.estimate(recording) smooths a whole recording."
            )
        self._loops = filter_loops(name, self.module.step)
        if whose := EXTENSIBLE.whose(name):
            _try_out(name, self.module)
        self._whose = whose  # the package that may have errors of its own
        if params is not None and not isinstance(params, Mapping):
            example = '{"kp": 0.5, "gate": "0.08 g"}'
            raise ParameterError(f"params must be values by name, as in {example}, but it is {check.said(params)}.")
        given = {**({} if noise is None else self._from_noise(noise)), **(params or {})}
        self._set(self.module.Params, given)
        self._card, self._correct, self._meta = None, None, meta
        if calibration is not None:
            from plumbob.data.calibrated import calibrating

            self._card, self._correct, self._meta = calibrating(calibration, meta)
        places = ("COVARIANCE", "SENSITIVITY")  # of what a covariance is made of, in the state
        self._covariance: slice = next(
            (getattr(self.module, p) for p in places if hasattr(self.module, p)), slice(0, 0)
        )
        c = _coefficients(self.module, self.params, self.common, frame)
        self._s: Floats = np.concatenate((c, np.zeros(OWN + self.module.STATE)))  # one array: one pointer to pass
        self._c, self._x = self._s[: c.size], self._s[c.size :]
        self._q = self._x[Q : Q + 4]
        self._single = self._loops.single.compiled
        self._init = None if init is None else as_start(init, frame)
        self.reset()

    def reset(self) -> None:
        """Forget every sample; parameters and start attitude stay."""
        self._x[:] = 0.0
        self._x[Q] = 1.0
        if self._init is not None:
            self._x[Q : Q + 4] = self._init.q_nb
            self._x[STAGE] = layout.LEVEL if self._init.north is North.FREE else layout.HEADED
        meta = ImuMeta() if self._meta is None else self._meta
        self._count_from(meta.declination)
        self._left, self._gyr_left = meta.left, meta.gyr_left

    def _heed(self, meta: ImuMeta) -> None:
        """Take over what a recording knows, unless `params` have decided; headings never change zero on the way."""
        self._left, self._gyr_left = meta.left, meta.gyr_left
        if meta.declination is None or meta.declination == self.common.declination:
            return
        if self._x[layout.COUNT] > 0.0 and not self._decided:
            used = self.common.declination
            began = "without a" if used is None else f"with {to_deg(used):.6g}° of"
            raise FrameError(
                f"this filter began {began} declination, but the recording has {to_deg(meta.declination):.6g}°; call "
                "reset() before another recording."
            )
        self._count_from(meta.declination)

    def _from_noise(self, noise: "NoiseCard") -> Mapping[str, Any]:
        module: Any = self.module
        params: Mapping[str, Any] | None = module.from_noise(noise) if hasattr(module, "from_noise") else None
        if params is None:
            raise ParameterError(f"{self.name} has no parameter that a noise card could give; leave the card out.")
        return params

    def _count_from(self, declination: float | None) -> None:
        """Let headings count from the north that a declination, rad, tells, unless `params` have decided."""
        if not self._decided:
            self.common = self.common._replace(declination=declination)
            self._c[:] = _coefficients(self.module, self.params, self.common, self.frame)

    @property
    def q_nb(self) -> Floats:
        """Attitude now, (4,)."""
        return self._q.copy()

    @property
    def bias_b(self) -> Floats:
        """Gyroscope bias now, rad/s, (3,); zero for a filter that estimates none."""
        return self._x[BIAS : BIAS + 3].copy()

    @property
    def bias_prior(self) -> tuple[str, float] | None:
        """Parameter that is the standard deviation of the bias at the start, and its value, rad/s; None without one."""
        name: str | None = getattr(self.module, "BIAS_PRIOR", None)
        return None if name is None else (name, float(getattr(self.params, name)))

    @property
    def cov_b(self) -> Floats | None:
        """Covariance of the attitude error in body axes now, rad², (3, 3); None for a filter that claims none.

        It counts what the calibration leaves, as the meta of the recording or of the filter says; see
        `plumbob.filters.settling`.
        """
        place = self._covariance
        if place.start == place.stop:
            return None
        entries = np.concatenate((self._x[place], self._x[SEEN : SEEN + 2]))
        claimed = self._claimed(self._q[np.newaxis], entries[np.newaxis])
        return None if claimed is None else np.asarray(claimed[0])

    def _claimed(self, q_nb: Floats, entries: Floats) -> Floats | None:
        """Covariance (N, 3, 3) of the filter's own entries, and of what the calibration leaves, by the field seen.

        None of a filter that only a card tells what its rates are worth, where there is none.
        """
        module: Any = self.module
        from plumbob.filters.settling import considered, residual_covariance

        if hasattr(module, "SENSITIVITY"):
            unit = self._gyr_left
            return None if unit is None else residual_covariance(module.sensitivity(q_nb, entries[:, :-2]), unit)
        filter_cov: Floats = module.covariance(q_nb, entries[:, :-2])
        north = float(self._c[layout.NORTH_X]), float(self._c[layout.NORTH_Y])
        return filter_cov + considered(q_nb, entries[:, -2:], float(self._c[layout.UP]), north, *self._left)

    def process(self, data: ImuData, *, covariance: bool = False, look: bool = True) -> AttitudeTrack:
        """Take a recording, or its next chunk, and return the attitude at each of its samples.

        Parameters
        ----------
        data : ImuData
            The recording, or its next chunk.
        covariance : bool
            Keep the covariance of the attitude in the track, where the filter claims one.
        look : bool
            Look at the first recording for times, rates and signs that seem to be declared wrongly, and warn.

        Raises
        ------
        ShapeError
            If the recording lacks a triad that the filter needs.
        """
        self._require(self.module.NEEDS, data)
        data = data if self._card is None else self._card.correct(data, live=True)
        self._heed(data.meta)
        if look and self._x[layout.COUNT] == 0.0:
            _warn_of_doubts(data, self.frame)
        mag = data.usable("mag") if self.common.mag else check.read_only(np.full((len(data), 3), np.nan))
        n, place = len(data), self._covariance if covariance else slice(0, 0)
        q_nb, bias_b, words = np.empty((n, 4)), np.empty((n, 3)), np.empty(n, dtype=np.uint32)
        size = place.stop - place.start
        entries = np.empty((n if size else 0, size + 2))
        self._run(
            self._loops.batch.compiled, self._c, self._x, data.t_ns, data.flags, data.usable("gyr").ravel(),
            data.usable("acc").ravel(), mag.ravel(), q_nb.ravel(), bias_b.ravel(), words, place.start, entries,
        )  # fmt: skip
        if self._whose:
            self._run(_require_unit, q_nb)
        return AttitudeTrack.trusted(
            t=data.t,
            q_nb=q_nb,
            frame=self.frame,
            north=self.north("mag" in data.triads),
            bias_b=bias_b,
            cov_b=self._claimed(q_nb, entries) if size else None,
            flags=words,
            source=f"{self.describe()}; calibration {calibration_told(data.meta.calibration)}",
        )

    def update(self, sample: ImuSample) -> int:
        """Take the next sample and return its flags; `q_nb` is then the attitude at its time.

        What `ImuData` finds in a recording is found here too, absent and impossible values; what only the source knows,
        the ends of ranges and lost packets, are the flags of the sample. One filter serves one thread.

        Raises
        ------
        ShapeError
            If it is not a sample.
        """
        try:
            t_ns, marks = sample.t_ns, sample.flags  # first: a dict has values, too
            values = sample.values if self._correct is None else self._correct(sample).values
        except AttributeError:
            if isinstance(sample, ImuSample):
                raise
            raise ShapeError(f"update takes an ImuSample, but got {type(sample).__name__}.") from None
        if not self._whose:
            return self._single(self._s, t_ns, marks, values)
        word: int = self._run(self._single, self._s, t_ns, marks, values)
        self._run(_require_unit, self._q[np.newaxis])
        return word

    def _run(self, what: Callable[..., Any], *args: Any) -> Any:
        """Run what calls the step; an error of another package's names it."""
        try:
            return what(*args)
        except Exception as error:
            if not self._whose:
                raise
            raise EXTENSIBLE.unusable(self.name, error, "failed") from error

    def save(self) -> dict[str, Any]:
        """Everything needed to go on later, ready for JSON, which keeps every bit of a float."""
        return {
            "kind": "plumbob filter state",
            "version": STATE_VERSION,
            "filter": self.name,
            "frame": str(self.frame),
            "params": {**self.params._asdict(), **self._fixed()},
            "declination": self.common.declination,
            "left": [list(half) for half in self._left],
            "calibration": None if self._card is None else self._card.text(),
            "init": None
            if self._init is None
            else [self._init.q_nb.tolist(), self._init.north and str(self._init.north)],
            "state": self._x.tolist(),
        }

    @classmethod
    def restore(cls, saved: Mapping[str, Any]) -> Self:
        """Filter that goes on where `save` was called.

        Raises
        ------
        DecodeError
            If the mapping is not a saved state, of another version, or one that no filter can come to.
        """
        if not isinstance(saved, Mapping) or saved.get("kind") != "plumbob filter state":
            raise DecodeError("this is not a saved filter state. Give what Filter.save() returned.")
        if saved.get("version") != STATE_VERSION:
            raise DecodeError(f"the saved state has version {saved.get('version')}, but this is {STATE_VERSION}.")
        missing = {"filter", "frame", "params", "declination", "left", "calibration", "init", "state"} - set(saved)
        if missing:
            raise DecodeError(f"the saved state lacks {', '.join(sorted(missing))}.")
        frame, init = Frame.parse(saved["frame"]), _saved_start(saved["init"])
        card = None
        if saved["calibration"] is not None:
            from plumbob.data.cards import CalibrationCard

            card = CalibrationCard.from_text(saved["calibration"], "the card of the saved state")
        filter_ = cls(saved["filter"], frame=frame, params=saved["params"], init=init, calibration=card)
        state = check.column("state", saved["state"])
        if state.shape != filter_._x.shape or not np.isfinite(state).all():
            raise DecodeError(f"the saved state must be {filter_._x.size} finite numbers, but has {state.size}.")
        _require_plausible(state)
        meta = ImuMeta(declination=saved["declination"], acc_left=saved["left"][0], mag_left=saved["left"][1])
        filter_._count_from(meta.declination)
        filter_._left = meta.left
        filter_._x[:] = state
        return filter_

    def __reduce__(self) -> tuple[Any, ...]:
        """Copies and pickles go on from the same state with arrays of their own."""
        return type(self).restore, (self.save(),)

    def facts(self) -> Mapping[str, str]:
        """Name, frame, the parameters that differ from their defaults, and samples taken."""
        return {**super().facts(), "samples": f"{self._x[layout.COUNT]:.0f}"}

    def _fixed(self) -> dict[str, Any]:
        """Common parameters that were given, whatever a recording says."""
        return {k: v for k, v in self.common._asdict().items() if k != "declination" or self._decided}


def _coefficients(module: FilterModule, params: Any, common: CommonParams, frame: Frame) -> Floats:
    angle = common.declination or 0.0
    north = math.cos(angle) * frame.north + math.sin(angle) * frame.east
    shared = (frame.up[2], north[0], north[1], common.max_gap, 1.0 if common.mag else 0.0, trial_time(module.NEEDS))
    specific = module.coefficients(params)
    return np.array([1.0 + len(shared) + len(specific), *shared, *specific], dtype=np.float64)


def _saved_start(saved: Any) -> Start | None:
    if saved is None:
        return None
    if not isinstance(saved, list) or len(saved) != 2:
        raise DecodeError("'init' of the saved state must be an attitude and its north; it is damaged.")
    return Start(saved[0], None if saved[1] is None else North.parse(saved[1]))


def _warn_of_doubts(data: ImuData, frame: Frame) -> None:
    from plumbob.data.plausibility import doubts, upside_down

    first = data[:_LOOKED_AT]
    for doubt in (*doubts(first), *upside_down(first, frame)):
        warnings.warn(f"{doubt}.".replace("?.", "?"), PlumbobWarning, stacklevel=3)


def _require_plausible(state: Floats) -> None:
    """Refuse numbers that are finite and yet no state: from them a filter would go on with nonsense."""
    largest = float(
        np.abs(np.delete(state, slice(layout.LAST, layout.LAST + 3))).max()
    )  # what a sensor said may be anything
    if largest > _LARGEST:
        raise DecodeError(f"the saved state holds {largest:g}, more than any state; it is damaged.")
    size = float(np.linalg.norm(state[Q : Q + 4]))
    if not abs(size - 1.0) < _UNIT:
        raise DecodeError(f"the saved attitude must be a unit quaternion, but its norm is {size:g}; it is damaged.")
