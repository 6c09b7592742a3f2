"""Further estimators beside the session's own, on the same samples; and a chain's posture from its units."""

from collections import deque
from collections.abc import Sequence
from typing import Any, Final

import numpy as np

from plumbob.arm import ArmEstimate, ArmStream, JointTrack
from plumbob.arm.estimation import INSIDE
from plumbob.calibration.predicted import NAMES, REGIONS
from plumbob.core import __version__
from plumbob.core.check import Floats
from plumbob.core.constants import G0
from plumbob.core.errors import ParameterError, unknown_name
from plumbob.core.time import to_ns
from plumbob.core.units import to_deg
from plumbob.data import ImuData, ImuMeta
from plumbob.filters import Filter, Start, estimator_names
from plumbob.filters.known import EXTENSIBLE
from plumbob.filters.offline import Stage, make_follower
from plumbob.filters.smoother import FixedLag, Smoother
from plumbob.live.sinks import Sink, joined_tracks
from plumbob.live.stream import ItemResult, Stream
from plumbob.reporting.arm import stick_points
from plumbob.rotations import Frame, North, change_frame, frame_rotation, quat_rotate
from plumbob.viewer.messages import Estimator, Skeleton
from plumbob.viewer.rows import Attitudes, RowLayout, ShownEstimator, rows_at, shown_estimator

MOST: Final = 8  # Overlays at the same time
_PARTS: Final = 64  # of another source that are looked at for its attitude
_MOTIONS: Final = 16  # parts of joint angles that are looked at
_JOINTS_LATE: Final = 0.2  # s; two keyframes


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


class JointFigure:
    """Joint angles of a chain and its stick figure, as a `plumbob.arm.ArmStream` has them.

    Angles come behind the samples by up to two keyframes, and are shown so late.
    """

    def __init__(self, follower: ArmStream, frame: Frame | None) -> None:
        chain, frame = follower.chain, frame or Frame.ENU
        self._chain = chain
        self._base = INSIDE[frame] if chain.base_fixed else Frame.ENU
        self._frame, self.names = frame, chain.angles
        points, lines = stick_points(chain, chain.postures(np.zeros((1, len(chain.angles))), np.eye(1, 4)))
        names = list(points)
        self.skeleton = Skeleton(points=names, lines=[[names.index(a), names.index(b)] for a, b in lines])
        self._motions: deque[ArmEstimate] = deque(maxlen=_MOTIONS)
        self.points: list[list[float]] | None = None  # of the stick figure, m, navigation axes

    def take(self, motion: ArmEstimate) -> None:
        """Take what the stream has given next."""
        self._motions.append(motion)
        self.points = self.stick(motion)[-1].tolist()

    def stick(self, motion: ArmEstimate) -> Floats:
        """Where the points of the stick figure are at each sample (N, P, 3), m, navigation axes."""
        points = stick_points(self._chain, motion.postures())[0].values()
        places = [np.broadcast_to(point, (len(motion.joints), 3)) for point in points]
        return np.asarray(quat_rotate(frame_rotation(self._frame, self._base), np.stack(places, axis=1)))

    def values(self, t: Floats) -> Floats:
        """Angles and standard deviations (N, 2K), degrees, at so late times (N,), s; NaN before the first."""
        if not self._motions:
            return np.full((t.size, 2 * len(self.names)), np.nan)
        return joint_values([motion.joints for motion in self._motions], t - _JOINTS_LATE)


def joint_values(tracks: Sequence[JointTrack], t: Floats) -> Floats:
    """Angles and standard deviations (N, 2K), degrees, as they are known at times (N,), s; NaN before the first."""
    stamps = np.concatenate([track.t for track in tracks])
    angles = np.concatenate([np.hstack((track.angles, track.sd)) for track in tracks if track.sd is not None])
    at = np.searchsorted(stamps, t, "right") - 1
    return to_deg(np.where(at[:, np.newaxis] < 0, np.nan, angles[at]))
