"""The paper's tests through real bytes: the rig ``trackball`` is emulated and recorded, and its rates are filtered.

One unit is used for all: a random MPU-3050 with the assumed noise. It rests, warms up, is calibrated on a rate table,
speeds up on the paper's turntable, and is lapped as the ball in which it sits.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from plumbob.core.check import Floats
from plumbob.core.units import dps
from plumbob.data import AttitudeTrack
from plumbob.door.calibrate import calibrate, read_track
from plumbob.door.estimate import estimate
from plumbob.door.rates import filter_rates
from plumbob.noise import DeviationComparison, compare
from plumbob.papers.trackball.seeds import (
    AT_REST,
    IN_MOTION,
    SAMPLES,
    STEP,
    TAUS,
    RampFilter,
    factors,
    noise_card,
    scalar_filter,
    two_state,
    unfiltered,
)
from plumbob.papers.workspace import Work, recorded_samples
from plumbob.rotations import Frame, quat_conjugate, quat_rotate
from plumbob.simulation import scenario
from plumbob.simulation.errors import stream

RIG: Final = "trackball"
REST: Final = SAMPLES * STEP
"""Rest before turntable and ball begin, s."""
RATES: Final = (50.0, 100.0, 200.0)
"""Of the rate table, °/s."""
SOAK: Final = 3600.0
"""Length of the soak, s; the unit warms by 20 K with a time constant of 600 s."""
DOWN: Final = (0.0, 0.0, 1.0)
"""Where the lower plate touches the ball, NED."""


class Rest(NamedTuple):
    """The recorded static test.

    `t` (N,): time, s; `raw`, `before`, `after`, `best` (N, 3): as measured, with drift and constant taken off, then
    by the scalar filter, or by the one with two states, rad/s; `compared`: deviations of x before and after the
    scalar filter, at the paper's eight averaging times; `quantum`: smallest step between two rates, rad/s;
    `temp_c`: mean temperature, °C.
    """

    t: Floats
    raw: Floats
    before: Floats
    after: Floats
    best: Floats
    compared: DeviationComparison
    quantum: float
    temp_c: float


class Soaked(NamedTuple):
    """Change (3,) of the mean rate in a soak, rad/s: as measured, by the paper's 0.1 °/s/°C, and by its own card."""

    raw: Floats
    printed: Floats
    own: Floats


@dataclass(frozen=True)
class Turned:
    """The recorded turntable, from the moment that it starts.

    `t` (N,): time since the start, s; `true`, `raw` (N,): rate about the table's axis, true and as measured, rad/s;
    `rates` (N,): by `LINES`: what each makes of it, rad/s; `headings` (N,): error of the integrated heading of
    those that a card has calibrated, rad.
    """

    t: Floats
    true: Floats
    raw: Floats
    rates: Mapping[str, Floats]
    headings: Mapping[str, Floats]


class Lapped(NamedTuple):
    """The recorded ball: time (N,), s, and the point that touches the lower plate, by line, (N, 3), in body axes."""

    t: Floats
    tracks: Mapping[str, Floats]


class Line(NamedTuple):
    """How rates are made: by a card or by the paper's drift model, with the constant of the rest, and by a filter."""

    filter: RampFilter
    card: bool


LINES: Final[Mapping[str, Line]] = {
    "compensated": Line(unfiltered(), card=False),
    "paper": Line(scalar_filter(IN_MOTION), card=False),
    "calibrated": Line(unfiltered(), card=True),
    "calibrated, paper's filter": Line(scalar_filter(IN_MOTION), card=True),
    "best": Line(two_state(), card=True),
}


def rest(work: Work) -> Rest:
    """Record the static test, and compare it before and after the scalar filter."""
    file = work.recorded(RIG, "static", noise=noise_card()).recording
    raw = recorded_samples(file)
    assert raw.gyr is not None and raw.temp_c is not None
    before, after, best = (
        filter_rates(file, way.filter, params=way.params, drift="chen2013", rest=(0.0, REST)).imu.usable("gyr")
        for way in (unfiltered(), scalar_filter(AT_REST), two_state())
    )
    steps = np.abs(np.diff(np.unique(raw.gyr[:, 0])))
    compared = compare(before[:, 0], after[:, 0], STEP, n=np.array(factors(TAUS)))
    return Rest(raw.t, raw.gyr, before, after, best, compared, float(steps.min()), float(raw.temp_c.mean()))


