"""One unit of the buoy paper through its bytes: capture, static test, slides and a sea, as a user would run them.

Every step emulates a rig into bytes, records these by a session, and goes on from the recording.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from plumbob.calibration.predicted import filled
from plumbob.core.check import Floats
from plumbob.data import AttitudeTrack, ImuData
from plumbob.data.cards import CalibrationCard
from plumbob.door.calibrate import read_track
from plumbob.door.estimate import estimate
from plumbob.door.reading import read
from plumbob.live.replay import replay
from plumbob.overview.overview import Overview, report
from plumbob.papers.buoy.static_test import StaticTest, static_test
from plumbob.papers.buoy.trials import (
    SENSORS,
    SLIDE,
    STROKES,
    Contender,
    best_card,
    errors_deg,
    paper_card,
    region_readings,
)
from plumbob.papers.workspace import Work, recorded_samples
from plumbob.rotations import Frame
from plumbob.simulation.errors import unit_seed

CARD: Final = "best.card.json"
OUTPUT: Final = "sea.txt"
REPORT: Final = "sea-report.html"
BURST: Final = 120.0
"""Length of a burst of the sea's report, s."""
SMOOTHER: Final = Contender("smoother", {})
KEPT: Final = "zero-rate output kept"
"""The paper's filter where the gyroscope's zero-rate output is not removed at the start."""
_UNIT: Final = '[imu]\ndevice = "{device}"\nframe = "NED"\n'
_REFERENCE: Final = '[reference]\nunit = "ref"\nnorth = "magnetic"\n'
_LIVE: Final = '[calibration]\ncard = "{card}"\n[estimate]\nfilter = "mekf"\n[output]\nevery = "50 ms"\n'


class CalibratedUnit(NamedTuple):
    """A unit and its cards.

    Attributes
    ----------
    mag_counts : ndarray (18, 3)
        Readings of the magnetometer in the 18 regions, counts of its converter.
    mag : ndarray (18, 3)
        The same, µT.
    step : float
        Of a count, µT.
    regions : int
        Regions that the specific force fills, of 18.
    paper, best : CalibrationCard
        By the paper's fit, and by what Plumbob recommends.
    still : ImuData
        The first rest of the capture.
    """

    mag_counts: Floats
    mag: Floats
    step: float
    regions: int
    paper: CalibrationCard
    best: CalibrationCard
    still: ImuData


def calibrated(work: Work) -> CalibratedUnit:
    """Take the capture on faces and edges, and the two poses of the mounting; the best card is saved beside them."""
    poses = {"edges": "on", "wobble": "5 deg", "move": "2 s"}
    taken = work.recorded("buoy", "capture", session=_unit(work), scenario="faces", set=poses, duration="88 s")
    raised = work.recorded("buoy", "raised", session=_unit(work), scenario="raise", duration="13 s")
    capture = recorded_samples(taken.recording)
    acc, mag = region_readings(capture)
    still = capture[: int(np.searchsorted(capture.t, capture.t[0] + 2.5))]
    best = best_card(capture, recorded_samples(raised.recording))
    best.save(work.folder / CARD, overwrite=True)
    step = mag_step(capture)
    return CalibratedUnit(
        np.rint(mag / step), mag, step, int(np.count_nonzero(filled(acc))), paper_card(capture, still), best, still
    )


def mag_step(imu: ImuData) -> float:
    """Step of the magnetometer's scale, µT: the rig's HMC5983 has 2048 counts to its range."""
    assert isinstance(imu.meta.mag_range, float)
    return imu.meta.mag_range / 2048.0


def ring(work: Work, unit: CalibratedUnit) -> tuple[StaticTest, StaticTest]:
    """Static test beside a DCM260B, with the paper's card and with the best one."""
    reading = read(work.recorded("ring", "ring", session=_unit(work) + _REFERENCE).recording)
    assert reading.imu is not None
    assert reading.track is not None
    return static_test(reading.imu, reading.track, unit.paper), static_test(reading.imu, reading.track, unit.best)


