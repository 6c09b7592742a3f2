"""From a recording to an attitude: calibrate and estimate in chunks, with progress."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Final, cast

import numpy as np

from plumbob.core.check import Floats
from plumbob.core.errors import FrameError, ParameterError
from plumbob.core.findings import Finding, warning
from plumbob.core.units import to_deg, to_dps
from plumbob.data import AttitudeTrack, ImuData, ImuMeta
from plumbob.data.reading import read_at
from plumbob.filters import SMOOTHER, Filter, Start, takes_noise
from plumbob.filters.known import ARRAY_FILTERS, CAUSAL_LAG, EXTENSIBLE
from plumbob.filters.start import TRUTH_WORD
from plumbob.rotations import Frame, North, change_frame
from plumbob.rotations.frames import heading_policy, turn_heading

if TYPE_CHECKING:
    from plumbob.data.cards import CalibrationCard, NoiseCard
    from plumbob.filters.smoother import FixedLag, Smoother

BEYOND: Final = 3.0  # standard deviations of the prior above which an estimate contradicts it


def bias_beyond(filter_: "Filter | Smoother", track: AttitudeTrack) -> tuple[Finding, ...]:
    """Say that the last estimated bias contradicts the filter's prior; nothing where it does not.

    `filter_`: what made the track; a filter without a prior of the bias says nothing; `track`: its estimate, or a part
    of it.
    """
    prior = filter_.bias_prior
    if prior is None or track.bias_b is None:
        return ()
    name, sd = prior
    last = track.bias_b[-1]  # the first ones are those of a start in motion
    largest = float(np.max(np.abs(last), initial=0.0, where=np.isfinite(last)))
    if largest <= BEYOND * sd:
        return ()
    bias, prior_sd = float(to_dps(largest)), float(to_dps(sd))
    return (warning("estimate.bias_beyond", bias_dps=bias, sd_dps=prior_sd, filter=filter_.name, parameter=name),)


CHUNK = 1 << 14  # samples handed to a filter at a time; the result does not depend on it


@dataclass(frozen=True, slots=True)
class Stage:
    """One way to estimate: a filter, its parameters, and a label for tables."""

    filter: str  # name of the filter, or "smoother", which has no lag on a stream unless its parameters say one
    params: Mapping[str, Any]  # its parameters; numbers in SI, text with its unit
    label: str = ""  # how results are called; the filter's name where empty
    # noise of the unit, for a filter that takes its parameters from it; `params` has the last word
    noise: "NoiseCard | None" = None
    # what it starts from: "level", "ROLL,PITCH,HEADING" with units, or "truth", the reference's first attitude; None:
    # its first samples
    init: str | None = None

    @property
    def name(self) -> str:
        """Label, or the filter's name."""
        return self.label or self.filter


def declination_deg(filter_: "Filter | Smoother", track: AttitudeTrack) -> float | None:
    """Declination that makes a track's headings true, degrees; None where they are not."""
    angle = filter_.common.declination
    return None if track.north is not North.TRUE or angle is None else float(to_deg(angle))


def with_noise(stages: Sequence[Stage], card: "NoiseCard") -> list[Stage]:
    """Stages with a noise card for each filter that takes one; for all where none does, so that the filter refuses it.

    `stages`: filters with their parameters; `card`: noise of the unit.
    """
    takers = [stage.filter for stage in stages if takes_noise(stage.filter)]
    return [replace(stage, noise=card) if stage.filter in takers or not takers else stage for stage in stages]


def navigation_frame(imu: ImuData, asked: Frame | None, *, where: str) -> Frame:
    """Frame that was asked for, or that the recording names; never a guess.

    Raises FrameError if neither says one.
    """
    frame = asked or imu.meta.frame
    if frame is None:
        raise FrameError(f"{where} does not name a navigation frame. Give --frame {', --frame '.join(Frame)}.")
    return frame


def calibrated(imu: ImuData, card: "CalibrationCard | None", *, live: bool = False) -> ImuData:
    """Recording, or a part of a stream (`live`), with the card applied, or as it is where there is none."""
    if card is None:
        return imu
    from plumbob.data.calibrated import apply_card

    return apply_card(card, imu, live=live)


def make_estimator(
    stage: Stage, frame: Frame, meta: ImuMeta | None = None, *, start: Start | None = None, live: bool = False
) -> "Filter | Smoother":
    """Filter or smoother of a stage for samples with this meta, or what estimates a stream (`live`).

    `start` is the start where the stage leaves it to the truth. `Filter` has the rule of its headings.
    """
    init = start or (None if stage.init == TRUTH_WORD else stage.init)
    given: Any = {"frame": frame, "params": stage.params, "noise": stage.noise, "init": init, "meta": meta}
    if stage.filter in ARRAY_FILTERS:
        return cast(Any, EXTENSIBLE.find(stage.filter)).ArrayFilter(frame)  # type: ignore[no-any-return]
    if stage.filter != SMOOTHER:
        return Filter(stage.filter, **given)
    from plumbob.filters.smoother import FixedLag, Smoother

    return FixedLag(**given) if live else Smoother(**given)


