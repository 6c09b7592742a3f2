"""Adapters to other libraries: same samples, same clock, each with the calls and signs that its own examples use.

They are imported when they are asked for. Each starts as its constructor leaves it; those of ahrs start from the
identity. A peer without time input runs with its nominal step.

Other libraries on whole recordings, by their batch calls where they have one, with the signs that each asks for.

All results are attitudes to east, north and up with a heading from magnetic north. A library without time input runs
with the median step. The streaming adapters of the same libraries are in `plumbob.evaluation.many.peers`.
"""

import warnings
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from importlib import import_module
from typing import Any, Final, Protocol, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from plumbob.core.check import Floats
from plumbob.core.constants import G0
from plumbob.core.errors import ParameterError, ShapeError
from plumbob.core.units import to_deg
from plumbob.data import AttitudeTrack, ImuData
from plumbob.evaluation.many.contender import Construction, Contender, Running
from plumbob.evaluation.many.fault_scene import DIP_DEG, RATE, Row
from plumbob.rotations import Frame, North, change_frame, quat_conjugate, quat_from_euler_zyx, quat_multiply

STEP = 1.0 / RATE

Made = TypeVar("Made")


def peers(names: str) -> tuple[list[Contender], dict[str, str]]:
    """Contenders of the libraries that a comma list names, and those that are absent, with the reason.

    Raises
    ------
    ParameterError
        If a library is not known here.
    """
    return made(names, _LIBRARIES)


def made(names: str, kinds: Mapping[str, Sequence[Callable[[Any], Made]]]) -> tuple[list[Made], dict[str, str]]:
    """Make what there is of each library that a comma list names, and say which are absent, with the reason.

    Parameters
    ----------
    names : str
        Libraries, or all, or none.
    kinds : Mapping
        By library: what is made of the imported library.

    Raises
    ------
    ParameterError
        If a library is not known here.
    """
    wanted = [name.strip() for name in names.split(",") if name.strip()]
    if wanted in (["all"], ["none"]):
        wanted = list(kinds) if wanted == ["all"] else []
    found: list[Made] = []
    absent: dict[str, str] = {}
    for name in dict.fromkeys(wanted):
        if name not in kinds:
            raise ParameterError(f"there is no peer '{name}'; known are {', '.join(kinds)}, all and none.")
        try:
            library = import_module(name)
        except ImportError as error:
            absent[name] = f"{error}; pip install {name} brings it"
            continue
        found += [kind(library) for kind in kinds[name]]
    return found, absent


class _Peer(ABC):
    """What the adapters share.

    Attributes
    ----------
    RATE_ARGUMENTS : tuple of float
        What its constructor is given in the battery of impossible rates; steps for those that take a step.
    """

    timed = True
    none_is_absent = False
    can_kill = False
    words: Mapping[int, str] = {}
    RATE_ARGUMENTS: tuple[float, ...] = (0.0, -RATE, float("nan"), float("inf"))

    def __init__(self, library: Any) -> None:
        self.library = library

    @abstractmethod
    def start(self, rate: float = RATE) -> Running:
        """Make a fresh one."""

    def constructions(self) -> list[Construction]:
        """Rates, or steps, that are none."""
        return [Construction(f"rate {value:g}", partial(self.start, value)) for value in self.RATE_ARGUMENTS]

    @contextmanager
    def quiet(self) -> Iterator[None]:
        """Keep warnings of the library off the terminal."""
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            yield

    def enu(self, q: Floats) -> Floats:
        """Return attitudes as they are."""
        return q


class _Clock:
    """Steps from time stamps, as a user's loop makes them."""

    def __init__(self) -> None:
        self._last: float | None = None

    def step(self, t_ns: float) -> float:
        """Time since the last stamp, s; the nominal step at first."""
        last, self._last = self._last, t_ns
        return STEP if last is None else (t_ns - last) / 1e9


class _RunningVqf:
    def __init__(self, filter_: Any) -> None:
        self._filter = filter_
        self._notes_field = hasattr(filter_, "getMagDistDetected")

    def take(self, row: Row) -> int:
        _, gyr, acc, mag, _ = row
        if mag is None:
            self._filter.update(gyr, acc)
        else:
            self._filter.update(gyr, acc, mag)
        return int(self._notes_field and self._filter.getMagDistDetected())

    def give(self, gyr: Floats, acc: Any, mag: Floats | None) -> None:
        self._filter.update(gyr, acc, mag)

    def attitude(self) -> ArrayLike:
        q: ArrayLike = self._filter.getQuat9D()
        return q


