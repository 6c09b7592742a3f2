"""The smoother as a user meets it: parameters, a recording or a stream in, a track out."""

import itertools
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from plumbob.core.check import Floats
from plumbob.core.errors import ParameterError, ShapeError
from plumbob.core.findings import Finding
from plumbob.core.time import Repeats
from plumbob.data import AttitudeTrack, ImuData, ImuMeta, calibration_told
from plumbob.data.cards.residuals import full_covariance
from plumbob.data.sample import ImuSample
from plumbob.filters.base import AttitudeEstimator
from plumbob.filters.known import CAUSAL_LAG, SMOOTHER
from plumbob.filters.smoother import samples
from plumbob.filters.smoother.inertial import GIVEN, Given
from plumbob.filters.smoother.keyframes import Keyframes
from plumbob.filters.smoother.model import BIAS_PRIOR, NEEDS, Params, from_noise
from plumbob.filters.smoother.passes import Known, Learned, Smoothed, smooth
from plumbob.filters.smoother.per_sample import CurrentEstimate, Single
from plumbob.filters.smoother.preprocess import watched
from plumbob.filters.smoother.remarks import remarks_before, remarks_so_far, stretch_remarks, unit_remarks
from plumbob.filters.smoother.samples import Piece, Stretch
from plumbob.filters.start import Start, as_start
from plumbob.rotations import Frame, North, change_frame
from plumbob.rotations.frames import turn_heading

if TYPE_CHECKING:
    from pathlib import Path

    from plumbob.data.cards import CalibrationCard, NoiseCard
    from plumbob.filters.smoother.live import Between, Live


