"""Further estimators beside the session's own, on the same samples; and a chain's posture from its units."""

from collections import deque
from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np

from plumbob.calibration.predicted import NAMES, REGIONS
from plumbob.core import __version__, flags
from plumbob.core.check import Floats
from plumbob.core.constants import G0
from plumbob.core.errors import ParameterError, unknown_name
from plumbob.core.time import to_ns
from plumbob.data import ImuData, ImuMeta
from plumbob.data.chain import Chain, Posture
from plumbob.filters import Filter, Start, estimator_names
from plumbob.filters.known import EXTENSIBLE
from plumbob.filters.offline import Stage, make_follower
from plumbob.filters.smoother import FixedLag, Smoother
from plumbob.live.sinks import Sink, joined_tracks
from plumbob.live.stream import ItemResult, Stream, UnitPart
from plumbob.reporting.arm import stick_points
from plumbob.rotations import Frame, North, change_frame, quat_conjugate, quat_multiply, quat_rotate
from plumbob.viewer.messages import Estimator, Skeleton
from plumbob.viewer.rows import Attitudes, RowLayout, ShownEstimator, rows_at, shown_estimator

MOST: Final = 8  # Overlays at the same time
_PARTS: Final = 64  # of another source that are looked at for its attitude
_OF_UNITS: Final = "mekf"  # What estimates each unit of a chain
_ABSENT: Final = np.uint32(flags.GYR_ABSENT | flags.ACC_ABSENT)


def addable(triads: Sequence[str]) -> list[str]:
    """Names of estimators that work on samples with these triads as they come."""
    usable = EXTENSIBLE.usable(estimator_names())
    return [name for name, module in usable if set(module.NEEDS) <= set(triads)]


def require_addable(name: str, triads: Sequence[str], *, beside: int) -> None:
    """Refuse an estimator that does not work on samples with these triads, or one more than `MOST`."""
    if name not in (names := addable(triads)):
        raise unknown_name("estimator for these samples", name, names)
    if beside >= MOST:
        raise ParameterError(f"{MOST} estimators at most are shown beside the first; remove one.")


def greeting(layout: RowLayout, frame: Frame | None) -> dict[str, Any]:
    """What `messages.Hello` says of a line and of a recording alike."""
    running = {shown.name for shown in layout.shown}
    return {
        "frame": None if frame is None else str(frame),
        "axes": "FRD" if frame is Frame.NED else "FLU",
        "columns": layout.columns,
        "estimators": layout.estimators,
        "filters": [] if frame is None else [name for name in addable(layout.triads) if name not in running],
        "regions": REGIONS.tolist(),
        "regions_names": NAMES,
        "gravity": G0,
        "version": __version__,
    }


def frame_faults(stream: Stream) -> dict[str, Any]:
    """What `messages.Link` says of a stream's bytes and frames."""
    counts = stream.decoder.counts
    rejected = counts.bad_checksum + counts.bad_content + counts.bad_length + counts.unknown
    return {"junk": counts.junk, "rejected": rejected, "unusable": stream.faults}


def described(filter_: Filter | Smoother | FixedLag) -> str:
    """Filter with what differs from its defaults."""
    params = filter_.facts()["params"]
    return filter_.name if params == "defaults" else f"{filter_.name} ({params})"


class Overlay:
    """An estimator that runs beside the primary one; the smoother then has no lag.

    It goes on from the attitude `start`, or where that is None from its first samples.
    """

    def __init__(self, name: str, frame: Frame, meta: ImuMeta, start: Start | None = None) -> None:
        self.name = name
        self._filter = make_follower(Stage(name, {}), frame, meta, start=start)
        self._frame = frame

    @property
    def shown(self) -> ShownEstimator:
        """As its columns need it."""
        return shown_estimator(self.name, self.name, described(self._filter), primary=False)

    def take(self, imu: ImuData) -> Attitudes:
        """Attitudes at the next samples."""
        if not isinstance(self._filter, FixedLag):
            track = self._filter.process(imu, covariance=True, look=False)
            return Attitudes.from_track(track, None, self._filter.common.declination)
        ready = self._filter.take(imu)
        if ready is None:
            return Attitudes.unknown(len(imu), self._frame, self._filter.north(False))
        rows = None if len(ready) == len(imu) else rows_at(to_ns(imu.t), to_ns(ready.t))
        return Attitudes.from_track(ready, rows, self._filter.common.declination)

    def close(self) -> None:
        """End it."""
        if isinstance(self._filter, FixedLag):
            self._filter.finish()


