"""Other libraries on whole recordings, by their batch calls where they have one, with the signs that each asks for.

They are imported when they are asked for. All results are attitudes to east, north and up with a heading from magnetic
north, or from an arbitrary zero without a magnetometer. A library without time input runs with the median step.
"""

import re
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib import import_module
from typing import Any, Final, Protocol, TypeVar

import numpy as np

from plumbob.core.check import Floats
from plumbob.core.constants import G0
from plumbob.core.errors import ParameterError, ShapeError
from plumbob.core.units import to_deg
from plumbob.data import AttitudeTrack, ImuData
from plumbob.rotations import Frame, North, change_frame, quat_from_euler_zyx, quat_multiply


class Named(Protocol):
    """What a library gives, with its name in tables."""

    name: str


Made = TypeVar("Made", bound=Named)


def made(names: str, kinds: Mapping[str, Sequence[Callable[[Any], Made]]]) -> tuple[list[Made], dict[str, str]]:
    """Make what there is of each library that a comma list names, and say which are absent, with the reason.

    Parameters
    ----------
    names : str
        Libraries, or single ones of what they give, as vqf.offlineVQF, or all, or none.
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
    peers: list[Made] = []
    absent: dict[str, str] = {}
    for name in dict.fromkeys(wanted):
        of = re.split(r"[.(]", name)[0]
        if of not in kinds:
            raise ParameterError(f"there is no peer '{name}'; known are {', '.join(kinds)}, all and none.")
        try:
            library = import_module(of)
        except ImportError as error:
            absent[name] = f"{error}; pip install {of} brings it"
            continue
        each = [kind(library) for kind in kinds[of]]
        chosen = [peer for peer in each if name in {of, peer.name}]
        if not chosen:
            raise ParameterError(f"{of} gives no '{name}', but {', '.join(peer.name for peer in each)}.")
        peers += chosen
    return peers, absent


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

    def attitudes(self, gyr: Floats, acc: Floats, mag: Floats | None, step: float) -> Floats:
        """Attitudes (N, 4), body to ENU, of samples (N, 3) in rad/s, m/s² and µT, at a step in s; mag may be absent."""
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
        If the recording has no gyr or acc, if a triad is absent in some samples (each library treats that in its own
        way, or not at all), or if the library refuses the recording.
    """
    gyr, acc = (_complete(name, getattr(imu, name)) for name in ("gyr", "acc"))
    mag = None if imu.mag is None else _complete("mag", imu.mag)
    try:
        q: Floats = np.asarray(peer.attitudes(gyr, acc, mag, float(np.median(np.diff(imu.t)))), dtype=np.float64)
    except Exception as error:  # a library may raise anything
        raise ShapeError(f"{peer.name} refuses it: {type(error).__name__}: {error}") from error
    q = np.where(np.isfinite(q).all(axis=1, keepdims=True), q, np.nan)
    north, declination = North.FREE if mag is None else North.MAGNETIC, imu.meta.declination
    if declination is not None and mag is not None:
        q, north = quat_multiply(quat_from_euler_zyx([-declination, 0.0, 0.0]), q), North.TRUE
    q_nb = change_frame(q, to=frame, from_=Frame.ENU)
    return AttitudeTrack(t=imu.t, q_nb=q_nb, frame=frame, north=north, source=peer.settings)


def _complete(name: str, triad: Floats | None) -> Floats:
    """Own copy of a triad, because not every library leaves its input alone."""
    if triad is None or not np.isfinite(triad).all():
        raise ShapeError(f"peers run where no sample lacks what others have, but {name} is absent in some or all.")
    return np.array(triad)


@contextmanager
def quiet() -> Iterator[None]:
    """Keep warnings of a library off the terminal."""
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        yield


class Peer:
    """What the adapters share, those of the benchmark of faults too."""

    def __init__(self, library: Any) -> None:
        self.library = library

    def enu(self, q: Floats) -> Floats:
        """Return attitudes as they are."""
        return q


class _Vqf(Peer):
    """The compiled classes of vqf."""

    KIND = "VQF"

    def __init__(self, library: Any) -> None:
        super().__init__(library)
        self.name = f"vqf.{self.KIND}"
        self.settings = f"{self.name}, defaults"

    def attitudes(self, gyr: Floats, acc: Floats, mag: Floats | None, step: float) -> Floats:
        output = getattr(self.library, self.KIND)(step).updateBatch(gyr, acc, mag)
        return self.best(output)

    def best(self, output: Mapping[str, Floats]) -> Floats:
        """Attitude of a result, with its heading where it has one."""
        return output.get("quat9D", output["quat6D"])


class _BasicVqf(_Vqf):
    """Without rest detection, bias estimation and rejection of disturbances."""

    KIND = "BasicVQF"


class _OfflineVqf(_Vqf):
    """Forwards, backwards and smoothed: an attitude knows what comes after it."""

    KIND = "offlineVQF"

    def __init__(self, library: Any) -> None:
        super().__init__(library)
        self.settings = f"{self.name}, defaults; not causal: uses the whole recording"

    def attitudes(self, gyr: Floats, acc: Floats, mag: Floats | None, step: float) -> Floats:
        return self.best(self.library.offlineVQF(gyr, acc, mag, step))