def card(work: Work) -> Path:
    """Record the unit on a rate table, and calibrate it: the card's file."""
    taken = work.recorded(RIG, "ratetable", noise=noise_card(), scenario="ratetable")
    path = work.folder / "card.json"
    calibrate(taken.recording, "table", rates=[float(dps(rate)) for rate in RATES]).save(path, overwrite=True)
    return path


def soaked(work: Work) -> Soaked:
    """Record a soak at rest, and compensate its temperature by the paper's figure, and by the card of this soak."""
    file = work.recorded(RIG, "soak", noise=noise_card(), warm_up="20 K, 600 s", duration=SOAK).recording
    soak_card = calibrate(file, "temperature").card
    plain = unfiltered()
    ways: tuple[dict[str, Any], ...] = ({}, {"drift": "chen2013"}, {"calibration": soak_card})
    rates = [filter_rates(file, plain.filter, params=plain.params, rest=(0.0, 5.0), **more) for more in ways]
    last = slice(-round(0.1 * SOAK / STEP), None)
    return Soaked(*(filtered.imu.usable("gyr")[last].mean(axis=0) for filtered in rates))


def turntable_run(work: Work, card: Path) -> Turned:
    """Record the turntable after a rest, and filter its rates in every way."""
    taken = work.recorded(RIG, "turntable", noise=noise_card(), scenario="turntable", set={"lead": REST})
    imu = recorded_samples(taken.recording)
    assert imu.gyr is not None
    plan = scenario("turntable", lead=REST)
    true = plan.motion(stream(0, "scenario"), plan.duration).truth(imu.t).rate_b[:, 2]
    begin = imu.t >= REST
    by_line = {name: _filtered(taken.recording, line, card) for name, line in LINES.items()}
    rates = {name: filtered.imu.usable("gyr")[begin, 2] for name, filtered in by_line.items()}
    truth = _heading(read_track(taken.truth))[begin]
    headings = {}
    for name in (name for name, line in LINES.items() if line.card):
        track = estimate(by_line[name].recording, "integrate", frame=Frame.NED, init="level").track
        headings[name] = _heading(track)[begin] - truth
    return Turned(imu.t[begin] - REST, true[begin], imu.gyr[begin, 2], rates, headings)


def lapped(work: Work, card: Path) -> Lapped:
    """Record the ball after a rest, integrate its rates, and follow the point that touches the lower plate."""
    taken = work.recorded(RIG, "ball", noise=noise_card(), scenario="ball", set={"lead": REST})
    truth = read_track(taken.truth)
    begin = truth.t >= REST
    tracks = {"true": touching(truth.q_nb[begin])}
    measured = estimate(taken.recording, "integrate", frame=Frame.NED, init="level").track
    tracks["measured"] = touching(measured.q_nb[begin])
    for name, line in LINES.items():
        rates = _filtered(taken.recording, line, card)
        track = estimate(rates.recording, "integrate", frame=Frame.NED, init="level").track
        tracks[name] = touching(track.q_nb[begin])
    return Lapped(truth.t[begin] - REST, tracks)


def touching(q_nb: Floats) -> Floats:
    """Point of the unit ball that touches the lower plate, (N, 3), in body axes, of its attitudes (N, 4)."""
    return np.asarray(quat_rotate(quat_conjugate(q_nb), np.array(DOWN)))


def apart(one: Floats, other: Floats) -> Floats:
    """Angle (N,), rad, between points (N, 3) of the unit ball."""
    return np.asarray(2.0 * np.arcsin(np.clip(0.5 * np.linalg.norm(one - other, axis=1), 0.0, 1.0)))


def _filtered(file: Path, line: Line, card: Path) -> Any:
    how: dict[str, Any] = {"calibration": card} if line.card else {"drift": "chen2013"}
    return filter_rates(file, line.filter.filter, params=line.filter.params, rest=(0.0, REST), **how)


def _heading(track: AttitudeTrack) -> Floats:
    return np.unwrap(track.yaw)
