"""The smoother as a user meets it: parameters, a recording in, a track out."""

from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from plumbob.core import check
from plumbob.core.check import Floats
from plumbob.core.constants import G0
from plumbob.core.errors import ParameterError, ShapeError
from plumbob.core.params import build, describe, shown
from plumbob.core.text import Shown
from plumbob.data import AttitudeTrack, ImuData, calibration_told
from plumbob.data.cards.left import whole_of
from plumbob.filters.base import CommonParams
from plumbob.filters.known import SMOOTHER
from plumbob.filters.smoother.keyframes import Keyframes
from plumbob.filters.smoother.model import BIAS_PRIOR, NEEDS, Params, from_noise
from plumbob.filters.smoother.passes import Known, Learned, Smoothed, smooth
from plumbob.filters.smoother.remarks import remarks_of
from plumbob.filters.smoother.samples import Piece, Stretch, continued, part_of, stretches, unknown
from plumbob.rotations import Frame, North, change_frame
from plumbob.rotations.headings import turn_heading

if TYPE_CHECKING:
    from plumbob.data.cards import NoiseCard


class Smoother(Shown):
    """Attitude of a whole recording, each sample from what came before and after it.

    Parameters
    ----------
    frame : Frame or str
        Navigation frame of the result.
    params : Mapping, optional
        Parameters by name; numbers in SI, text with its unit. Those of every filter are taken too, but `max_gap`.
    noise : NoiseCard, optional
        Noise of the unit; `params` has the last word.

    Attributes
    ----------
    params : Params
        Its own parameters, SI.
    common : CommonParams
        Declination in use, use of the magnetometer.
    remarks : tuple of str
        What a reader of the last track should know: what could not be known, and when.
    learned : Learned or None
        What the last recording showed of the gyroscope.

    Raises
    ------
    ParameterError
        If a parameter is not known.

    Examples
    --------
    >>> from plumbob.filters.smoother import Smoother
    >>> Smoother(frame="ENU", params={"latency": "2.6 ms"}).params.latency
    0.0026
    """

    name = SMOOTHER

    def __init__(
        self, *, frame: Frame | str, params: Mapping[str, Any] | None = None, noise: "NoiseCard | None" = None
    ) -> None:
        self.frame = Frame.parse(frame)
        given = {**({} if noise is None else from_noise(noise)), **(params or {})}
        own = {p.name for p in describe(Params)}
        shared = {p.name for p in describe(CommonParams)} - {"max_gap"}
        for name in given:
            if name not in own | shared:
                raise ParameterError(
                    f"{SMOOTHER} has no parameter '{name}'; known are {', '.join((*sorted(own), *sorted(shared)))}."
                )
        self.params: Params = build(Params, {k: v for k, v in given.items() if k in own}, of=SMOOTHER)
        self.common: CommonParams = build(CommonParams, {k: v for k, v in given.items() if k in shared}, of=SMOOTHER)
        self._decided = "declination" in given
        self.remarks: tuple[str, ...] = ()
        self.learned: Learned | None = None

    @property
    def bias_prior(self) -> tuple[str, float]:
        """Parameter that is the standard deviation of the bias before the recording, and its value, rad/s."""
        return BIAS_PRIOR, float(getattr(self.params, BIAS_PRIOR))

    def facts(self) -> Mapping[str, str]:
        """Name, frame, and the parameters that differ from their defaults."""
        usual = Params()
        changed = [
            f"{p.name}={shown(p, value)}"
            for p in describe(Params)
            if (value := getattr(self.params, p.name)) != getattr(usual, p.name)
        ]
        return {"name": self.name, "frame": str(self.frame), "params": ", ".join(changed) or "defaults"}

    def describe(self) -> str:
        """Name and parameters in one line, for provenance."""
        pairs = [
            (p, getattr(holder, p.name))
            for holder in (self.params, self.common)
            for p in describe(type(holder))
            if p.name != "max_gap"
        ]
        return f"{self.name}({', '.join(f'{p.name}={shown(p, value)}' for p, value in pairs)})"

    def north(self, has_mag: bool) -> North:
        """What headings count from, of samples with or without a magnetometer."""
        if not (has_mag and self.common.mag):
            return North.FREE
        return North.MAGNETIC if self.common.declination is None else North.TRUE

    def warm_up(self) -> None:
        """Compile now, so that the first recording does not wait."""
        gyr, acc, mag = (np.tile(still, (20, 1)) for still in ([0.0] * 3, [0.0, 0.0, G0], [0.0, 20.0, -40.0]))
        Smoother(frame=self.frame).process(ImuData(t=np.linspace(0.0, 0.2, 20), gyr=gyr, acc=acc, mag=mag))

    def process(self, data: ImuData, *, progress: Callable[[int], None] | None = None) -> AttitudeTrack:
        """Attitude, bias and covariance at every sample of a recording.

        A long recording is smoothed in stretches that overlap, and so is one with a fixed lag; each leaves its bias and
        the field of the place to the next.

        Parameters
        ----------
        data : ImuData
            The recording.
        progress : callable, optional
            Called with the number of samples done since the last call.

        Raises
        ------
        ShapeError
            If a triad is missing that it needs, or a recording has fewer than two samples with a rate.
        """
        return AttitudeTrack.joined(self.parts(data, progress=progress), len(data))

    def parts(self, data: ImuData, *, progress: Callable[[int], None] | None = None) -> Iterator[AttitudeTrack]:
        """Parts of the track that `process` gives, as they are done; what headings count from is right in the last.

        Arguments and errors are those of `process`. A stretch of the recording is asked for at a time.
        """
        check.kind("data", data, ImuData, hint="Of a Recording take its .imu.")
        missing = [name for name in NEEDS if name not in data.triads]
        if missing:
            raise ShapeError(f"{SMOOTHER} needs {', '.join(NEEDS)}, but the recording has no {', '.join(missing)}.")
        if data.meta.declination is not None and not self._decided:
            self.common = self.common._replace(declination=data.meta.declination)
        turn, rated, headed = self.common.declination, False, False
        self.remarks = ()
        for piece in self._live(data) if self.params.lag == 0.0 else self._stretches(data):
            part, t, rated = piece.part, piece.t, rated or piece.rated
            begin, headed = 0 if headed else piece.headed, headed or piece.headed < len(t)
            turned = part.q
            if turn and headed:  # headings are true from where a field has shown itself
                turned = np.concatenate((turned[:begin], turn_heading(turned[begin:], turn, Frame.ENU)))
            if progress:
                progress(len(t))
            track = AttitudeTrack.trusted(
                t=t,
                q_nb=change_frame(turned, to=self.frame, from_=Frame.ENU),
                frame=self.frame,
                north=self.north(headed),
                bias_b=part.bias,
                cov_b=part.cov,
                flags=part.flags,
                source=f"{self.describe()}; calibration {calibration_told(data.meta.calibration)}",
            )
            del piece, part, turned  # whoever takes the track, and the next stretch, may need their room
            yield track
            del track
        if not rated:
            raise ShapeError(f"{SMOOTHER} needs two samples with a rate, but the recording has fewer.")

    def _stretches(self, data: ImuData) -> Iterator[Piece]:
        """Stretches that overlap, each smoothed by itself."""
        remarks: dict[str, None] = {}
        last: tuple[Floats, Stretch] | None = None
        known, q_last = _known(data), np.array([1.0, 0.0, 0.0, 0.0])
        for stretch in list(stretches(data.t, self.params.lag)):  # a list: the times of all are not kept
            whole, inside = data[stretch.whole], stretch.inside
            found = self.smooth(whole, known)
            if found is None:
                part = unknown(whole, q_last, np.zeros(3) if known.bias is None else known.bias)
            else:
                part = part_of(whole, found, self.params)
                if last is not None and found.reference is None:
                    part = continued(part, stretch, *last)
                last, known, self.learned = (part.q, stretch), known.after(found), found.learned
                remarks |= dict.fromkeys(remarks_of(found, self.params, whole.t[inside]))
            q_last, self.remarks = part.q[inside][-1].copy(), tuple(remarks)
            headed = 0 if found is not None and found.reference is not None else inside.stop - inside.start
            pieces = [Piece(whole.t[inside], part.rows(inside), headed, found is not None)]
            del whole, part, found  # whoever takes the piece may need their room
            yield pieces.pop()

    def _live(self, data: ImuData) -> Iterator[Piece]:
        """Stretches one after the other, nothing of which knows what comes later."""
        from plumbob.filters.smoother.live import live_parts

        remarks: dict[str, None] = {}
        for piece, found, told in live_parts(data, self.params, _known(data), mag=self.common.mag):
            self.learned = self.learned if found is None else found.learned
            remarks |= dict.fromkeys(told)
            self.remarks = tuple(remarks)
            yield piece

    def smooth(self, data: ImuData, known: Known | None = None) -> Smoothed | None:
        """What `process` makes its track of, at the keyframes; `known` is what came before. None without rates."""
        frames = Keyframes.of(data, self.params.keyframe, mag=self.common.mag)
        return None if frames is None else smooth(frames, self.params, known or _known(data))


def _known(data: ImuData) -> Known:
    """What the unit's card says of its gyroscope."""
    left = data.meta.gyr_left
    return Known() if left is None else Known(unit=whole_of(left))