class SourceOverlay(Sink):
    """Attitude of another source, shown beside the first one's at its samples: the newest that had come."""

    def __init__(self, name: str, stream: Stream) -> None:
        title = stream.beside[name].session.form.title
        self.shown = ShownEstimator(Estimator(name=name, title=title, primary=False, claims=False), biased=False)
        self._stream, self._other = stream, stream.beside[name]
        self._parts: deque[ItemResult] = deque(maxlen=_PARTS)

    def on_part(self, part: ItemResult) -> None:
        """Take what has come of it."""
        if part.track is not None:
            self._parts.append(part)

    def take(self, imu: ImuData) -> Attitudes:
        """Attitudes at the next samples of the first source."""
        frame = self._stream.session.frame or Frame.NED
        track = joined_tracks(part.track for part in self._parts)
        if track is None or self._stream.t0_ns is None:
            return Attitudes.unknown(len(imu), frame, North.FREE)
        stamps = self._other.in_clock(self._stream, np.concatenate([part.track_ns for part in self._parts]))
        at = np.searchsorted(stamps, imu.t_ns + self._stream.t0_ns, "right") - 1
        q_nb = np.where(at[:, np.newaxis] < 0, np.nan, track.q_nb[at])
        return Attitudes(change_frame(q_nb, to=frame, from_=track.frame), frame, track.north)


class ChainFollower:
    """Follows a chain, whose joints all have places, by an estimator on each of its units."""

    def __init__(self, chain: Chain, frame: Frame, units: Sequence[str]) -> None:
        if not chain.known:
            raise ParameterError(f"the chain {chain.name} does not say where its joints lie; use a card of arm align.")
        carried = {segment.unit: segment for segment in chain.segments if segment.unit}
        if not carried.keys() & set(units):
            raise ParameterError(
                f"the chain {chain.name} has the units {', '.join(carried)}, but the line has {', '.join(units)}."
            )
        self._chain, self._frame = chain, frame
        self._segments = {unit: segment for unit, segment in carried.items() if unit in units}
        self._filters = {unit: Filter(_OF_UNITS, frame=frame) for unit in self._segments}
        self._now: dict[str, Floats] = {}
        identity = np.array([[1.0, 0.0, 0.0, 0.0]])
        points, lines = stick_points(chain, chain.postures(np.zeros((1, len(chain.angles))), identity[0]))
        names = list(points)
        self.skeleton = Skeleton(points=names, lines=[[names.index(a), names.index(b)] for a, b in lines])

    def take(self, units: Mapping[str, ImuData]) -> None:
        """Follow the next samples of each unit, calibrated."""
        self._now = {name: q_nb[-1] for name, q_nb in self.along(units).items()}

    def along(self, units: Mapping[str, ImuData]) -> dict[str, Floats]:
        """Attitudes (N, 4) of the segments at the next samples of each unit; NaN where it is silent."""
        attitudes = {}
        for unit, segment in self._segments.items():
            imu = units[unit]
            q_ns = self._filters[unit].process(imu, look=False).q_nb
            silent = (imu.flags & _ABSENT) == _ABSENT
            q_nb = quat_multiply(q_ns, quat_conjugate(np.array(segment.mount.q_bs)))
            attitudes[segment.name] = np.where(silent[:, np.newaxis], np.nan, q_nb)
        return attitudes

    @property
    def points(self) -> list[list[float] | None]:
        """Where the points of the stick figure are, m, navigation axes; None behind a unit that is missing."""
        return self.joint_points(self._now)

    def joint_points(self, attitudes: Mapping[str, Floats]) -> list[list[float] | None]:
        """The same of attitudes (4,) of the segments that have a unit."""
        stick = stick_points(self._chain, self._postures(attitudes))[0]
        return [point[0].tolist() if np.isfinite(point).all() else None for point in map(np.atleast_2d, stick.values())]

    def _postures(self, attitudes: Mapping[str, Floats]) -> dict[str, Posture]:
        """Where each segment is; one without a unit stands as it is drawn on its parent, the root upright."""
        postures, units = dict[str, Posture](), {segment.name: segment.unit for segment in self._chain.segments}

        def attitude(segment: str, drawn: Floats) -> Floats:
            q_nb = attitudes.get(segment, np.full(4, np.nan)) if units[segment] else drawn
            return q_nb[np.newaxis]

        root = self._chain.segments[0].name
        upright = change_frame(np.array([1.0, 0.0, 0.0, 0.0]), to=self._frame, from_=Frame.NWU)  # and x to North
        postures[root] = Posture(attitude(root, upright), np.zeros((1, 3)))
        for joint in self._chain.joints:
            parent = postures[joint.parent]
            at = parent.pos_n + quat_rotate(parent.q_nb, np.array(joint.place))
            drawn = quat_multiply(parent.q_nb[0], np.array(joint.q_pc))
            postures[joint.child] = Posture(attitude(joint.child, drawn), at)
        return postures


def joined_units(parts: Sequence[Mapping[str, UnitPart]]) -> dict[str, ImuData]:
    """Calibrated samples of each unit, of parts that follow each other."""
    return {name: ImuData.joined([part[name].imu for part in parts]) for name in parts[0]} if parts else {}
