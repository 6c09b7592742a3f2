"""Adapters to other libraries: same samples, same clock, each with the calls and signs that its own examples use.

They are imported when they are asked for. Each starts as its constructor leaves it; those of ahrs start from the
identity. A peer without time input runs with its nominal step. Whole recordings: `plumbob.fleet.experiments.peers`.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from contextlib import AbstractContextManager
from functools import partial
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike

from benchmarks.harness.contender import Answer, Construction, Contender, Running, one_by_one
from benchmarks.harness.fault_scene import DIP_DEG, RATE, Row, Stream
from plumbob.core.check import Floats
from plumbob.core.constants import G0
from plumbob.core.units import to_deg
from plumbob.fleet.experiments.peers import FUSION_TUNING, TUNED_FUSION, ahrs_settings, fusion_filter, made, quiet
from plumbob.rotations import Frame, change_frame, quat_conjugate

STEP = 1.0 / RATE


def peers(names: str) -> tuple[list[Contender], dict[str, str]]:
    """Contenders of the libraries that a comma list names, and those that are absent, with the reason.

    Raises
    ------
    ParameterError
        If a library is not known here.
    """
    return made(names, _LIBRARIES)


class _Peer(ABC):
    """What the adapters share.

    Attributes
    ----------
    RATE_ARGUMENTS : tuple of float
        What its constructor is given in the battery of impossible rates; steps for those that take a step.
    """

    name: str
    settings: str
    FRAME = Frame.ENU
    timed = True
    none_is_absent = False
    can_kill = False
    words: Mapping[int, str] = {}
    alarms = 0
    RATE_ARGUMENTS: tuple[float, ...] = (0.0, -RATE, float("nan"), float("inf"))

    def __init__(self, library: Any) -> None:
        self.library = library

    def enu(self, q: Floats) -> Floats:
        """Attitudes that are to its frame."""
        return change_frame(q, to=Frame.ENU, from_=self.FRAME)

    @abstractmethod
    def start(self, rate: float = RATE) -> Running:
        """Make a fresh one."""

    def fed(self, stream: Stream) -> Answer:
        """Answer to a stream, sample by sample."""
        return one_by_one(self, stream)

    answer = fed

    def constructions(self) -> list[Construction]:
        """Rates, or steps, that are none."""
        return [Construction(f"rate {value:g}", partial(self.start, value)) for value in self.RATE_ARGUMENTS]

    def quiet(self) -> AbstractContextManager[None]:
        """Keep warnings of the library off the terminal."""
        return quiet()


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
    alarms = 1  # all that it can say
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
    alarms = 1 | 2 | 4 | 8  # not what it ignores: see ALARMS of our filters

    def start(self, rate: float = RATE) -> Running:
        """Make a fresh one, at a rate in Hz."""
        return _RunningFusion(fusion_filter(self.library, rate, self.TUNING))


class FusionTuned(Fusion):
    """x-io Fusion with the settings of its own advanced example, rejection on."""

    name = "imufusion(tuned)"
    settings = TUNED_FUSION
    TUNING = FUSION_TUNING


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
    ARGUMENTS: Mapping[str, Any] = {}
    RUNNING = _RunningAhrs

    def __init__(self, library: Any) -> None:
        super().__init__(library)
        self.name = f"ahrs.{self.KIND}"
        self.settings = ahrs_settings(self.KIND, self.ARGUMENTS, "streamed from the identity")

    def start(self, rate: float = RATE) -> Running:
        """Make a fresh one, at a rate in Hz."""
        return self.RUNNING(getattr(self.library.filters, self.KIND)(frequency=rate, **self.ARGUMENTS))


class Madgwick(Ahrs):
    """The gradient descent of the 2010 report."""

    KIND = "Madgwick"
    FRAME = Frame.NWU


class _Ekf(Ahrs):
    KIND = "EKF"
    RUNNING = _RunningEkf
    ARGUMENTS: Mapping[str, Any] = {"frame": "ENU", "magnetic_ref": DIP_DEG}


class _Aqua(Ahrs):
    KIND = "AQUA"
    FRAME = Frame.NWU

    def enu(self, q: Floats) -> Floats:
        """It gives attitudes of that frame to the body."""
        return super().enu(quat_conjugate(q))


_LIBRARIES: Final[Mapping[str, tuple[Any, ...]]] = {
    "vqf": (Vqf, BasicVqf),
    "imufusion": (Fusion, FusionTuned),
    "ahrs": (Madgwick, Ahrs, _Ekf, _Aqua),
}