class Smoother(AttitudeEstimator):
    """Attitude of a whole recording, each sample from what came before and after it.

    Parameters
    ----------
    frame : Frame or str
        Navigation frame of the result.
    params : Mapping, optional
        Parameters by name; numbers in SI, text with its unit. Those of every filter are taken too, but `max_gap`.
    noise : NoiseCard, optional
        Noise of the unit; `params` has the last word.
    init : array_like (4,), str or Start, optional
        Attitude at the first sample that has a rate, as `Filter` takes it: its tilt is then known to a degree, unless
        the first seconds contradict it. Its heading counts where no field gives one: a field has the last word.
    meta : ImuMeta, optional
        What is known about the samples that `update` will take; a recording brings its own.

    Attributes
    ----------
    params : Params
        Its own parameters, SI.
    common : CommonParams
        Declination in use, use of the magnetometer.
    remarks : tuple of Finding
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
    _idle = frozenset({"max_gap"})
    _shown = ("params",)
    params: Params

    def __init__(
        self,
        *,
        frame: Frame | str,
        params: Mapping[str, Any] | None = None,
        noise: "NoiseCard | None" = None,
        init: Start | ArrayLike | str | None = None,
        meta: ImuMeta | None = None,
    ) -> None:
        self.frame = Frame.parse(frame)
        self._init = None if init is None else as_start(init, self.frame)
        given = {**({} if noise is None else from_noise(noise)), **(params or {})}
        self._set(Params, given)
        self._meta = meta or ImuMeta()
        self._heed(self._meta)
        self.remarks: tuple[Finding, ...] = ()
        self.learned: Learned | None = None

    @property
    def bias_prior(self) -> tuple[str, float]:
        """Parameter that is the standard deviation of the bias before the recording, and its value, rad/s."""
        return BIAS_PRIOR, float(getattr(self.params, BIAS_PRIOR))

    @property
    def _given(self) -> Given | None:
        """The start in the frame inside."""
        if self._init is None:
            return None
        return Given(change_frame(self._init.q_nb, to=Frame.ENU, from_=self.frame), self._init.north is not North.FREE)

    def process(self, data: ImuData, *, progress: Callable[[int], None] | None = None) -> AttitudeTrack:
        """Attitude, bias and covariance at every sample of a recording.

        A long recording is smoothed in stretches that overlap, and so is one with a fixed lag; each leaves its bias and
        the field of the place to the next.

        `data`: the recording; `progress`: called with the number of samples done since the last call. Raises ShapeError
        if a triad is missing that it needs, or a recording has fewer than two samples with a rate.
        """
        return AttitudeTrack.joined(self.parts(data, progress=progress), len(data))

    def parts(self, data: ImuData, *, progress: Callable[[int], None] | None = None) -> Iterator[AttitudeTrack]:
        """Parts of the track that `process` gives, as they are done; what headings count from is right in the last.

        Arguments and errors are those of `process`. A stretch of the recording is asked for at a time.
        """
        self._begin(data)
        lag, tracks = self.params.lag, _Tracks(self, data.meta)
        if lag is not None:
            pieces = self._live(data)
        else:  # stretches that overlap, each smoothed by itself; a list of them: the times of all are not kept
            along = Along(self, data.meta, remarks_before(data))
            pieces = (along.piece(data[stretch.span], stretch) for stretch in list(samples.stretches(data.t)))
        for piece in pieces:
            if progress:
                progress(len(piece.t))
            track = tracks.track(piece)
            del piece  # whoever takes the track, and the next stretch, may need its room
            yield track
            del track
        if not tracks.rated:
            raise ShapeError(f"{SMOOTHER} needs two samples with a rate, but the recording has fewer.")

    def _begin(self, data: ImuData) -> None:
        """Refuse what cannot be smoothed, and take over what the recording, or the first of a stream, knows."""
        self._require(NEEDS, data, " No gyr: --filter tilt_compass; no acc: integrate; a report: --filter none.")
        self._heed(data.meta)
        self.remarks = ()

    def _heed(self, meta: ImuMeta) -> None:
        """Take over the declination that is known, unless `params` have decided."""
        if meta.declination is not None and not self._decided:
            self.common = self.common._replace(declination=meta.declination)

    def _live(self, data: ImuData) -> Iterator[Piece]:
        """Parts one after the other, nothing of which knows what comes later than the lag."""
        from plumbob.filters.smoother.live import Live

        live = Live(self.params, data.meta, mag=self.common.mag, start=self._given)
        remarks = dict[Finding, None]()
        t, word, remaining = list[Floats](), list[NDArray[np.uint32]](), len(data)
        for rows in itertools.chain(data.chunks(AT_ONCE), [None]):
            if (piece := live.finish() if rows is None else live.take(rows)) is None:
                continue
            t.append(piece.t)
            word.append(piece.part.flags)
            remaining -= len(piece.t)
            if t[-1][-1] - t[0][0] > samples.CORE or not remaining:
                lines = remarks_so_far(np.array(live.gaps), np.concatenate(t), np.concatenate(word), mag=live.has_field)
                remarks |= dict.fromkeys(lines)
                t, word, self.remarks = [], [], (*remarks, *unit_remarks(live.smoothed, self.params))
            self.learned = self.learned if live.smoothed is None else live.smoothed.learned
            yield piece

    def smooth(self, data: ImuData, known: Known | None = None) -> Smoothed | None:
        """What `process` makes its track of, at the keyframes; `known` is what came before. None without rates."""
        frames = Keyframes.from_imu(data, self.params.keyframe, mag=self.common.mag)
        return None if frames is None else smooth(frames, self.params, known or _prior(data.meta, self._given))


def _prior(meta: ImuMeta, start: Given | None) -> Known:
    """What the unit's card says of its gyroscope, and the first attitude."""
    residual = meta.gyr_left
    return Known(unit=None if residual is None else full_covariance(residual)[:12, :12], start=start)


AT_ONCE: Final = 4096  # samples that are followed at a time; the result does not depend on it