TUNED_FUSION: Final = "imufusion.Ahrs, gain 0.5, gyroscope range 2000 °/s, rejection 10° and 10°, timeout 5 s, ENU"
FUSION_TUNING: Final[Mapping[str, float]] = {
    "gain": 0.5, "gyroscope_range": 2000.0,
    "acceleration_rejection": 10.0, "magnetic_rejection": 10.0, "rejection_timeout": 5.0,
}  # fmt: skip
"""Settings of x-io Fusion's own advanced example, in words and as attributes."""


def fusion_filter(library: Any, rate: float, tuning: Mapping[str, float]) -> Any:
    """Object of x-io Fusion with settings, at a nominal rate, Hz."""
    settings = library.AhrsSettings()
    settings.sample_rate = rate
    settings.convention = library.CONVENTION_ENU  # its constructor would ignore the argument
    for name, value in tuning.items():
        setattr(settings, name, value)
    filter_ = library.Ahrs()
    filter_.set_settings(settings)
    return filter_


class _Fusion(Peer):
    """x-io Fusion with its default settings."""

    name = "imufusion(default)"
    settings = "imufusion.Ahrs, defaults, ENU"
    TUNING: Mapping[str, float] = {}

    def attitudes(self, gyr: Floats, acc: Floats, mag: Floats | None, step: float) -> Floats:
        filter_ = fusion_filter(self.library, 1.0 / step, self.TUNING)
        take = filter_.update_no_magnetometer if mag is None else filter_.update
        triads = (self.rates(gyr, step), acc / G0, *(() if mag is None else (mag,)))
        q = np.empty((len(gyr), 4))
        for i, values in enumerate(zip(*triads, strict=True)):
            take(*values)
            q[i] = filter_.get_quaternion()
        return q

    def rates(self, gyr: Floats, step: float) -> Floats:
        """Rates as the filter wants them, °/s."""
        return to_deg(gyr)


class _FusionReadme(_Fusion):
    """As its README has it: rejection on, and its own estimate of the bias at rest taken off first."""

    name = "imufusion(readme)"
    settings = f"{TUNED_FUSION}; imufusion.Bias, defaults, before it"
    TUNING = FUSION_TUNING

    def rates(self, gyr: Floats, step: float) -> Floats:
        """Rates less the bias that the library has found so far, °/s."""
        settings = self.library.BiasSettings()
        settings.sample_rate = 1.0 / step
        bias = self.library.Bias()
        bias.set_settings(settings)
        return np.array([bias.update(rate) for rate in to_deg(gyr)])


class Ahrs(Peer):
    """One class of ahrs.

    Attributes
    ----------
    KIND, ARGUMENTS, START : str, Mapping, str
        Its name, what its constructor is given, and what it starts from, in words.
    """

    KIND = "Mahony"
    ARGUMENTS: Mapping[str, Any] = {}
    START = "started from the first sample"

    def __init__(self, library: Any) -> None:
        super().__init__(library)
        self.name = f"ahrs.{self.KIND}"
        shown = ", ".join(f"{name}={value}" for name, value in self.ARGUMENTS.items())
        self.settings = f"{self.name}({shown or 'defaults'}), {self.START}"

    def attitudes(self, gyr: Floats, acc: Floats, mag: Floats | None, step: float) -> Floats:
        """Attitudes (N, 4), body to ENU, of samples in rad/s, m/s² and µT at a step in s."""
        kind = getattr(self.library.filters, self.KIND)
        with quiet():
            return self.enu(kind(gyr=gyr, acc=acc, mag=mag, frequency=1.0 / step, **self.ARGUMENTS).Q)


class _BuoyMahony(Ahrs):
    """With the gains of the buoy paper, which it shares with our own."""

    ARGUMENTS: Mapping[str, Any] = {"k_P": 0.5, "k_I": 0.03}

    def __init__(self, library: Any) -> None:
        super().__init__(library)
        self.name += "(buoy paper)"


class Madgwick(Ahrs):
    """The gradient descent of the 2010 report."""

    KIND = "Madgwick"

    def enu(self, q: Floats) -> Floats:
        """Attitudes to a frame whose x axis is north and whose z axis is up."""
        return change_frame(q, to=Frame.ENU, from_=Frame.NWU)


class _EkfRun(Ahrs):
    """In NED, where it wants the direction of gravity, and with the dip of the field of the recording."""

    KIND = "EKF"

    def __init__(self, library: Any) -> None:
        super().__init__(library)
        self.settings = "ahrs.EKF(frame=NED, magnetic_ref=median dip of the recording), started from the first sample"

    def attitudes(self, gyr: Floats, acc: Floats, mag: Floats | None, step: float) -> Floats:
        dip_deg = 0.0 if mag is None else float(to_deg(np.median(_dip(acc, mag))))
        with quiet():
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
    "ahrs": (Madgwick, Ahrs, _BuoyMahony, _EkfRun),
}