class Vqf(_Peer):
    """The compiled classes of vqf, with a magnetometer."""

    timed = False
    can_kill = True
    words: Mapping[int, str] = {1: "magDistDetected"}
    RATE_ARGUMENTS = (0.0, -STEP, float("nan"), float("inf"))
    KIND = "VQF"

    def __init__(self, library: Any) -> None:
        super().__init__(library)
        self.name = f"vqf.{self.KIND}"
        self.settings = f"{self.name}({STEP:g} s), defaults"

    def start(self, rate: float = STEP) -> Running:
        """Make a fresh one, at a step in s."""
        return _RunningVqf(getattr(self.library, self.KIND)(rate))


class BasicVqf(Vqf):
    """Without rest detection, bias estimation and rejection of disturbances."""

    KIND = "BasicVQF"


class _RunningFusion:
    def __init__(self, filter_: Any) -> None:
        self._filter, self._clock = filter_, _Clock()

    def take(self, row: Row) -> int:
        t_ns, gyr, acc, mag, _ = row
        self._filter.set_sample_period(self._clock.step(t_ns))
        if mag is None:
            self._filter.update_no_magnetometer(to_deg(gyr), acc / G0)
        else:
            self._filter.update(to_deg(gyr), acc / G0, mag)
        said, inner = self._filter.get_flags(), self._filter.get_internal_states()
        found = (said.startup, said.overrange_recovery, said.acceleration_recovery, said.magnetic_recovery,
                 inner.accelerometer_ignored, inner.magnetometer_ignored)  # fmt: skip
        return sum(1 << i for i, up in enumerate(found) if up)

    def give(self, gyr: Floats, acc: Any, mag: Floats | None) -> None:
        self._filter.update(to_deg(gyr), acc, mag)

    def attitude(self) -> ArrayLike:
        q: ArrayLike = self._filter.get_quaternion()
        return q


class Fusion(_Peer):
    """x-io Fusion with its default settings."""

    name = "imufusion(default)"
    settings = "imufusion.Ahrs, defaults, ENU"
    TUNING: Mapping[str, float] = {}
    words: Mapping[int, str] = {
        1: "startup", 2: "overrange_recovery", 4: "acceleration_recovery", 8: "magnetic_recovery",
        16: "accelerometer_ignored", 32: "magnetometer_ignored",
    }  # fmt: skip

    def start(self, rate: float = RATE) -> Running:
        """Make a fresh one, at a rate in Hz."""
        return _RunningFusion(self.make(rate))

    def make(self, rate: float) -> Any:
        """Object of the library with its settings, at a nominal rate, Hz."""
        settings = self.library.AhrsSettings()
        settings.sample_rate = rate
        settings.convention = self.library.CONVENTION_ENU  # its constructor would ignore the argument
        for name, value in self.TUNING.items():
            setattr(settings, name, value)
        filter_ = self.library.Ahrs()
        filter_.set_settings(settings)
        return filter_


class FusionTuned(Fusion):
    """x-io Fusion with the settings of its own advanced example, rejection on."""

    name = "imufusion(tuned)"
    settings = "imufusion.Ahrs, gain 0.5, gyroscope range 2000 °/s, rejection 10° and 10°, timeout 5 s, ENU"
    TUNING: Mapping[str, float] = {
        "gain": 0.5, "gyroscope_range": 2000.0,
        "acceleration_rejection": 10.0, "magnetic_rejection": 10.0, "rejection_timeout": 5.0,
    }  # fmt: skip


class _RunningAhrs:
    """Calls of Madgwick, Mahony and AQUA, which agree."""

    def __init__(self, filter_: Any) -> None:
        self._filter, self._clock, self._q = filter_, _Clock(), np.array([1.0, 0.0, 0.0, 0.0])

    def take(self, row: Row) -> int:
        t_ns, gyr, acc, mag, _ = row
        self._update(gyr, acc, mag, self._clock.step(t_ns))
        return 0

    def give(self, gyr: Floats, acc: Any, mag: Floats | None) -> None:
        self._update(gyr, acc, mag, STEP)

    def _update(self, gyr: Floats, acc: Any, mag: Floats | None, dt: float) -> None:
        if mag is None:
            self._q = self._filter.updateIMU(self._q, gyr, acc, dt=dt)
        else:
            self._q = self._filter.updateMARG(self._q, gyr, acc, mag, dt=dt)

    def attitude(self) -> ArrayLike:
        return np.array(self._q, dtype=np.float64)


