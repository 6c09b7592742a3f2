"""Units of the buoy paper [Yu2018]: one through its bytes, as a user would run it; many simulated, by several filters.

Every step of the one emulates a rig into bytes, records these by a session, and goes on from the recording: capture,
static test, slides and a sea.

Of the many, for the slide and a sea, each is drawn within the limits of the data sheets of MPU-6000 and HMC5983, all
errors included: zero-rate output, scale, misalignment, iron. It is calibrated twice from one capture on six faces and
twelve edges: as the paper does, with one reading in each of 18 regions, six parameters, and the zero-rate output at
rest removed; and as Plumbob recommends, with accelerometer, gyroscope and magnetometer by all samples and the mounting
by two poses. Simulated directly: no bytes.
"""

from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any, Final, NamedTuple

import numpy as np

from plumbob.calibration.predicted import filled
from plumbob.core.check import Floats
from plumbob.core.constants import G0
from plumbob.core.errors import CalibrationError, MissingExtraError
from plumbob.core.time import to_s
from plumbob.core.units import to_deg
from plumbob.data import AttitudeTrack, ImuData
from plumbob.data.calibrated import apply_card
from plumbob.data.cards import CalibrationCard, TriadCalibration
from plumbob.door.calibrate import calibrate, read_track
from plumbob.door.estimate import estimate
from plumbob.evaluation.metrics import euler_errors
from plumbob.filters.offline import Stage, run_stage
from plumbob.live.replay import replay
from plumbob.live.rigs.firmware import FORMAT, Processor, decoded, run_firmware
from plumbob.overview.overview import Overview, report
from plumbob.papers.buoy.modules import by_paper
from plumbob.papers.buoy.static_test import StaticTest, static_test
from plumbob.papers.workspace import Work, recorded_samples
from plumbob.protocols.decode import decode
from plumbob.protocols.format_toml import find_format
from plumbob.protocols.ring import read_ring
from plumbob.quality.static_periods import stills
from plumbob.rotations import Frame
from plumbob.simulation import Simulation, simulate
from plumbob.simulation.errors import unit_seed

SENSORS: Final = "mpu6000+hmc5983"
STROKES: Final = ((2.0, 0.4), (3.0, 0.8), (2.0, 0.8), (1.0, 0.6))
"""Highest speed of a stroke, m/s, and its duration, s."""
SETTLE: Final = 60.0
"""Time at sea that is left out, s."""


class Contender(NamedTuple):
    """A filter on samples that one of the two cards has corrected."""

    filter: str
    params: Mapping[str, Any]
    paper: bool = False


NO_GATE: Final = Contender("mahony", {"gate": "off"}, paper=True)
GATED: Final = Contender("mahony", {}, paper=True)
NARROW: Final = Contender("mahony", {"gate": 0.08}, paper=True)
NEW: Final = Contender("mekf", {})
SLIDE: Final[Mapping[str, Contender]] = {
    "no gate": NO_GATE,
    "gate 0.08 g": GATED,
    "gate 0.08 m/s²": NARROW,
    "gate 0.08 g, best card": Contender("mahony", {}),
    "vqf": Contender("vqf", {}),
    "mekf": NEW,
}
SEA: Final[Mapping[str, Contender]] = {
    "tilt_compass": Contender("tilt_compass", {}),
    "no gate": NO_GATE,
    "gate 0.08 g": GATED,
    "no gate, best card": Contender("mahony", {"gate": "off"}),
    "gate 0.08 g, best card": Contender("mahony", {}),
    "gate 0.08 m/s², best card": Contender("mahony", {"gate": 0.08}),
    "Kp 0.05, Ki 0.001": Contender("mahony", {"kp": 0.05, "ki": 0.001, "gate": "off", "quick_start": True}),
    "vqf": Contender("vqf", {}),
    "vqf, tau_acc 10 s": Contender("vqf", {"tau_acc": 10.0}),
    "mekf": NEW,
}


