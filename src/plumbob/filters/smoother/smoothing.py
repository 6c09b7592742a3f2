"""The smoother as a user meets it: parameters, a recording in, a track out."""

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from plumbob.core import check
from plumbob.core.constants import G0
from plumbob.core.errors import ParameterError, ShapeError
from plumbob.core.params import build, describe, shown
from plumbob.core.text import Shown
from plumbob.data import AttitudeTrack, ImuData, calibration_told
from plumbob.filters.base import CommonParams
from plumbob.filters.known import SMOOTHER
from plumbob.filters.smoother.keyframes import Keyframes
from plumbob.filters.smoother.model import BIAS_PRIOR, NEEDS, Params, from_noise
from plumbob.filters.smoother.passes import Carry, Smoothed, smooth
from plumbob.filters.smoother.remarks import remarks_of
from plumbob.filters.smoother.samples import Part, Stretch, continued, part_of, stretches, unknown
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
        self.process(ImuData(t=np.linspace(0.0, 0.2, 20), gyr=gyr, acc=acc, mag=mag))

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
        check.kind("data", data, ImuData, hint="Of a Recording take its .imu.")
        missing = [name for name in NEEDS if name not in data.triads]
        if missing:
            raise ShapeError(f"{SMOOTHER} needs {', '.join(NEEDS)}, but the recording has no {', '.join(missing)}.")
        if data.meta.declination is not None and not self._decided:
            self.common = self.common._replace(declination=data.meta.declination)
        parts, headed = self._parts(data, progress)
        return AttitudeTrack.trusted(
            t=data.t,
            q_nb=change_frame(np.concatenate([part.q for part in parts]), to=self.frame, from_=Frame.ENU),
            frame=self.frame,
            north=self.north(headed),
            bias_b=np.concatenate([part.bias for part in parts]),
            cov_b=np.concatenate([part.cov for part in parts]),
            flags=np.concatenate([part.flags for part in parts]),
            source=f"{self.describe()}; calibration {calibration_told(data.meta.calibration)}",
        )

    def _parts(self, data: ImuData, progress: Callable[[int], None] | None) -> tuple[list[Part], bool]:
        """Parts of a recording one after the other, and whether a field gives their headings."""
        parts: list[Part] = []
        remarks: dict[str, None] = {}
        last: tuple[Part, Stretch] | None = None
        carry: Carry | None = None
        headed = False
        for stretch in stretches(np.asarray(data.t), self.params.lag):
            whole, inside = data[stretch.whole], stretch.inside
            if (found := self.smooth(whole, carry)) is None:
                q = parts[-1].q[-1] if parts else np.array([1.0, 0.0, 0.0, 0.0])
                parts.append(unknown(whole[inside], q, np.zeros(3) if carry is None else carry.bias))
            else:
                part = part_of(whole, found, self.params)
                headed = headed or found.reference is not None
                if last is not None and found.reference is None:
                    part = continued(part, stretch, *last)
                last, carry = (part, stretch), Carry.after(found, carry)
                remarks |= dict.fromkeys(remarks_of(found, self.params, stretch, data.t))
                own = Part(part.q[inside], part.bias[inside], part.cov[inside], part.flags[inside])
                turn = self.common.declination if headed else None  # not before a field has shown itself
                parts.append(own._replace(q=turn_heading(own.q, turn, Frame.ENU)) if turn else own)
            if progress:
                progress(stretch.core.stop - stretch.core.start)
        if carry is None:
            raise ShapeError(f"{SMOOTHER} needs two samples with a rate, but the recording has fewer.")
        self.remarks = tuple(remarks)
        return parts, headed

    def smooth(self, data: ImuData, carry: Carry | None = None) -> Smoothed | None:
        """What `process` makes its track of, at the keyframes; `carry` is what came before. None without rates."""
        frames = Keyframes.of(data, self.params.keyframe, mag=self.common.mag)
        return None if frames is None else smooth(frames, self.params, carry)