class _RunningEkf(_RunningAhrs):
    """The EKF of ahrs: it wants −g in its ENU frame, and reads whether there is a magnetometer from an attribute."""

    def take(self, row: Row) -> int:
        t_ns, gyr, acc, mag, known = row
        return super().take((t_ns, gyr, -acc, mag, known))

    def _update(self, gyr: Floats, acc: Any, mag: Floats | None, dt: float) -> None:
        self._filter.mag = mag
        self._q = self._filter.update(self._q, gyr, acc, mag, dt=dt)


class Ahrs(_Peer):
    """One class of ahrs."""

    KIND = "Mahony"
    RUNNING = _RunningAhrs
    ARGUMENTS: Mapping[str, Any] = {}

    def __init__(self, library: Any) -> None:
        super().__init__(library)
        self.name = f"ahrs.{self.KIND}"
        shown = ", ".join(f"{name}={value}" for name, value in self.ARGUMENTS.items())
        self.settings = f"{self.name}({shown or 'defaults'}), streamed from the identity"

    def start(self, rate: float = RATE) -> Running:
        """Make a fresh one, at a rate in Hz."""
        return self.RUNNING(getattr(self.library.filters, self.KIND)(frequency=rate, **self.ARGUMENTS))


class Madgwick(Ahrs):
    """The gradient descent of the 2010 report."""

    KIND = "Madgwick"

    def enu(self, q: Floats) -> Floats:
        """Attitudes to a frame whose x axis is north and whose z axis is up."""
        return change_frame(q, to=Frame.ENU, from_=Frame.NWU)


class _Ekf(Ahrs):
    KIND = "EKF"
    RUNNING = _RunningEkf
    ARGUMENTS: Mapping[str, Any] = {"frame": "ENU", "magnetic_ref": DIP_DEG}


class _Aqua(Ahrs):
    KIND = "AQUA"

    def enu(self, q: Floats) -> Floats:
        """Attitudes of a frame whose x axis is north and whose z axis is up, to the body."""
        return change_frame(quat_conjugate(q), to=Frame.ENU, from_=Frame.NWU)


_LIBRARIES: Final[Mapping[str, tuple[Any, ...]]] = {
    "vqf": (Vqf, BasicVqf),
    "imufusion": (Fusion, FusionTuned),
    "ahrs": (Madgwick, Ahrs, _Ekf, _Aqua),
}


class PeerRun(Protocol):
    """A peer that takes a recording at once.

    Attributes
    ----------
    name : str
        As in the tables.
    settings : str
        What runs, in one line.
    """

    name: str
    settings: str

    def whole(self, gyr: Floats, acc: Floats, mag: Floats, step: float) -> Floats:
        """Attitudes (N, 4), body to ENU, of samples (N, 3) in rad/s, m/s² and µT, at a step in s."""
        ...


def peer_runs(names: str) -> tuple[list[PeerRun], dict[str, str]]:
    """Peers of the libraries that a comma list names, and those that are absent, with the reason.

    Raises
    ------
    ParameterError
        If a library is not known here.
    """
    return made(names, _RUNS)


def peer_track(peer: PeerRun, imu: ImuData, *, frame: Frame) -> AttitudeTrack:
    """What a peer makes of a recording; headings are true where the recording knows its declination.

    Raises
    ------
    ShapeError
        If a triad is absent, in one sample or in all (each library treats that in its own way, or not at all), or if
        the library refuses the recording.
    """
    gyr, acc, mag = (_complete(name, getattr(imu, name)) for name in ("gyr", "acc", "mag"))
    try:
        q: Floats = np.asarray(peer.whole(gyr, acc, mag, float(np.median(np.diff(imu.t)))), dtype=np.float64)
    except Exception as error:  # a library may raise anything
        raise ShapeError(f"{peer.name} refuses it: {type(error).__name__}: {error}") from error
    q = np.where(np.isfinite(q).all(axis=1, keepdims=True), q, np.nan)
    north, declination = North.MAGNETIC, imu.meta.declination
    if declination is not None:
        q, north = quat_multiply(quat_from_euler_zyx([-declination, 0.0, 0.0]), q), North.TRUE
    q_nb = change_frame(q, to=frame, from_=Frame.ENU)
    return AttitudeTrack(t=imu.t, q_nb=q_nb, frame=frame, north=north, source=peer.settings)


def _complete(name: str, triad: Floats | None) -> Floats:
    """Own copy of a triad, because not every library leaves its input alone."""
    if triad is None or not np.isfinite(triad).all():
        raise ShapeError(f"peers run where every sample has gyr, acc and mag, but {name} is absent in some or all.")
    return np.array(triad)


