"""A stream: the past is smoothed now and then, and a filter goes on from where that ends, on the same models.

What a few samples cannot tell (the first tilt, a bias that no rest shows, which of two fields belongs to the place) is
decided by all of the past together, each time again, and so no rule has to be right at once. In between nothing is
decided: the filter takes rest, speed and the weight of each field from what came before. The past is smoothed soon
after a start and some seconds behind a gap, then ever more seldom, and at once when the tilt is in doubt or the fields
of a turning unit contradict the one of the place. That one is proven by the time in which the unit turned in it:
another must be seen for longer; one in which the unit merely lay is proven by nothing. What cannot be decided is
doubted: the covariance grows by the angle in question. With a lag the filter's steps are also taken back into the look.
"""

import math
from collections import deque
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbob.core import flags
from plumbob.core.check import Floats
from plumbob.core.constants import G0
from plumbob.core.units import deg
from plumbob.data import ImuData, ImuMeta
from plumbob.data.cards.residuals import full_covariance
from plumbob.filters.smoother import causal, samples
from plumbob.filters.smoother.field import (
    APART,
    HEADING2,
    LEAST_TURNING,
    REST_SHARE,
    Reference,
    turning_time,
)
from plumbob.filters.smoother.inertial import GIVEN, LEAK, WINDOW, Given, level_speed, peaks
from plumbob.filters.smoother.keyframes import Keyframes, between, path
from plumbob.filters.smoother.model import (
    FREE_HEADING,
    KEPT,
    SIZE,
    B,
    M,
    ModelVariances,
    Params,
    as_delivered,
    matrix_variances,
    may_be_delivered,
    timing_sd,
)
from plumbob.filters.smoother.passes import Known, Smoothed, smooth_lately
from plumbob.filters.smoother.preprocess import Arriving
from plumbob.filters.smoother.samples import MARGIN
from plumbob.filters.smoother.stationary import HOLDS, JUMPED, MISLED, UNTIL, fresh
from plumbob.filters.smoother.sweeps import Last, Way, heading_from
from plumbob.rotations import Frame, dcm_from_quat, quat_from_rotvec, quat_multiply
from plumbob.rotations.frames import turn_heading

SOONEST: Final = 0.25  # the past is smoothed for the first time after this, s, then each time later by
GROWS: Final = 1.5
EVERY: Final = MARGIN / 4.0
"""up to this, s, by when a quarter of what it sees is new, or a third of it with a lag, which has the time."""
LEAST_PAUSE: Final = 4.0  # and at once, but not sooner than this, s, nor than
RECENT: Final = 0.1  # this share of the past: at most ten seconds are smoothed for each that passes,
CALIBRATED: Final = 3.0  # a unit without a card is calibrated with these odds before anything is known
AGAINST: Final = 2.0
"""when the unit has turned for so long, s, in fields that are not the one of the place; that one too takes as long."""
PROVEN: Final = 3.0  # the field of the place counts for so many times the time in which the unit turned in it,
YOUNG: Final = 10.0
"""beyond this, s: what surrounds a unit where it is picked up is not the place."""
UNCERTAIN_HEADING: Final = deg(20.0)
"""With a larger standard deviation of a heading that a field gives, rad, the attitude is not converged."""
BLOCK: Final = 1.0  # whether the fields contradict the one of the place is asked so often, s
LATE: Final = 0.5  # what a look has found is handed over so much later, s,
SHORT: Final = 5.0
"""unless the past is shorter than this, s."""
BEHIND: Final = 1.5 * BLOCK
"""Behind a jump of the bias the first look comes after this, s: no steps that are followed at once reach so far."""

SHARE: Final = 0.25  # with a lag so much of it is done at a time,
LEAST_PART: Final = 0.5
"""but not less than this, s;"""
FARTHEST: Final = 0.5
"""what comes later than this share of what a look sees changes nothing."""