def make_follower(
    stage: Stage, frame: Frame, meta: ImuMeta | None = None, *, start: Start | None = None
) -> "Filter | FixedLag":
    """What estimates a stream: a filter, or the smoother with a lag; arguments of `make_estimator`."""
    return cast("Filter | FixedLag", make_estimator(stage, frame, meta, start=start, live=True))


def lagged(
    filter: str | None, lag: float | str | None, params: Mapping[str, Any] | None, *, causal: bool = False
) -> tuple[str | None, Mapping[str, Any] | None]:
    """Filter and parameters as they were asked for: with a lag it is the smoother, which has it as a parameter.

    What is causal has no lag.

    Raises ParameterError if both are asked for, or another filter was named.
    """
    if causal and lag is not None:
        raise ParameterError(f"causal is a lag of {CAUSAL_LAG}, but lag is {lag}. Leave one of them out.")
    lag = CAUSAL_LAG if causal else lag
    if lag is None:
        return filter, params
    if filter not in (None, SMOOTHER):
        raise ParameterError(
            f"{'causal' if causal else 'lag'} is for the smoother, but filter is {filter}. Leave one of them out."
        )
    return SMOOTHER, {**(params or {}), "lag": lag}


def run_stage(
    imu: ImuData,
    stage: Stage,
    *,
    frame: Frame,
    reference: AttitudeTrack | None = None,
) -> AttitudeTrack:
    """Attitude at every sample of a recording, with its covariance where the filter claims one.

    Headings are true where the recording knows its declination, and magnetic where it does not; see `located`.

    `imu`: calibrated samples; `stage`: filter, parameters and noise card; `frame`: navigation frame of the result;
    `reference`: what a stage with init "truth" starts from; the track then begins with the first sample whose attitude
    it knows.
    """
    imu, estimator = started(imu, stage, frame, reference)
    return AttitudeTrack.joined(track_parts(imu, estimator), len(imu))


def started(
    imu: ImuData, stage: Stage, frame: Frame, reference: AttitudeTrack | None = None
) -> "tuple[ImuData, Filter | Smoother]":
    """Samples, and what estimates them; from the first sample on whose truth is known, where it starts from that."""
    start = None
    if stage.init == TRUTH_WORD:
        imu, start = start_from(reference, imu, make_estimator(stage, frame, imu.meta))
    return imu, make_estimator(stage, frame, imu.meta, start=start)


def track_parts(imu: ImuData, estimator: "Filter | Smoother") -> Iterator[AttitudeTrack]:
    """Parts of the track of a recording, one after the other, as `AttitudeTrack.joined` takes them."""
    if not isinstance(estimator, Filter):
        return estimator.parts(imu)
    # without a look: the findings of the recording have been told
    return (estimator.process(chunk, covariance=True, look=False) for chunk in imu.chunks(CHUNK))


def start_from(reference: AttitudeTrack | None, imu: ImuData, filter_: "Filter | Smoother") -> tuple[ImuData, Start]:
    """Samples from the first one on whose attitude a reference knows, and that attitude as the filter's start.

    `reference`: the truth, on the time line of the samples; `imu`: the recording; `filter_`: what is started; it says
    frame, declination and whether a magnetometer gives its north. Raises ParameterError if there is no reference, or it
    knows no attitude at any sample; FrameError if its heading is true and the filter's magnetic, or the other way
    round, and no declination is known.
    """
    if reference is None:
        raise ParameterError(
            "init 'truth' takes the first attitude of the recording's reference, but it has none; give "
            "ROLL,PITCH,HEADING with units, or level."
        )
    reading = read_at(reference, imu.t_ns)
    rows = np.flatnonzero(np.isfinite(reading.q_nb).all(axis=1))
    if not rows.size:
        raise ParameterError(
            "init 'truth' takes the first attitude of the reference, but that knows none at any sample of the "
            "recording; do both count time from the same start?"
        )
    first = int(rows[0])
    return imu[first:], start_at(reading.q_nb[first], reference.frame, reference.north, filter_, "mag" in imu.triads)


def start_at(q_nb: Floats, frame: Frame, north: North, filter_: "Filter | Smoother", has_mag: bool) -> Start:
    """Start of a true attitude (4,), whose frame and north are given."""
    q_nb = change_frame(q_nb, to=filter_.frame, from_=frame)
    filter_north = filter_.north(has_mag)
    if filter_north is North.FREE or north is North.FREE:  # a gyroscope alone keeps the north that it is given
        return Start(q_nb, north)
    policy = heading_policy(filter_north, north, aligned=False, declination=filter_.common.declination)
    return Start(turn_heading(q_nb, policy.turn, filter_.frame))