class Along:
    """Stretches one after the other: each leaves its bias and the field of the place to the next.

    `smoother`: gets the remarks, and what is learned of the gyroscope; `meta`: of the samples; `remarks`: what is to be
    said of them already.
    """

    def __init__(self, smoother: Smoother, meta: ImuMeta, remarks: Sequence[Finding] = ()) -> None:
        self._smoother = smoother
        self._start = start = smoother._given
        self._known = _prior(meta, start)
        self._attitude = np.array([1.0, 0.0, 0.0, 0.0]) if start is None else start.q
        self._last: tuple[Floats, Stretch] | None = None
        self._free_variance = 0.0  # of a heading without a field, where the next core begins, rad²
        self._remarks, self._of_unit = dict.fromkeys(remarks), list[Finding]()

    def piece(self, data: ImuData, stretch: Stretch) -> Piece:
        """Core of a stretch, of whose samples `data` are all."""
        smoother, inside, data = self._smoother, stretch.inside, watched(data)
        self._known = replace(self._known, start=None if stretch.span.start else self._start)
        smoothed = smoother.smooth(data, self._known)
        if smoothed is None:
            part = samples.unknown(
                data, self._attitude, np.zeros(3) if self._known.bias is None else self._known.bias[0]
            )
        else:
            heading_var = None  # of a given heading where the stretch begins, beyond what comes from the one before
            if self._start is not None and self._start.headed:
                heading_var = 0.0 if stretch.span.start else GIVEN**2
            part = samples.sample_part(data, smoothed, smoother.params, heading_var)
            if self._last is not None and smoothed.reference is None:
                part = samples.continued(part, stretch, *self._last)
                part = part._replace(cov=samples.widened(part.q, part.cov, self._before(part, inside.start)))
            self._free_variance = (
                samples.heading_variance_at(part, inside.stop - 1) if smoothed.reference is None else 0.0
            )
            self._last, self._known, smoother.learned = (part.q, stretch), self._known.after(smoothed), smoothed.learned
            self._remarks |= dict.fromkeys(stretch_remarks(smoothed, data.t[inside]))
            self._of_unit = unit_remarks(smoothed, smoother.params)
        self._attitude, smoother.remarks = part.q[inside][-1].copy(), (*self._remarks, *self._of_unit)
        headed = 0 if smoothed is not None and smoothed.reference is not None else inside.stop - inside.start
        return Piece(data.t[inside], part.rows(inside), headed, smoothed is not None)

    def _before(self, part: samples.SampleEstimates, begin: int) -> Floats:
        """What a free heading was uncertain by before the core that begins at a sample, rad², beyond what it now is."""
        return np.full(len(part.q), max(self._free_variance - samples.heading_variance_at(part, begin), 0.0))


class _Tracks:
    """Pieces one after the other as tracks in the frame that was asked for; `rated`: whether any had rates."""

    def __init__(self, smoother: Smoother, meta: ImuMeta) -> None:
        self._smoother = smoother
        self._source = f"{smoother.describe()}; calibration {calibration_told(meta.calibration)}"
        self._headed = self.rated = False

    def turns(self) -> Floats:
        """What `track` multiplies in front of a next attitude, one after the other, (n, 4)."""
        turn, frame, identity = self._smoother.common.declination, self._smoother.frame, np.array([1.0, 0.0, 0.0, 0.0])
        turns = [turn_heading(identity, turn, Frame.ENU)] if turn and self._headed else []
        turns += [] if frame is Frame.ENU else [change_frame(identity, to=frame, from_=Frame.ENU)]
        return np.reshape(turns, (-1, 4))

    def track(self, piece: Piece) -> AttitudeTrack:
        """Track of a piece; headings are true from where a field has shown itself."""
        smoother, part, t = self._smoother, piece.part, piece.t
        self.rated |= piece.rated
        begin, self._headed = 0 if self._headed else piece.headed, self._headed or piece.headed < len(t)
        turned, turn = part.q, smoother.common.declination
        if turn and self._headed:
            turned = np.concatenate((turned[:begin], turn_heading(turned[begin:], turn, Frame.ENU)))
        return AttitudeTrack.trusted(
            t=t,
            q_nb=change_frame(turned, to=smoother.frame, from_=Frame.ENU),
            frame=smoother.frame,
            north=smoother.north(self._headed),
            bias_b=part.bias,
            cov_b=part.cov,
            flags=part.flags,
            mag_weight=part.weight,
            source=self._source,
        )