class _Vqf(Vqf):
    def __init__(self, library: Any) -> None:
        super().__init__(library)
        self.settings = f"{self.name}, defaults"

    def whole(self, gyr: Floats, acc: Floats, mag: Floats, step: float) -> Floats:
        q: Floats = getattr(self.library, self.KIND)(step).updateBatch(gyr, acc, mag)["quat9D"]
        return q


class _BasicVqf(_Vqf):
    KIND = BasicVqf.KIND


class _OfflineVqf(_Vqf):
    """Forwards, backwards and smoothed: an attitude knows what comes after it."""

    KIND = "offlineVQF"

    def __init__(self, library: Any) -> None:
        super().__init__(library)
        self.settings = f"{self.name}, defaults; not causal: uses the whole recording"

    def whole(self, gyr: Floats, acc: Floats, mag: Floats, step: float) -> Floats:
        q: Floats = self.library.offlineVQF(gyr, acc, mag, step)["quat9D"]
        return q


class _Fusion(Fusion):
    def whole(self, gyr: Floats, acc: Floats, mag: Floats, step: float) -> Floats:
        filter_ = self.make(1.0 / step)
        q = np.empty((len(gyr), 4))
        for i, (rate, force, field) in enumerate(zip(self.rates(gyr, step), acc / G0, mag, strict=True)):
            filter_.update(rate, force, field)
            q[i] = filter_.get_quaternion()
        return q

    def rates(self, gyr: Floats, step: float) -> Floats:
        """Rates as the filter wants them, °/s."""
        return to_deg(gyr)


class _FusionReadme(_Fusion):
    """As its README has it: rejection on, and its own estimate of the bias at rest taken off first."""

    name = "imufusion(readme)"
    settings = f"{FusionTuned.settings}; imufusion.Bias, defaults, before it"
    TUNING = FusionTuned.TUNING

    def rates(self, gyr: Floats, step: float) -> Floats:
        """Rates less the bias that the library has found so far, °/s."""
        settings = self.library.BiasSettings()
        settings.sample_rate = 1.0 / step
        bias = self.library.Bias()
        bias.set_settings(settings)
        return np.array([bias.update(rate) for rate in to_deg(gyr)])


class _Ahrs(Ahrs):
    def __init__(self, library: Any) -> None:
        super().__init__(library)
        self.settings = self.settings.replace("streamed from the identity", "started from the first sample")

    def whole(self, gyr: Floats, acc: Floats, mag: Floats, step: float) -> Floats:
        kind = getattr(self.library.filters, self.KIND)
        with self.quiet():
            return self.enu(kind(gyr=gyr, acc=acc, mag=mag, frequency=1.0 / step, **self.ARGUMENTS).Q)


class _BuoyMahony(_Ahrs):
    """With the gains of the buoy paper, which it shares with our own."""

    ARGUMENTS: Mapping[str, Any] = {"k_P": 0.5, "k_I": 0.03}

    def __init__(self, library: Any) -> None:
        super().__init__(library)
        self.name += "(buoy paper)"


class _Madgwick(_Ahrs):
    KIND = Madgwick.KIND
    enu = Madgwick.enu


class _EkfRun(_Ahrs):
    """In NED, where it wants the direction of gravity, and with the dip of the field of the recording."""

    KIND = "EKF"

    def __init__(self, library: Any) -> None:
        super().__init__(library)
        self.settings = "ahrs.EKF(frame=NED, magnetic_ref=median dip of the recording), started from the first sample"

    def whole(self, gyr: Floats, acc: Floats, mag: Floats, step: float) -> Floats:
        dip_deg = float(to_deg(np.median(_dip(acc, mag))))
        with self.quiet():
            run = self.library.filters.EKF(
                gyr=gyr, acc=-acc, mag=mag, frequency=1.0 / step, frame="NED", magnetic_ref=dip_deg
            )
        return change_frame(run.Q, to=Frame.ENU, from_=Frame.NED)


def _dip(acc: Floats, mag: Floats) -> Floats:
    """Angle of the field below the plane across the specific force, rad."""
    norms = np.linalg.norm(acc, axis=1) * np.linalg.norm(mag, axis=1)
    return np.asarray(np.arcsin(-np.sum(acc * mag, axis=1) / norms))


_RUNS: Final[Mapping[str, Sequence[Any]]] = {
    "vqf": (_Vqf, _BasicVqf, _OfflineVqf),
    "imufusion": (_Fusion, _FusionReadme),
    "ahrs": (_Madgwick, _Ahrs, _BuoyMahony, _EkfRun),
}