class Slid(NamedTuple):
    """A slide: times (N,), s, and errors (N, 3) of yaw, pitch and roll, deg, by contender."""

    t: Floats
    errors: Mapping[str, Floats]

    def largest(self, name: str) -> tuple[float, float]:
        """Of roll and pitch, deg."""
        _, pitch, roll = np.abs(self.errors[name]).max(axis=0).tolist()
        return roll, pitch


def slides(work: Work, unit: CalibratedUnit) -> dict[tuple[float, float], Slid]:
    """Slide in each set of strokes, by each of `SLIDE` and by the smoother, which knows the future; once `KEPT` too."""
    slid: dict[tuple[float, float], Slid] = {}
    for speed, stroke in STROKES:
        settings = {"peak_speed": speed, "stroke": stroke}
        taken = work.recorded(
            "buoy", f"slide-{speed:g}-{stroke:g}", session=_unit(work), scenario="slide", set=settings
        )
        imu, truth = recorded_samples(taken.recording), read_track(taken.truth)
        errors = {
            name: errors_deg(_estimated(method, imu, unit).q_nb, truth.q_nb)
            for name, method in {**SLIDE, "smoother": SMOOTHER}.items()
        }
        if not slid:
            uncorrected = estimate(imu, "mahony", calibration=unit.paper.without("gyr"), frame=Frame.NED).track
            errors[KEPT] = errors_deg(uncorrected.q_nb, truth.q_nb)
        slid[speed, stroke] = Slid(imu.t, errors)
    return slid


class Sailed(NamedTuple):
    """A time at sea.

    Attributes
    ----------
    t : ndarray (N,)
        Times, s.
    truth, live : AttitudeTrack
        True attitude, and that of the filter while it was recorded.
    errors : mapping of str to ndarray (N, 3)
        Of yaw, pitch and roll, deg, by estimator.
    equal : bool
        Whether a replay of the bytes gives the live attitude again, to the bit.
    lines : int
        Lines of attitude that went out at 20 Hz.
    overview : Overview
        Its report, by the filter that reports have: tilt by burst, quality flags.
    page : bool
        Whether the report's page could be written: the pages of Plumbob may not be built here.
    """

    t: Floats
    truth: AttitudeTrack
    live: AttitudeTrack
    errors: Mapping[str, Floats]
    equal: bool
    lines: int
    overview: Overview
    page: bool


def sail(work: Work, unit: CalibratedUnit, contenders: Mapping[str, Contender], duration: float) -> Sailed:
    """Record the sea live with the best card and the recommended filter, with an outward line at 20 Hz."""
    text = work.folder / OUTPUT
    text.unlink(missing_ok=True)
    live = _unit(work) + _LIVE.format(card=CARD)
    taken = work.recorded("buoy", "sea", session=live, text=text, duration=duration)
    again = replay(taken.recording, check=True, keep="track")
    assert again.track is not None
    assert again.comparison is not None
    imu, truth = recorded_samples(taken.recording), read_track(taken.truth)
    errors = {name: errors_deg(_estimated(method, imu, unit).q_nb, truth.q_nb) for name, method in contenders.items()}
    lines = sum(not line.startswith("#") for line in text.read_text(encoding="utf-8").splitlines())
    overview = report(taken.recording, burst=BURST)
    page = _written(overview, work.folder / REPORT)
    return Sailed(imu.t, truth, again.track, errors, again.comparison.equal, lines, overview, page)


def _written(overview: Overview, path: Path) -> bool:
    from plumbob.core.errors import MissingExtraError

    try:
        overview.write_html(path, overwrite=True)
    except MissingExtraError:
        return False
    return True


def _estimated(contender: Contender, imu: ImuData, unit: CalibratedUnit) -> AttitudeTrack:
    card = unit.paper if contender.paper else unit.best
    return estimate(imu, contender.filter, params=contender.params, calibration=card, frame=Frame.NED).track


def _unit(work: Work) -> str:
    """What a session says of the unit; the rigs of one seed have the same one, by this name."""
    return _UNIT.format(device=f"{SENSORS} #{unit_seed(work.seed, 0)}")