@dataclass(slots=True)
class Running:
    """The filter between two looks at the past."""

    last: Last  # what it knows now
    cov: Floats  # (3, 3), covariance of the attitude, with what is in doubt
    learned: Floats  # (6,), what it has learned of the motion
    smoothed: Smoothed  # what the last look found
    field: causal.LocalField  # the field of the place
    iron: Floats  # (3,), field that turns with the sensor, µT
    noise: ModelVariances  # of the model
    since: float  # time of that look, or of a gap behind it, s
    # word, weight: of the last step
    word: int
    weight: float
    against: Floats  # (1,), for how long since the look the unit turned in other fields, s
    other: Floats  # (8,), a field that contradicts the one of the place
    proven: bool  # whether the unit has turned in that one
    standing: Floats  # (24,), what contradicts the gyroscope: see `stationary`
    doubt: Floats  # (7,), what fields that contradict say: see `contradict`
    unknown: int  # flag of a field that no turning in it has shown up to the look
    turned: float  # by how much headings were turned since the look, rad, to go on from those before it
    shift: Floats  # (21,), by how much the look's last state was changed before, see `_either`
    rooms: list[causal.Room]  # the steps since the look, from none on; where there is a lag
    timing_sd: float  # of the time at which attitudes are true, s

    def back(self, n: int) -> tuple[Floats, Floats, Floats, NDArray[np.uint32], Floats]:
        """What is known now of the last n steps, or as many as there are since the look and in it.

        Attitude (K + 1, 4), first states (K + 1, 8), covariance of the attitude (K + 1, 3, 3), flags and weight (K,).
        """
        lam, big, way = np.zeros(SIZE), np.zeros((SIZE, SIZE)), Way.joined([room.way for room in self.rooms])
        count, look = len(way.step), self.smoothed.sweep.way
        since = slice(max(count - n, 0), None)
        q, x, cov = way.part(since.start, count).back(lam, big)
        doubts = np.concatenate([self.rooms[0].cov[:1], *(room.cov[1:] for room in self.rooms)]) - way.cov[:, :3, :3]
        cov = cov[:, :3, :3] + doubts[since]
        word, weight = (np.concatenate(rows)[since] for rows in list(zip(*self.rooms, strict=True))[2:])
        if n <= count or look is None:
            return q, x, cov, word, weight
        before = slice(max(len(look.step) - (n - count), 0), len(look.step))
        causal.turn_heading_by(-self.turned, np.zeros(4), lam, big, np.zeros(causal.LEARNED))
        lam -= big @ self.shift
        q_l, x_l, cov_l = look.part(before.start, before.stop).back(lam, big)
        turn = dcm_from_quat(quat_from_rotvec([0.0, 0.0, self.turned]))
        q, x = np.concatenate((turn_heading(q_l, -self.turned, Frame.ENU)[:-1], q)), np.concatenate((x_l[:-1], x))
        cov = np.concatenate(((turn @ cov_l[:, :3, :3] @ turn.T)[:-1], cov))
        rest = np.where(self.smoothed.resting[before], np.uint32(flags.AT_REST), np.uint32(0))
        return q, x, cov, np.append(rest, word), np.append(self.smoothed.weight[before], weight)


@dataclass(slots=True)
class Proven:
    """The field of the place, for how long the unit turned and rested in it, s, and when it rested in another one."""

    reference: Reference | None = None
    turning: float = 0.0
    rest: float = 0.0
    since: float = -math.inf

    @property
    def settled(self) -> bool:
        """Whether it is not the field in which the unit merely lay."""
        return self.turning > AGAINST or not self.rest

    def prior(self, unit: Floats | None, turned: float, begin: float) -> Known:
        """What a look at the past takes for known, which begins then, s, and in which the unit turned for this, s."""
        if turned < LEAST_TURNING:
            weight = self.turning + self.rest
        else:
            weight = max(self.turning + min(self.rest, REST_SHARE * self.turning) - YOUNG, 0.0)
        weight *= PROVEN - 1.0
        if begin < self.since:
            weight += REST_SHARE * turned  # whatever rest in the other one counts
        return Known(unit=unit, reference=self.reference, weight=weight)

    def take(self, reference: Reference, since: float) -> None:
        """Take another field than the one in which the unit rested before this time, s."""
        self.reference, self.turning, self.rest, self.since = reference, 0.0, 0.0, since

    def see(self, frames: Keyframes, smoothed: Smoothed, p: Params) -> None:
        """Take what a look at the past found; another field must be proven again."""
        reference, before = smoothed.reference, self.reference
        if reference is None:
            return
        turning = float(turning_time(frames, smoothed.sweep.bias[1:], smoothed.resting) @ smoothed.weight)
        rest = float((frames.step * smoothed.resting) @ smoothed.weight)
        apart = math.inf if before is None else reference.apart(before)
        if apart > APART * p.mag_spread:
            self.turning, self.rest = turning, rest
        else:
            self.turning, self.rest = max(self.turning, turning), max(self.rest, rest)
        self.reference = reference