def region_readings(capture: ImuData) -> tuple[Floats, Floats]:
    """One reading (M, 3) of specific force, m/s², and field, µT, in the middle of each of M rests."""
    acc, mag = capture.usable("acc"), capture.usable("mag")
    fresh = np.flatnonzero(np.isfinite(mag).all(axis=1) & np.isfinite(acc).all(axis=1))
    rests = stills(capture.t, acc, capture.usable("gyr"))
    at = [fresh[np.searchsorted(fresh, (rest.start + rest.stop) // 2)] for rest in rests]
    return acc[at], mag[at]


def paper_card(capture: ImuData, still: ImuData) -> CalibrationCard:
    """Card as the paper finds it: eq. (13) on one reading for each of 18 poses, and the mean of the rates at rest."""
    fit = by_paper(*region_readings(capture))
    if fit is None:
        raise CalibrationError("the paper's fit gives no ellipsoid. Turn the unit to all faces and edges.")
    method = "[Yu2018] (13)"
    acc, mag = (
        TriadCalibration(linear.matrix, linear.bias, unit, unit, method=method)
        for linear, unit in zip(fit, ("m/s2", "uT"), strict=True)
    )
    rate = np.nanmean(still.usable("gyr"), axis=0)
    gyr = TriadCalibration(np.eye(3), rate, "rad/s", "rad/s", method="mean at rest")
    return CalibrationCard(capture.meta.device, "1970-01-01", method, gyr=gyr, acc=acc, mag=mag)


def best_card(capture: ImuData, raised: ImuData) -> CalibrationCard:
    """Card as Plumbob recommends: accelerometer, gyroscope and magnetometer of the capture, and the mounting."""
    card = None
    for kind in ("accel", "gyro", "mag"):
        card = calibrate(capture, kind, calibration=card).card
    return calibrate(raised, "mount", calibration=card, frame=Frame.NED).card


def simulated(scenario: str, seed: int, *, rate: float = 100.0, unit: str = "random", **how: Any) -> Simulation:
    """A unit of the rig ``buoy``, simulated directly."""
    return simulate(scenario, frame=Frame.NED, sensors=SENSORS, unit=unit, seed=seed, rate=rate, **how)


@cache
def cards(seed: int) -> tuple[CalibrationCard, CalibrationCard]:
    """Cards of a unit: the paper's, and Plumbob's."""
    capture = simulated("faces", seed, rate=50.0, edges="on", wobble="5 deg", move="2 s").imu
    still = simulated("static", seed, duration="10 s").imu
    return paper_card(capture, still), best_card(capture, simulated("raise", seed).imu)


def errors_deg(q_nb: Floats, truth: Floats) -> Floats:
    """Errors (N, 3) of yaw, pitch and roll of attitudes (N, 4), deg."""
    return to_deg(euler_errors(q_nb, truth))


def estimated(one: Contender, made: Simulation, seed: int) -> Floats:
    """Errors (N, 3) of yaw, pitch and roll, deg, of a contender on a unit's samples with its card."""
    imu = apply_card(cards(seed)[0 if one.paper else 1], made.imu)
    return errors_deg(run_stage(imu, Stage(one.filter, one.params), frame=Frame.NED).q_nb, made.truth.q_nb)


def slide(speed: float, stroke: float, seeds: Sequence[int]) -> dict[str, Floats]:
    """Largest errors of roll and pitch, deg, (seeds, 2), of each of `SLIDE`."""
    errors: dict[str, list[Floats]] = {name: [] for name in SLIDE}
    for seed in seeds:
        made = simulated("slide", seed, peak_speed=speed, stroke=stroke)
        for name, contender in SLIDE.items():
            errors[name].append(np.abs(estimated(contender, made, seed)).max(axis=0)[[2, 1]])
    return {name: np.array(each) for name, each in errors.items()}


def sea(seeds: Sequence[int], duration: float) -> dict[str, Floats]:
    """Root mean squares of the errors of roll, pitch and yaw, deg, (seeds, 3), of each of `SEA`, in `duration`, s."""
    rms: dict[str, list[Floats]] = {name: [] for name in SEA}
    for seed in seeds:
        made = simulated("buoy", seed, duration=duration)
        settled = made.imu.t >= SETTLE
        for name, contender in SEA.items():
            rms[name].append(np.sqrt(np.mean(estimated(contender, made, seed)[settled] ** 2, axis=0))[::-1])
    return {name: np.array(each) for name, each in rms.items()}


def gain_scan(
    kps: Sequence[float], speed: float, stroke: float, *, gate: str | float, seed: int = 1
) -> list[tuple[float, float]]:
    """Largest errors of roll and pitch, deg, of the PI law with each Kp on a slide; a unit without errors but noise."""
    made = simulated("slide", seed, unit="calibrated", peak_speed=speed, stroke=stroke)
    largest = []
    for kp in kps:
        track = run_stage(made.imu, Stage("mahony", {"kp": kp, "gate": gate}), frame=Frame.NED)
        _, pitch, roll = np.abs(errors_deg(track.q_nb, made.truth.q_nb)).max(axis=0).tolist()
        largest.append((roll, pitch))
    return largest


def bound(speed: float, kp: float = 0.5) -> float:
    """Inclination that a stroke to a speed, m/s, can feed into the PI law: Kp v/g, deg."""
    return float(to_deg(kp * speed / G0))


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

    `mag_counts` (18, 3): readings of the magnetometer in the 18 regions, counts of its converter; `mag` (18, 3):
    the same, µT; `step`: of a count, µT; `regions`: regions that the specific force fills, of 18; `paper`, `best`:
    by the paper's fit, and by what Plumbob recommends; `still`: the first rest of the capture.
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
    assert isinstance(capture.meta.mag_range, float)
    step = capture.meta.mag_range / 2048.0  # the rig's HMC5983 has 2048 counts to its range
    return CalibratedUnit(
        np.rint(mag / step), mag, step, int(np.count_nonzero(filled(acc))), paper_card(capture, still), best, still
    )


def ring(work: Work, unit: CalibratedUnit) -> tuple[StaticTest, StaticTest]:
    """Static test beside a DCM260B, with the paper's card and with the best one."""
    ring = work.recorded("ring", "ring", session=_unit(work) + _REFERENCE).recording
    return static_test(ring, calibration=unit.paper), static_test(ring, calibration=unit.best)


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

    `t` (N,): times, s; `truth`, `live`: true attitude, and that of the filter while it was recorded; `errors` (N, 3):
    of yaw, pitch and roll, deg, by estimator; `equal`: whether a replay of the bytes gives the live attitude again, to
    the bit; `lines`: lines of attitude that went out at 20 Hz; `overview`: its report, by the filter that reports
    have: tilt by burst, quality flags; `page`: whether its page could be written: the pages of Plumbob may not be
    built here.
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
    try:
        overview.write_html(work.folder / REPORT, overwrite=True)
        page = True
    except MissingExtraError:
        page = False
    return Sailed(imu.t, truth, again.track, errors, again.comparison.equal, lines, overview, page)


def _estimated(contender: Contender, imu: ImuData, unit: CalibratedUnit) -> AttitudeTrack:
    card = unit.paper if contender.paper else unit.best
    return estimate(imu, contender.filter, params=contender.params, calibration=card, frame=Frame.NED).track


def _unit(work: Work) -> str:
    """What a session says of the unit; the rigs of one seed have the same one, by this name."""
    return _UNIT.format(device=f"{SENSORS} #{unit_seed(work.seed, 0)}")


PERIODS: Final = {"sample": 3, "fuse": 10, "send": 50}
"""Of the events, ms [Yu2018]."""
_SLIDE: Final = {"peak_speed": 2.0, "stroke": 0.4}


class Device(NamedTuple):
    """What the program did on the slide of 2 m/s and 0.4 s with the paper's card.

    By task: `rates`: events served per second, Hz; `missed`: events that were not served; `latest`: how late the
    latest call began, s; `waiting`: events missed where the loop waits for the line and for the Flash chip; `calls`:
    begin and end of each call, s. `idle`: share of the time in which the processor sleeps; `roll`, `pitch`: largest
    errors of what went out at 20 Hz, deg; `frames`, `junk`: frames on the wire, and bytes between them; `stored`,
    `same`: records that the log's image gives back, and whether these are the frames that went out, to the bit;
    `years`: until each sector of the log was erased 100 000 times, at 20 Hz.
    """

    rates: dict[str, float]
    missed: dict[str, int]
    latest: dict[str, float]
    idle: float
    waiting: dict[str, int]
    calls: dict[str, tuple[Floats, Floats]]
    roll: float
    pitch: float
    frames: int
    junk: int
    stored: int
    same: bool
    years: float


def run_device(work: Work, card: CalibrationCard) -> Device:
    """Let the program run with a card while the unit is slid, and read its line and its log."""
    image = work.folder / "flash.bin"
    taken = work.recorded(FORMAT, "device", scenario="slide", set=_SLIDE, calibration=card, flash_log=image)
    data = taken.capture.read_bytes()
    track, truth = decoded(data), read_track(taken.truth)
    rows = np.searchsorted(truth.t, track.t - 1e-6)
    _, pitch, roll = np.abs(errors_deg(track.q_nb, truth.q_nb[rows])).max(axis=0).tolist()
    chips = recorded_samples(taken.truth)
    done = run_firmware(chips, calibration=card)
    slow = run_firmware(chips, calibration=card, processor=Processor(uart_waits=True, flash_waits=True))
    log = read_ring(image.read_bytes(), find_format(FORMAT))
    frames = decode(data, find_format(FORMAT))
    seconds = float(chips.t[-1])
    return Device(
        rates={name: count / seconds for name, count in done.served.items()},
        missed=done.missed,
        latest=done.latest,
        idle=done.idle,
        waiting=slow.missed,
        calls={name: (to_s(call.begun_ns), to_s(call.done_ns)) for name, call in done.calls.items()},
        roll=roll,
        pitch=pitch,
        frames=len(track),
        junk=frames.counts.junk,
        stored=log.records,
        same=log.stream == data[: len(log.stream)],
        years=done.flash.life_years(),
    )
