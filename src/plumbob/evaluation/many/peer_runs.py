"""Other libraries on whole recordings, by their batch calls where they have one, with the signs that each asks for.

All results are attitudes to east, north and up with a heading from magnetic north. A library without time input runs
with the median step. The streaming adapters of the same libraries are in `plumbob.evaluation.many.peers`.
"""

from collections.abc import Mapping, Sequence
from typing import Any, Final, Protocol

import numpy as np

from plumbob.core.check import Floats
from plumbob.core.constants import G0
from plumbob.core.errors import ShapeError
from plumbob.core.units import to_deg
from plumbob.data import AttitudeTrack, ImuData
from plumbob.evaluation.many.peers import Ahrs, BasicVqf, Fusion, FusionTuned, Madgwick, Vqf, made
from plumbob.rotations import Frame, North, change_frame, quat_from_euler_zyx, quat_multiply


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


class _Ekf(_Ahrs):
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
    "ahrs": (_Madgwick, _Ahrs, _BuoyMahony, _Ekf),
}
