"""Other libraries on whole recordings, by their batch calls where they have one, with the signs that each asks for.

They are imported when they are asked for. All results are attitudes to east, north and up with a heading from magnetic
north, or from an arbitrary zero without a magnetometer. A library without time input runs with the median step.
"""

import re
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from importlib import import_module
from typing import Any, Final, NamedTuple

import numpy as np

from plumbob.core.check import Floats
from plumbob.core.constants import G0
from plumbob.core.errors import ParameterError, ShapeError, unknown_name
from plumbob.core.units import to_deg
from plumbob.data import AttitudeTrack, ImuData
from plumbob.rotations import Frame, North, change_frame, quat_from_euler_zyx, quat_multiply


def made(names: str, kinds: Mapping[str, Sequence[Callable[[Any], Any]]]) -> tuple[list[Any], dict[str, str]]:
    """Make what there is of each library that a comma list names, or of all, and say which are absent, and why."""
    wanted = [name.strip() for name in names.split(",") if name.strip()]
    if wanted in (["all"], ["none"]):
        wanted = list(kinds) if wanted == ["all"] else []
    peers, absent = list[Any](), dict[str, str]()
    for name in dict.fromkeys(wanted):
        of = re.split(r"[.(]", name)[0]
        if of not in kinds:
            raise unknown_name("peer", name, (*kinds, "all", "none"))
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


class PeerRun(NamedTuple):
    """A peer that takes a recording at once."""

    name: str  # as in the tables
    settings: str  # what runs, in one line
    # attitudes (N, 4), body to ENU, of samples (N, 3) in rad/s, m/s² and µT, where the last ones may be absent, at a
    # step in s
    attitudes: Callable[[Floats, Floats, Floats | None, float], Floats]


def peer_track(peer: PeerRun, imu: ImuData, *, frame: Frame) -> AttitudeTrack:
    """What a peer makes of a recording; headings are true where the recording knows its declination.

    ShapeError if gyr or acc is missing in some samples, which each library treats in its own way, or if it refuses.
    """
    gyr, acc = (_complete(name, getattr(imu, name)) for name in ("gyr", "acc"))
    mag = None if imu.mag is None else _complete("mag", imu.mag)
    try:
        q: Floats = np.asarray(peer.attitudes(gyr, acc, mag, float(np.median(np.diff(imu.t)))), dtype=np.float64)
    except Exception as error:  # a library may raise anything
        raise ShapeError(f"{peer.name} rejects it: {type(error).__name__}: {error}") from error
    q = np.where(np.isfinite(q).all(axis=1, keepdims=True), q, np.nan)
    north, declination = North.FREE if mag is None else North.MAGNETIC, imu.meta.declination
    if declination is not None and mag is not None:
        q, north = quat_multiply(quat_from_euler_zyx([-declination, 0.0, 0.0]), q), North.TRUE
    q_nb = change_frame(q, to=frame, from_=Frame.ENU)
    return AttitudeTrack(t=imu.t, q_nb=q_nb, frame=frame, north=north, source=peer.settings)


def _complete(name: str, triad: Floats | None) -> Floats:
    """Own copy of a triad, because not every library leaves its input alone."""
    if triad is None or not np.isfinite(triad).all():
        raise ShapeError(f"peers need every sensor in every sample, but {name} is missing in some or all.")
    return np.array(triad)


@contextmanager
def quiet() -> Iterator[None]:
    """Keep warnings of a library off the terminal."""
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        yield


def _vqf(kind: str, library: Any) -> PeerRun:
    """One of the compiled classes of vqf."""
    offline = kind == "offlineVQF"

    def attitudes(gyr: Floats, acc: Floats, mag: Floats | None, step: float) -> Floats:
        make = getattr(library, kind)
        output = make(gyr, acc, mag, step) if offline else make(step).updateBatch(gyr, acc, mag)
        q: Floats = output.get("quat9D", output["quat6D"])
        return q

    more = "; not causal: uses the whole recording" if offline else ""
    return PeerRun(f"vqf.{kind}", f"vqf.{kind}, defaults{more}", attitudes)