class FixedLag(Smoother):
    """The smoother on a stream: parts in, attitudes out as soon as nothing that may still come can change them.

    They come as much later as the parameter ``lag`` says, at once where it is zero, and are those of `Smoother` with
    that lag, to the bit, however the stream is cut. Arguments and attributes are those of `Smoother`, and `calibration`
    as of `Filter`; without a lag in `params` it is zero.

    Raises
    ------
    ParameterError
        If a parameter is not known, or lag is off.
    """

    def __init__(
        self,
        *,
        frame: Frame | str,
        params: Mapping[str, Any] | None = None,
        noise: "NoiseCard | None" = None,
        init: Start | ArrayLike | str | None = None,
        meta: ImuMeta | None = None,
        calibration: "CalibrationCard | str | Path | None" = None,
    ) -> None:
        self._card = self._correct = None
        if calibration is not None:
            from plumbob.data.calibrated import calibrating

            self._card, self._correct, meta = calibrating(calibration, meta)
        super().__init__(frame=frame, params={"lag": CAUSAL_LAG, **(params or {})}, noise=noise, init=init, meta=meta)
        if self.params.lag is None:
            raise ParameterError(
                "on a stream the smoother cannot wait for the end, but lag is off. Give the lag by which attitudes may "
                f"come later than their samples, as 5s, or leave it out: it is then {CAUSAL_LAG}."
            )
        self._restart()

    def _restart(self) -> None:
        self._running: tuple[Live, _Tracks] | None = None
        self._single: Single | None = None
        self._repeats = Repeats()

    def take(self, data: ImuData) -> AttitudeTrack | None:
        """Take the next samples, and return the attitudes that are ready; None where there are none.

        Samples that were sent twice, with the same times and values, are left out: they have no attitude of their own.

        Raises
        ------
        ShapeError
            If a triad is missing that it needs.
        ParameterError
            If `update` takes the samples of this stream.
        """
        if self._single is not None:
            raise ParameterError("update takes the samples of this stream. Call reset() before another stream.")
        return self._take(data if self._card is None else self._card.correct(data, live=True))

    def _take(self, data: ImuData) -> AttitudeTrack | None:
        if self._running is None:
            from plumbob.filters.smoother.live import Live

            self._begin(data)
            live = Live(self.params, data.meta, mag=self.common.mag, background=True, start=self._given)
            self._running = live, _Tracks(self, data.meta)
        fresh = self._repeats.fresh(np.column_stack((data.t, *(getattr(data, name) for name in data.triads))))
        if not fresh.any():
            return None
        live, tracks = self._running
        piece = live.take(data if fresh.all() else data.picked(fresh))
        return None if piece is None else tracks.track(piece)

    def update(self, sample: ImuSample) -> int:
        """Take the next sample and return its flags; `q_nb` is then the attitude at its time.

        Without a lag alone. It gives the bits of `take`. Time runs from the first sample; one that is not later than
        the one before is flagged and not used, until three in a row say that the clock was set back.

        Raises
        ------
        ParameterError
            If there is a lag: attitudes then come later than their samples.
        ShapeError
            If it is not a sample.
        """
        return self._updater.update(sample if self._correct is None else self._correct(sample))

    @property
    def _updater(self) -> Single:
        if self._single is None:
            if lag := self.params.lag:
                raise ParameterError(
                    f"update gives the attitude at once, but lag is {lag:g} s. Leave lag out, or use take(data)."
                )
            self._single = Single(self._take_now, self._between, self._meta, self.common.mag, self._at_first())
        return self._single

    def _take_now(self, data: ImuData) -> AttitudeTrack:
        track = self._take(data)
        assert track is not None
        return track

    def _between(self) -> "tuple[Between, Floats] | None":
        """What a next sample goes on from, and the turns to the frame that was asked for."""
        assert self._running is not None
        live, tracks = self._running
        return None if (basis := live.between()) is None else (basis, tracks.turns())

    def _at_first(self) -> CurrentEstimate:
        """What is known before the first sample."""
        if self._init is None:
            return CurrentEstimate(np.array([1.0, 0.0, 0.0, 0.0]), np.zeros(3), samples.ANYTHING)
        return CurrentEstimate(self._init.q_nb, np.zeros(3), GIVEN**2 * np.eye(3))

    @property
    def q_nb(self) -> Floats:
        """Attitude at the last sample of `update`, (4,)."""
        return self._updater.q_nb

    @property
    def bias_b(self) -> Floats:
        """Gyroscope bias then, rad/s, (3,)."""
        return self._updater.bias_b

    @property
    def cov_b(self) -> Floats:
        """Covariance of the attitude error in body axes then, rad², (3, 3); costs as much as a call of `take`."""
        return self._updater.cov_b

    def reset(self) -> None:
        """Forget every sample; parameters and start attitude stay."""
        self.finish()

    def finish(self) -> AttitudeTrack | None:
        """Say that the stream has ended, and return the attitudes that are left; None where there are none."""
        running = self._running
        self._restart()
        return None if running is None or (piece := running[0].finish()) is None else running[1].track(piece)
