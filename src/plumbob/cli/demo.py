"""An emulated buoy, calibrated by hand, then its whole line from bytes to a page of errors: `plumbob demo`."""

import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from plumbob.core import flags
from plumbob.core.errors import DecodeError, PlumbobError
from plumbob.core.files import write_text
from plumbob.core.resources import packaged
from plumbob.core.text import counted
from plumbob.data import AttitudeTrack, ImuData, calibration_told
from plumbob.data.cards import CalibrationCard
from plumbob.door.calibrate import calibrate
from plumbob.door.evaluate import evaluate
from plumbob.door.reading import read
from plumbob.evaluation.evaluation import Evaluation
from plumbob.filters.offline import Stage, run_stage
from plumbob.live import emulated
from plumbob.live.replay import replay
from plumbob.live.stream import Stream
from plumbob.papers.studies import Study, record_line
from plumbob.protocols.decode import Counts
from plumbob.reporting.evaluation import side_by_side
from plumbob.reporting.report import Report

Progress = Callable[[str, int, int], object]

CARD, CERTIFICATE, PAGE = "card.json", "certificate.html", "report.html"
TRUTH, SESSION_FILE, RECORDING, TEXT = "truth.parquet", "session.toml", "buoy.mcap", "buoy.txt"
HAND, MOUNTING = "hand", "mounting"
FILES: Final = (
    CARD, CERTIFICATE, TRUTH, "truth.card.json", SESSION_FILE, RECORDING, TEXT, PAGE,
    *(f"{name}.{end}" for name in (HAND, MOUNTING)
      for end in ("bin", "mcap", "truth.parquet", "truth.card.json", "session.toml")),
)  # fmt: skip
DEVICE: Final = "emulated buoy"
SEED: Final = 1
SPEED: Final = 60
SETTLE: Final = 120.0
"""Left out of the errors, s: what a calibration by hand does not find (sensitivity to g) is learned as a bias first."""
SETTLE_SHARE: Final = 0.2  # of a shorter sea
_SAME_TIME: Final = 1e-6  # s: the buoy's clock counts microseconds


def stages() -> list[Stage]:
    """Filters that are compared with the live one: a compass alone, the paper's filter, and the same for waves."""
    return [
        Stage("tilt_compass", {}, "accelerometer and compass"),
        Stage("mahony", {"kp": 0.5, "ki": 0.03, "gate": None}, "paper, no gate"),
        Stage("mahony", {"kp": 0.5, "ki": 0.03, "gate": "0.08 g"}, "paper, gate 0.08 g"),
        Stage("mahony", {"kp": 0.1, "ki": 0.003, "gate": None, "quick_start": True}, "gains for waves"),
    ]


class Demo(NamedTuple):
    """What the demo made: a page, the certificate of the unit's calibration, and errors by filter."""

    page: Path
    certificate: Path
    report: Report
    evaluations: Mapping[str, Evaluation]


def demo(folder: Path, duration: float, say: Callable[[str], object], progress: Progress | None) -> Demo:
    """Calibrate the buoy's unit, record a sea of so many seconds over its line, replay it, and judge the filters."""
    settle, started = min(SETTLE, SETTLE_SHARE * duration), time.perf_counter()
    folder.mkdir(parents=True, exist_ok=True)
    card = calibrate_unit(folder, seed=SEED)
    say(f"1 calibrated  by 40 poses by hand and a raised nose: {folder / CARD}, {folder / CERTIFICATE}")
    rig = ("--speed", str(SPEED), "--seed", str(SEED), "--duration", f"{duration!r}s")
    with emulated.running_rig("buoy", *rig, "--truth", str(folder / TRUTH), "--force") as port:
        say(f"2 emulated    the buoy's hardware on {port}, {duration:g} s of sea at {SPEED} times its speed")
        counts = _record(folder, port, card.device).decoder.counts
    say(f"3 recorded    {folder / RECORDING}: {counts.received} bytes, {counts.junk} of them junk")
    sent = read(folder / TRUTH)
    if sent.imu is None or sent.track is None:
        raise DecodeError(f"{folder / TRUTH} lacks samples or attitude.")
    tracks, same = _replayed(folder, sent.imu, progress)
    say(f"4 replayed    {same} live attitudes come out again, every bit")
    evaluations = {name: evaluate(track, sent.track, settle=settle) for name, track in tracks.items()}
    facts = [("scenario", sent.track.source), ("sensors", sent.imu.meta.device)]
    title = "A buoy in waves, five ways to its attitude, and one without calibration"
    report = side_by_side(evaluations, title=title, facts=[*facts, ("calibration", calibration_told(card.name))])
    say(f"5 evaluated   after {settle:.3g} s of settling, in {time.perf_counter() - started:.1f} s")
    page = report.write_html(folder / PAGE, overwrite=True)
    return Demo(page, folder / CERTIFICATE, report, evaluations)