TUNED_FUSION: Final = "imufusion.Ahrs, gain 0.5, gyroscope range 2000 °/s, rejection 10° and 10°, timeout 5 s, ENU"
FUSION_TUNING: Final[Mapping[str, float]] = {  # settings of x-io Fusion's own advanced example
    "gain": 0.5, "gyroscope_range": 2000.0,
    "acceleration_rejection": 10.0, "magnetic_rejection": 10.0, "rejection_timeout": 5.0,
}  # fmt: skip


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


def _fusion(name: str, settings: str, tuning: Mapping[str, float], bias: bool, library: Any) -> PeerRun:
    """x-io Fusion with some settings; where its README says so, with its own estimate of the bias taken off first."""

    def attitudes(gyr: Floats, acc: Floats, mag: Floats | None, step: float) -> Floats:
        filter_ = fusion_filter(library, 1.0 / step, tuning)
        take = filter_.update_no_magnetometer if mag is None else filter_.update
        rates = _less_bias(library, to_deg(gyr), step) if bias else to_deg(gyr)
        q = np.empty((len(gyr), 4))
        for i, values in enumerate(zip(rates, acc / G0, *(() if mag is None else (mag,)), strict=True)):
            take(*values)
            q[i] = filter_.get_quaternion()
        return q

    return PeerRun(f"imufusion({name})", settings, attitudes)


def _less_bias(library: Any, rates: Floats, step: float) -> Floats:
    """Rates less the bias that x-io Fusion has found so far, °/s."""
    settings, bias = library.BiasSettings(), library.Bias()
    settings.sample_rate = 1.0 / step
    bias.set_settings(settings)
    return np.array([bias.update(rate) for rate in rates])


def ahrs_settings(kind: str, arguments: Mapping[str, Any], start: str) -> str:
    """What runs of ahrs, in one line: the class, what its constructor is given, and from what it starts."""
    shown = ", ".join(f"{name}={value}" for name, value in arguments.items())
    return f"ahrs.{kind}({shown or 'defaults'}), {start}"


def _ahrs(kind: str, label: str, frame: Frame, arguments: Mapping[str, Any], library: Any) -> PeerRun:
    """One class of ahrs, whose attitudes are to a frame."""

    def attitudes(gyr: Floats, acc: Floats, mag: Floats | None, step: float) -> Floats:
        given = dict(arguments)
        if kind == "EKF":  # in NED it wants the direction of gravity, and the dip of the field
            dip_deg = 0.0 if mag is None else float(to_deg(np.median(_dip(acc, mag))))
            given, acc = {"frame": "NED", "magnetic_ref": dip_deg}, -acc
        with quiet():
            run = getattr(library.filters, kind)(gyr=gyr, acc=acc, mag=mag, frequency=1.0 / step, **given)
        return change_frame(run.Q, to=Frame.ENU, from_=frame)

    return PeerRun(f"ahrs.{kind}{label}", ahrs_settings(kind, arguments, "started from the first sample"), attitudes)


def _dip(acc: Floats, mag: Floats) -> Floats:
    """Angle of the field below the plane across the specific force, rad."""
    norms = np.linalg.norm(acc, axis=1) * np.linalg.norm(mag, axis=1)
    return np.asarray(np.arcsin(-np.sum(acc * mag, axis=1) / norms))


# By library: what is made of it; the gains of the buoy paper are those of our own filter.
_RUNS: Final[Mapping[str, Sequence[Callable[[Any], PeerRun]]]] = {
    "vqf": [partial(_vqf, kind) for kind in ("VQF", "BasicVQF", "offlineVQF")],
    "imufusion": [
        partial(_fusion, "default", "imufusion.Ahrs, defaults, ENU", {}, False),
        partial(_fusion, "readme", f"{TUNED_FUSION}; imufusion.Bias, defaults, before it", FUSION_TUNING, True),
    ],
    "ahrs": [
        partial(_ahrs, "Madgwick", "", Frame.NWU, {}),
        partial(_ahrs, "Mahony", "", Frame.ENU, {}),
        partial(_ahrs, "Mahony", "(buoy paper)", Frame.ENU, {"k_P": 0.5, "k_I": 0.03}),
        partial(_ahrs, "EKF", "", Frame.NED, {"frame": "NED", "magnetic_ref": "median dip of the recording"}),
    ],
}
peer_runs: Final[Callable[[str], tuple[list[PeerRun], dict[str, str]]]] = partial(made, kinds=_RUNS)