class Between(NamedTuple):
    """What a next sample goes on from where it ends no step: see `per_sample`.

    Attitude (4,), body to ENU, and state (21,), what is watched for stuck sensors, the flags of the step, the time at
    which the step began, its usual length, and the longest time between two samples of which none is missing, s.
    """

    q: Floats
    x: Floats
    watched: Floats
    word: int
    key: float
    spacing: float
    longest: float


class Look(NamedTuple):
    """A look at the past: the step at which it began, the time at which it is handed over, and what it finds.

    `begin` is the time from which the past was asked, s.
    """

    step: int
    begin: float
    due: float
    smooth: Callable[[], Smoothed]
    anchor: tuple[int, Floats] | None


class Live:
    """Follows a stream: samples in, and what nothing but they, those before them, and those of the lag say of each.

    With a lag what is known then is taken back over the samples that are due, `SHARE` of the lag at a time.

    A look at a long past takes a while. It is handed over `LATE` after it began, by the time of the samples, whatever
    the computer does meanwhile: the same samples give the same bits.

    `p`: parameters; `meta`: of the samples; `mag`: use the magnetometer; `background`: look at the past in a thread of
    its own, so that the stream does not wait for it; `start`: the first attitude; `gaps`: ends of those so far, s;
    `rated`: whether two samples had a rate; `has_field`: whether any had a field.
    """

    def __init__(
        self, p: Params, meta: ImuMeta, *, mag: bool, background: bool = False, start: Given | None = None
    ) -> None:
        self.p, self._left, self._start = p, meta.left, start
        self._drift = samples.FreeHeading(meta, p, GIVEN**2 if start is not None and start.headed else None)
        self._unit = None if meta.gyr_left is None else full_covariance(meta.gyr_left)[:12, :12]
        self._arriving, self._proven = Arriving(p, mag=mag), Proven()
        self._thread = ThreadPoolExecutor(1, "plumbob-look") if background else None
        self._running: Running | None = None
        self._look: Look | None = None
        self._anchor: tuple[int, Floats] | None = None
        self._step, self._pause, self._due, self._check = 0, SOONEST, math.inf, math.inf
        lost = np.array([flags.NOT_CONVERGED | flags.HEADING_FREE], dtype=np.uint32)
        q = np.array([1.0, 0.0, 0.0, 0.0]) if start is None else start.q
        self._last = samples.SampleEstimates(
            q[np.newaxis], np.zeros((1, 3)), samples.ANYTHING[np.newaxis], lost, np.full(1, np.nan)
        )
        self._jumped, self._any_bias = -math.inf, False  # since when the bias is another one
        self._misled = -math.inf  # when the attitude was lost last
        self._started = -math.inf  # when it was as given
        self._matrix: Floats | None = None  # (9,), scale and axes by the last look
        self._lag = min(p.lag or 0.0, FARTHEST * MARGIN)
        self._part = max(SHARE * self._lag, min(self._lag, LEAST_PART))  # samples that are taken back at a time, s
        # Samples that are not handed out: the first of them, and of those that are not done; what is known of each
        self._base, self._done = 0, 0
        self._out, self._rate, self._bias_sd = self._last.rows(slice(0, 0)), np.zeros((0, 3)), np.zeros(0)
        # and of all rows that wait, also of those that are left out: times, flags, and which are not
        self._t, self._word, self._mask = np.zeros(0), np.zeros(0, dtype=np.uint32), np.zeros(0, dtype=bool)
        self._biases = deque[tuple[float, Floats, Floats]]()  # when, bias and its covariance, by what came before
        self.gaps: list[float] = []
        self.has_field, self._mag = False, mag

    @property
    def smoothed(self) -> Smoothed | None:
        """What the last look found."""
        return None if self._running is None else self._running.smoothed

    @property
    def rated(self) -> bool:
        """Whether two samples had a rate."""
        return self._arriving.rated

    def between(self) -> Between | None:
        """What a next sample goes on from where it ends no step; None where it must be taken."""
        running, arriving = self._running, self._arriving
        watched = arriving.watched()
        if running is None or watched is None or self.p.latency:
            return None
        said = self._flags(running.smoothed, np.array([running.weight]), running.cov[np.newaxis])
        q, key = self._last.q[0].copy(), arriving.key
        word = running.word | running.unknown | int(said[0])
        return Between(q, running.last.state.copy(), watched, word, key, self.p.keyframe, arriving.longest)

    def take(self, data: ImuData) -> samples.Piece | None:
        """What is known of the next samples that are due; None where none are."""
        arriving = self._arriving
        begin = arriving.samples
        self.has_field |= self._mag and data.mag is not None and bool(np.isfinite(data.mag[:, 0]).any())
        mask = arriving.take(data)
        n = arriving.samples - begin
        self._t, self._mask = np.append(self._t, data.t), np.append(self._mask, mask)
        self._word = np.append(self._word, np.asarray(data.flags) | arriving.word)
        self._out = self._out.followed_by(self._last.rows(np.zeros(n, dtype=np.int64)))
        self._rate = np.concatenate((self._rate, np.zeros((n, 3))))
        self._bias_sd = np.concatenate((self._bias_sd, np.zeros(n)))
        if n:
            if not begin:
                self._started = arriving.time(0)
                self._due = self._started + SOONEST
            if self._running is None:
                self._before_any_look(n)
            self._follow()
        piece = self._due_rows(self._done if self._lag else arriving.samples)
        if n:
            arriving.before(arriving.from_(arriving.time(self._step) - MARGIN - 2.0 * LATE))
        return piece

    def finish(self) -> samples.Piece | None:
        """What is known of the samples that are left, and the end of the thread."""
        if self._lag and self._done < self._arriving.samples:
            self._take_back(self._step, math.inf)
        if self._thread is not None:
            self._thread.shutdown()
        return self._due_rows(self._arriving.samples)

    def _before_any_look(self, n: int) -> None:
        """What is known of samples until the past is looked at: the gyroscope goes on from a given attitude.

        Without one force and field say where up and north are; what a given heading has besides comes with its drift.
        """
        arriving, out = self._arriving, self._out.rows(slice(len(self._out.q) - n, None))
        t, gyr, acc, mag = arriving.all_rows()
        q, var = np.empty((t.size, 4)), np.tile([GIVEN**2, FREE_HEADING**2], (t.size, 1))
        path(t, gyr, q)
        if self._start is None:
            causal.first_attitudes(acc, mag, self.p.mag_spread, q, var)
            out.flags[var[-n:, 1] < math.pi**2] &= ~np.uint32(flags.HEADING_FREE)
        else:
            q = quat_multiply(self._start.q, q)
        tilt2, heading2 = var[-n:].T
        sought = np.logical_or.accumulate(np.isfinite(mag[:, 0]))[-n:]
        out.flags[sought] |= np.uint32(flags.FIELD_UNKNOWN)
        out.q[:] = q[-n:]
        out.cov[:] = samples.widened(out.q, tilt2[:, np.newaxis, np.newaxis] * np.eye(3), heading2 - tilt2)

    def _due_rows(self, done: int) -> samples.Piece | None:
        """Rows up to a sample, those in holes of the gyroscope too: there the attitude stays, and may be any."""
        count = done - self._base
        place = np.cumsum(self._mask)
        end = int(np.searchsorted(place, count, side="right"))
        if not end:
            return None
        t, word, mask = self._t[:end], self._word[:end], self._mask[:end]
        both = self._last.followed_by(self._widened(count))
        part = both.rows(place[:end].astype(np.intp))
        part.cov[~mask] += samples.ANYTHING
        word = part.flags | word
        lost = (word & ~np.uint32(flags.AT_REST)) | np.uint32(flags.GYR_HELD | flags.NOT_CONVERGED)
        part = part._replace(flags=np.where(mask, word, lost).astype(np.uint32))
        rest = slice(count, None)
        self._last, self._out, self._base = both.rows(slice(count, None)), self._out.rows(rest), done
        self._rate, self._bias_sd = self._rate[rest], self._bias_sd[rest]
        self._t, self._word, self._mask = self._t[end:], self._word[end:], self._mask[end:]
        free = (part.flags & np.uint32(flags.HEADING_FREE)) != 0
        return samples.Piece(t, part, len(free) if free.all() else int(np.argmin(free)), self.rated)

    def _follow(self) -> None:
        """Go over the steps that are complete, and to the last sample."""
        arriving = self._arriving
        while True:
            k = self._step
            if self._looked(k, arriving.time(k)):
                self._write_keyframe(k)
            while (back := self._due_back()) is not None and back <= k:
                self._take_back(k, self._part)
            if k == arriving.steps:
                break
            until = min(self._due, self._check, math.inf if self._look is None else self._look.due)
            end = min(max(arriving.from_(until - 1e-9), k + 1), arriving.steps if back is None else back)
            holes = np.flatnonzero(arriving.gaps(slice(k, end)))
            end = k + int(holes[0]) + 1 if holes.size else end
            if self._running is not None:
                self._on(self._running, k, end)
            self._step = end
            if holes.size:
                self._behind_gap(end)
        if self._running is not None:
            self._beyond(self._running, k)

    def _due_back(self) -> int | None:
        """Step at which the next samples are due; None where what may still come counts for them."""
        arriving = self._arriving
        if not self._lag or self._done == arriving.samples:
            return None
        t, _ = arriving.rows(slice(self._done, arriving.samples))
        until = float(t[0]) + self._lag
        return self._keyframe_before(until) if t[-1] > until else None

    def _keyframe_before(self, time: float) -> int:
        """The last one that is not later, of those that are held."""
        return self._arriving.from_(np.nextafter(time, math.inf)) - 1

    def _take_back(self, k: int, part: float) -> None:
        """Take what is known at a keyframe back over the samples of the next so many s that are not done."""
        arriving, running, begin = self._arriving, self._running, self._done
        t, _ = arriving.rows(slice(begin, arriving.samples))
        self._done = end = begin + max(int(np.searchsorted(t, t[0] + part)), 1)
        if running is None or (n := k - self._keyframe_before(float(t[0]))) < 1:
            return
        q_k, x_k, cov, word, weight = running.back(n)
        frames = arriving.frames(slice(k - weight.size, k))
        step = np.concatenate(([0], np.repeat(np.arange(weight.size), np.diff(frames.first))))
        x = np.zeros((step.size, SIZE))
        x[:, :KEPT], x[:, M:] = x_k[step], running.last.state[M:]
        moving = ((word & np.uint32(flags.AT_REST)) == 0) & ~frames.gap
        q, first = between(frames, moving, q_k, _corrected(x, frames.gyr)), int(frames.rows[0])
        rows = slice(max(begin - first, 0), max(end - first, 0))
        step = step[rows]
        self._put(first + rows.start, q[rows], x[rows], cov[1:][step], frames.gyr[rows], word[step], weight[step])

    def _looked(self, k: int, now: float) -> bool:
        """Look at the past where it is time; whether the filter has another state since."""
        changed = False
        if self._look is not None and now >= self._look.due - 1e-9:
            changed = self._hand_over(k)
        against, running = False, self._running
        if now >= self._check - 1e-9:
            self._check = now + BLOCK
            if running is not None:  # at times that do not depend on how the stream comes in parts
                if now - running.since > max(LEAST_PAUSE, RECENT * (now - self._arriving.time(self._begin(now)))):
                    lost = running.cov[0, 0] + running.cov[1, 1] > 2.0 * samples.DOUBTFUL**2  # a tilt that is in doubt
                    against = bool(lost or running.against[0] > AGAINST)
                place, unseen = slice(B, B + 3), running.smoothed.bias_sd**2 * np.eye(3)
                self._biases.append((now, running.last.state[place].copy(), running.last.cov[place, place] + unseen))
        if self._look is None and (now >= self._due - 1e-9 or against):
            self._pause = min(self._pause * GROWS, EVERY if not self._lag else EVERY / 3.0)
            self._due = now + self._pause
            self._look = self._begun(k, now)
            if self._look is not None and self._look.due <= now:
                changed = self._hand_over(k)
        return changed

    def _begin(self, now: float) -> int:
        """Step at which a look at the past begins that is asked for now."""
        return self._arriving.from_(max(now - MARGIN, self._jumped))

    def _begun(self, k: int, now: float) -> Look | None:
        """A look at the past that begins now; None where that is too short."""
        arriving = self._arriving
        past = slice(self._begin(now), k)
        if past.stop - past.start < 3:
            return None
        frames = arriving.frames(past)
        begin = arriving.time(past.start)
        turned = float(turning_time(frames, 0.0, arriving.quiet(past)[0]).sum())
        prior = self._proven.prior(self._unit, turned, begin)
        before = self._before(begin) if past.start and begin > self._jumped else None
        start = self._start if begin <= self._started else None
        prior = replace(
            prior,
            start=start,
            any_bias=self._any_bias and start is None,
            before=before,
            delivered=0.0 if self._running is None else self._running.smoothed.delivered,
            matrix=self._matrix,
        )
        look, anchor = partial(smooth_lately, frames, self.p, prior), self._anchor
        if anchor is not None and anchor[0] < past.start and self._running is not None:
            anchor = (k, self._running.last.attitude.copy())
        if now - begin < SHORT:
            return Look(k, begin, now, look, anchor)
        return Look(k, begin, now + LATE, look if self._thread is None else self._thread.submit(look).result, anchor)

    def _before(self, begin: float) -> tuple[Floats, Floats] | None:
        """Bias at a time, and its covariance, by nothing but what came before it."""
        while len(self._biases) > 1 and self._biases[1][0] <= begin:
            self._biases.popleft()
        if not self._biases or self._biases[0][0] > begin:
            return None
        time, bias, cov = self._biases[0]
        return bias, cov + self.p.gyr_walk**2 * (begin - time) * np.eye(3)

    def _hand_over(self, k: int) -> bool:
        """Go on from what the look has found, over the steps that came since it began."""
        assert self._look is not None
        look, self._look = self._look, None
        smoothed = look.smooth()
        if jumped := bool(smoothed.frames.time[0] > look.begin):
            self._behind_jump(float(smoothed.frames.time[0]), self._arriving.time(k))
            self._started = self._jumped
        self._start = smoothed.start or self._start
        self._proven.see(smoothed.frames, smoothed, self.p)
        self._running = running = self._from(smoothed, look)
        self._matrix = running.last.state[M:].copy()
        if jumped:
            running.standing[UNTIL] = self._arriving.time(k) + HOLDS
        if k > look.step:
            self._steps(running, look.step, k)
        self._anchor = (k, running.last.attitude.copy())
        if self._check == math.inf:
            self._check = self._arriving.time(k) + BLOCK
        return True

    def _from(self, smoothed: Smoothed, look: Look) -> Running:
        """The filter at the end of a look at the past."""
        p, frames = self.p, smoothed.frames
        (last, shift), push = self._either(smoothed), smoothed.sweep.force - [0.0, 0.0, G0]
        force = np.where(frames.untold[:, np.newaxis], 0.0, push)
        back = frames.time[-1] - frames.time[1:]
        velocity = (force * (frames.step * np.exp(-back / LEAK))[:, np.newaxis]).sum(axis=0)
        force2 = float(np.mean(0.5 * (force[back < WINDOW, :2] ** 2).sum(axis=1)))
        square = level_speed(frames, force[:, :2]).speed ** 2
        speed2 = square[-1]
        peaks(frames.step, LEAK, square)
        learned = np.array([speed2, force2, *velocity, square[-1]])
        by = 0.0
        if smoothed.reference is None and look.anchor is not None:
            place, attitude = look.anchor
            by = heading_from(smoothed.sweep.q[max(place - (look.step - frames.gap.size), 0)], attitude)
            causal.turn_heading_by(by, *last, learned)
        iron = np.zeros(3) if smoothed.attached is None else smoothed.attached.field[-1]
        bend = 0.0 if smoothed.reference is None else smoothed.reference.bend(p)
        other, standing, lasted = np.zeros(causal.CONTRARY), fresh(), self._proven.turning + self._proven.rest
        if self._running is not None:
            standing[UNTIL : MISLED + 1] = self._running.standing[UNTIL : MISLED + 1]
        if self._running is not None and not self._proven.settled:
            other[causal.DOUBT] = self._running.other[causal.DOUBT]
        cov = np.empty((3, 3))
        tilt2 = causal.unlikely_tilt(learned) + causal.wrong_tilt(smoothed.doubt, learned)
        causal.with_doubts(last.cov, 0.0, tilt2, other[causal.DOUBT] ** 2 + smoothed.doubt[HEADING2], cov)
        sought = bool(np.isfinite(frames.mag[:, 0]).any())
        turned = smoothed.reference is not None and self._proven.turning > LEAST_TURNING
        room = causal.Room.empty(0)
        room.way.q[0], room.way.x[0], room.way.cov[0], room.cov[0] = last.attitude, last.state, last.cov[:KEPT], cov
        return Running(
            last, cov, learned, smoothed, causal.LocalField.from_reference(smoothed.reference, p, lasted), iron,
            ModelVariances.from_params(p, bend),
            float(frames.time[-1]), flags.AT_REST if smoothed.resting[-1] else 0, float(smoothed.weight[-1]),
            np.zeros(1), other, self._proven.settled, standing, smoothed.doubt,
            flags.FIELD_UNKNOWN if sought and not turned else 0, by, shift, [room], timing_sd(p, frames.t),
        )  # fmt: skip

    def _either(self, smoothed: Smoothed) -> tuple[Last, Floats]:
        """What is known at the end of a look, and by how much its state is changed, (21,), for a unit of either kind.

        A unit without a card may be calibrated or as delivered. The variance of both is the prior of its scale and axes
        until the next look, and what the look has shown beyond its own prior stays as it is. Not without a field: a
        walk and an arm on rails say wrong things of a scale.
        """
        last, before = smoothed.sweep.last, np.diag(smoothed.prior)[M:]
        after, delivered = before, matrix_variances(as_delivered(self.p))
        free = self._unit is None and smoothed.reference is not None and may_be_delivered(self.p)
        if free and (before < delivered).all():
            after = before + (delivered - before) / (1.0 + CALIBRATED * math.exp(-smoothed.delivered))
        elif not smoothed.began.any():
            return last, np.zeros(SIZE)
        return last.with_prior(smoothed.began, before, after)

    def _behind_gap(self, k: int) -> None:
        """Look at what comes behind a gap once there is enough of it, or soon where nothing is known yet."""
        now = self._arriving.time(k)
        self.gaps.append(now)
        self._pause = SOONEST if self._running is None else LEAST_PAUSE
        self._due = now + self._pause
        if self._running is not None:
            self._anchor, self._running.since = (k, self._running.last.attitude.copy()), now

    def _steps(self, running: Running, k: int, end: int) -> tuple[Keyframes, causal.Room]:
        """Follow some steps."""
        steps = slice(k, end)
        frames, room = self._arriving.frames(steps), causal.Room.empty(end - k)
        room.cov[0] = running.cov
        causal.onward(
            frames.t, frames.gyr, frames.acc, frames.mag - running.iron, frames.first, frames.gap,
            *self._arriving.quiet(steps), frames.missed, frames.pushed, frames.untold, running.noise,
            running.field, self.p.rest_band, self.p.rest_time, self.p.speed, running.proven, *running.last,
            running.learned, running.against, running.other, running.standing, running.doubt, *room.way, room.cov,
            room.word, room.weight,
        )  # fmt: skip
        if self._lag:
            running.rooms.append(room)
        if running.other[causal.TAKEN]:
            self._take(running)
        if running.standing[JUMPED] > self._jumped:
            jumped = float(running.standing[JUMPED])
            self._behind_jump(jumped, jumped)
        if running.standing[MISLED] > self._misled:
            self._misled = misled = float(running.standing[MISLED])
            if self._unit is None:  # its scale may be wrong, which the past shows, and what came lately is asked alone
                self._look_soon(misled)
            else:
                self._behind_jump(misled, misled)
        running.cov, running.word, running.weight = room.cov[-1], int(room.word[-1]), float(room.weight[-1])
        return frames, room

    def _behind_jump(self, jumped: float, now: float) -> None:
        """Forget what the past said of the bias, and look at what comes."""
        self._jumped, self._any_bias = jumped, True
        self._look_soon(now)

    def _look_soon(self, now: float) -> None:
        """Look at what comes, and not at what was said of the bias before."""
        self._pause, self._due = BEHIND, now + BEHIND
        self._biases.clear()
        if self._look is not None and self._arriving.time(self._look.step) < now:
            self._look = None

    def _take(self, running: Running) -> None:
        """Take another field for the one of the place."""
        running.field, running.proven = causal.taken(running.other, running.field), True
        self._proven.take(
            Reference(running.field.level, running.field.vertical, 0.0), float(running.other[causal.BEGAN])
        )
        running.other[causal.TAKEN] = 0.0

    def _on(self, running: Running, k: int, end: int) -> None:
        """Follow some steps, and write what is known of their samples."""
        word, weight = running.word, running.weight
        frames, room = self._steps(running, k, end)
        early, n = frames.step < self.p.keyframe - 1e-6, frames.t.size
        q = np.empty((n, 4))
        causal.between_keyframes(frames.t, frames.gyr, frames.first, early, frames.gap, room.way.q, room.way.x, q)
        place = np.searchsorted(frames.first, np.arange(1, n), side="right") - 1
        place[frames.first[1:][early] - 1] -= 1
        words, weights = np.concatenate(([np.uint32(word)], room.word)), np.concatenate(([weight], room.weight))
        first = self._arriving.first(k) + 1
        self._put(first, q[1:], room.way.x[place], room.cov[place], frames.gyr[1:], words[place], weights[place])

    def _write_keyframe(self, k: int) -> None:
        """What is known at a keyframe whose state a look has changed."""
        arriving, running = self._arriving, self._running
        if running is None or (k and arriving.time(k) - arriving.time(k - 1) < self.p.keyframe - 1e-6):
            return
        first = arriving.first(k)
        _, gyr = arriving.rows(slice(first, first + 1))
        self._put(first, running.last.attitude[np.newaxis], *self._now(running, gyr))

    def _beyond(self, running: Running, k: int) -> None:
        """What is known of the samples behind the last keyframe: the gyroscope goes on."""
        first = self._arriving.first(k)
        t, gyr = self._arriving.rows(slice(first, self._arriving.samples))
        if (n := t.size - 1) == 0:
            return
        now = self._now(running, gyr[1:])
        q, ends, no = np.empty((n + 1, 4)), np.array([0, n]), np.zeros(1, dtype=bool)
        causal.between_keyframes(
            t, gyr, ends, ~no, no, np.tile(running.last.attitude, (2, 1)), np.tile(now[0][:1], (2, 1)), q
        )
        self._put(first + 1, q[1:], *now)

    @staticmethod
    def _now(running: Running, gyr: Floats) -> tuple[Floats, Floats, Floats, NDArray[np.uint32], Floats]:
        """State and covariance of the attitude, rates, flags and weight of the last step, at each of some rates."""
        n, word = len(gyr), np.full(len(gyr), running.word, dtype=np.uint32)
        x, cov = np.tile(running.last.state, (n, 1)), np.tile(running.cov, (n, 1, 1))
        return x, cov, gyr, word, np.full(n, running.weight)

    def _put(
        self, first: int, q: Floats, x: Floats, cov: Floats, gyr: Floats, word: NDArray[np.uint32], weight: Floats
    ) -> None:
        """Write what is known of the samples from one on, as far as they are new."""
        assert self._running is not None
        skip = max(self._base - first, 0)
        if skip >= len(q):
            return
        q, x, cov, gyr = (of[skip:] for of in (q, x, cov, gyr))
        word, weight = word[skip:], weight[skip:]
        rows = slice(first + skip - self._base, first + skip - self._base + len(q))
        smoothed, bias, rate = self._running.smoothed, x[:, B : B + 3], _corrected(x, gyr)
        cov_b = samples.body_cov(q, cov, smoothed, self._running.timing_sd * rate, self.p, self._left)
        word = word | self._flags(smoothed, weight, cov) | np.uint32(self._running.unknown)
        self._rate[rows], self._bias_sd[rows] = rate, smoothed.bias_sd
        if self.p.latency:
            q = quat_multiply(q, quat_from_rotvec(self.p.latency * rate))
        weight = weight if smoothed.reference is not None else np.full(len(q), np.nan)
        self._out.put(rows, samples.SampleEstimates(q, bias, cov_b, word, weight))

    def _widened(self, count: int) -> samples.SampleEstimates:
        """The next samples, with what nothing shows of the gyroscope counted in a heading without a field."""
        t, _ = self._arriving.rows(slice(self._base, self._base + count))
        part = self._out.rows(slice(0, count))
        if not count:
            return part
        gap = self.gaps[0] if self.gaps else math.inf
        variance = self._drift.variance(t, part.q, self._rate[:count], self._bias_sd[:count], gap)
        free = (part.flags & np.uint32(flags.HEADING_FREE)) != 0
        return (
            part._replace(cov=samples.widened(part.q, part.cov, np.where(free, variance, 0.0))) if free.any() else part
        )

    @staticmethod
    def _flags(smoothed: Smoothed, weight: Floats, cov: Floats) -> NDArray[np.uint32]:
        """What to know of each sample."""
        word = np.zeros(len(cov), dtype=np.int64)
        lost = cov[:, 0, 0] + cov[:, 1, 1] + 2.0 * smoothed.tilt_var > 2.0 * samples.DOUBTFUL**2
        if smoothed.reference is None:
            word |= flags.HEADING_FREE
        else:
            word |= np.where(weight < samples.GATED, flags.MAG_GATED, 0)
            lost |= cov[:, 2, 2] + smoothed.heading_var > UNCERTAIN_HEADING**2
        return (word | np.where(lost, flags.NOT_CONVERGED, 0)).astype(np.uint32)


def _corrected(x: Floats, gyr: Floats) -> Floats:
    """Rates, rad/s, (N, 3), without bias, scale and misalignment of the states (N, 21)."""
    rate: Floats = gyr - x[:, B : B + 3] - np.einsum("nij,nj->ni", x[:, M:].reshape(-1, 3, 3), gyr)
    return rate