def calibrate_unit(folder: Path, *, seed: int) -> CalibrationCard:
    """Calibrate the buoy's unit of a seed by two captures, 40 poses by hand and a raised nose; writes card and page.

    The seed is that of the unit and of its noise: the captures and the sea have the same one.
    """
    work, unit = Study("buoy", folder, seed), f'[imu]\ndevice = "{DEVICE}"\nframe = "NED"\n'
    poses = work.recorded("buoy", HAND, scenario="poses", set={"move": 2.0}, session=unit).recording
    raised = work.recorded("buoy", MOUNTING, scenario="raise", session=unit).recording
    by_hand = calibrate(poses, "hand")
    mounted = calibrate(raised, "mount", calibration=by_hand.card, frame="NED")
    mounted.save(folder / CARD, overwrite=True)
    report = replace(mounted, fits=by_hand.fits).report(recording=f"{HAND}.bin and {MOUNTING}.bin, emulated")
    report.write_html(folder / CERTIFICATE, overwrite=True)
    return mounted.card


def _record(folder: Path, port: str, device: str) -> Stream:
    """Write the session file as a user would, and run the line on the port until the buoy has said everything."""
    for name in (RECORDING, TEXT):
        (folder / name).unlink(missing_ok=True)
    paths = {"card": CARD, "recording": folder / RECORDING, "text": folder / TEXT}
    content = packaged("cli/demo.session.toml").format(port=port, speed=SPEED, device=device, **paths)
    return record_line(write_text(folder / SESSION_FILE, content, overwrite=True))


def _replayed(folder: Path, sent: ImuData, progress: Progress | None) -> tuple[dict[str, AttitudeTrack], int]:
    """Attitudes by name, the live filter's, that without its card and the others', and how many live ones are equal."""
    replayed = replay(folder / RECORDING, check=True)
    session, same = replayed.stream.session, replayed.comparison
    raw, calibrated = (replayed.found.imu(calibrated=calibrated) for calibrated in (False, True))
    require_as_sent(raw, sent, replayed.stream.decoder.counts)
    if same is None or not same.equal or raw is None or calibrated is None or replayed.track is None:
        raise PlumbobError(f"the replay differs from what was live: {same}")
    assert session.stage and session.frame
    tracks = {"error-state EKF (live)": replayed.track}
    others = [(raw, replace(session.stage, label="the same, uncalibrated")), *((calibrated, s) for s in stages())]
    for done, (imu, stage) in enumerate(others):
        if progress is not None:
            progress("estimating", done, len(others))
        tracks[stage.name] = run_stage(imu, stage, frame=session.frame)
    return tracks, same.compared


def require_as_sent(recorded: ImuData | None, sent: ImuData, counts: Counts) -> None:
    """Refuse a recording, uncalibrated, that is not what the emulation put into its frames, with all that differs."""
    wrong = ["no sample was recorded"] if recorded is None else [*_differences(recorded, sent)]
    if counts.framed < counts.received:
        wrong.insert(0, f"{counts.received - counts.framed} of {counts.received} bytes belong to no whole frame")
    if wrong:
        raise DecodeError(
            f"the recording is not what was sent: {'; '.join(wrong)}. No figure of this demo can be trusted. Run it "
            "again; if that gives the same, please report it, with what this machine was doing meanwhile."
        )


def _differences(recorded: ImuData, sent: ImuData) -> Iterator[str]:
    if len(recorded) != len(sent):
        yield f"recorded {len(recorded)} of {len(sent)} samples"
    size = min(len(recorded), len(sent))  # the emulation has rounded its values to the wire's counts
    ours, theirs = (np.column_stack([getattr(imu, n)[:size] for n in imu.triads]) for imu in (recorded, sent))
    differ = ((ours != theirs) & ~(np.isnan(ours) & np.isnan(theirs))).any(axis=1)
    if differ.any():
        yield f"values differ in {np.count_nonzero(differ)} of {size}, first at {sent.t[np.argmax(differ)]:.2f} s"
    late = float(np.abs(recorded.t[:size] - recorded.t[0] - sent.t[:size] + sent.t[0]).max())
    if late > _SAME_TIME:
        yield f"times are wrong by up to {late:.6g} s"
    long, due = (float(imu.t[-1] - imu.t[0]) for imu in (recorded, sent))
    if abs(long - due) > _SAME_TIME:
        yield f"they last {long:.2f} s instead of {due:.2f} s"
    if gaps := int(np.count_nonzero(recorded.flags & np.uint32(flags.GAP))):
        yield f"flagged: {counted(gaps, 'gap')}"
