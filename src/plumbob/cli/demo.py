"""plumbob demo: an emulated buoy, calibrated by hand, then its whole line from bytes to a page of errors."""

import argparse
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from plumbob.cli import common
from plumbob.cli.engine import Verb, show
from plumbob.core.errors import DecodeError, MissingExtraError, ParameterError, PlumbobError
from plumbob.core.files import replacing, write_text
from plumbob.core.text import counted
from plumbob.core.units import Quantity, parse

if TYPE_CHECKING:
    from plumbob.core.check import Floats
    from plumbob.data import AttitudeTrack, ImuData
    from plumbob.data.cards import CalibrationCard
    from plumbob.filters.offline import Stage
    from plumbob.live.session import Session
    from plumbob.live.stream import Stream
    from plumbob.protocols.decode import Counts
    from plumbob.simulation import Scenario

_SAME_TIME: Final = 1e-6
"""s: the buoy's clock counts microseconds."""


def require_as_sent(recorded: "ImuData | None", sent: "ImuData", counts: "Counts") -> None:
    """Refuse a recording that is not what was sent.

    Parameters
    ----------
    recorded : ImuData or None
        Samples in the recording, uncalibrated.
    sent : ImuData
        Samples that the emulation put into its frames.
    counts : Counts
        What became of the bytes.

    Raises
    ------
    DecodeError
        With all that differs.
    """

    wrong = [*_bytes(counts), *(_samples(recorded, sent) if recorded is not None else ("no sample was recorded",))]
    if wrong:
        raise DecodeError(
            f"the recording is not what was sent: {'; '.join(wrong)}. No figure of this demo can be trusted. Run it "
            "again; if that gives the same, please report it, with what this machine was doing meanwhile."
        )


def _bytes(counts: "Counts") -> Iterator[str]:
    if counts.framed < counts.received:
        yield f"{counts.received - counts.framed} of {counts.received} bytes belong to no whole frame"


def _samples(recorded: "ImuData", sent: "ImuData") -> Iterator[str]:
    import numpy as np

    from plumbob.core import flags

    if len(recorded) != len(sent):
        yield f"recorded {len(recorded)} of {len(sent)} samples"
    size = min(len(recorded), len(sent))
    ours, theirs = _values_table(recorded, size), _values_table(sent, size)
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


def _values_table(imu: "ImuData", size: int) -> "Floats":
    """What was measured, a row for each of the first samples; the emulation has rounded it to the wire's counts."""
    import numpy as np

    return np.column_stack([getattr(imu, name)[:size] for name in imu.triads])


CARD: Final = "card.json"
CERTIFICATE: Final = "certificate.html"
HAND: Final = "hand.bin"
MOUNTING: Final = "mounting.bin"


def calibrate_unit(out: Path, *, seed: int) -> "CalibrationCard":
    """Calibrate the buoy's unit of a seed by two captures, 40 poses by hand and a raised nose; card and page in `out`.

    The seed is that of the unit and of its noise: the captures and the sea have the same one.
    """
    from plumbob.calibration.calibrate_gyro import calibrate_by_hand
    from plumbob.calibration.calibrate_mount import mount_by_poses
    from plumbob.calibration.calibration import capture, card_of
    from plumbob.calibration.report import certificate
    from plumbob.rotations import Frame
    from plumbob.simulation import scenario

    poses = _decoded(out / HAND, scenario("poses", move=2.0), seed)
    raised = _decoded(out / MOUNTING, scenario("raise"), seed)
    captured = capture(poses, triads=("acc",), if_present=("gyr", "mag"))
    fits = calibrate_by_hand(captured)
    mounted = mount_by_poses(capture(raised, triads=(), base=card_of(captured, fits)), frame=Frame.NED)
    card = card_of(captured, fits, mounted=mounted)
    card.save(out / CARD, overwrite=True)
    report = certificate(card, fits, recording=f"{HAND} and {MOUNTING}, emulated")
    report.write_html(out / CERTIFICATE, overwrite=True)
    return card


def _decoded(path: Path, motion: "Scenario", seed: int) -> "ImuData":
    """Samples of a capture, from the bytes that the unit says during a motion, in a file as a logger keeps them."""
    from plumbob.live.rigs.plan import PLANS
    from plumbob.live.rigs.rig import make_rig
    from plumbob.live.runner import run_stream
    from plumbob.live.session_toml import capture_session
    from plumbob.live.sinks import Collected
    from plumbob.live.sources import open_source
    from plumbob.live.stream import Stream
    from plumbob.protocols.format_toml import find_format

    rig = make_rig(replace(PLANS["buoy"], scenario=motion, duration=motion.duration), find_format("buoy"), seed=seed)
    with replacing(path, overwrite=True) as temporary:
        temporary.write_bytes(rig.stream())
    device = next(iter(rig.units.values())).imu.meta.device
    session, collected = capture_session(capture=path, format="buoy", device=device, frame="NED"), Collected()
    run_stream(Stream(session), open_source(session.source), sinks=[collected])
    imu = collected.imu(calibrated=False)
    if imu is None:
        raise DecodeError(f"{path} holds no sample that could be decoded.")
    return imu


TRUTH: Final = "truth.parquet"
SESSION_FILE: Final = "session.toml"
RECORDING: Final = "buoy.mcap"
TEXT: Final = "buoy.txt"
PAGE: Final = "report.html"
FILES: Final = (
    CARD, CERTIFICATE, HAND, MOUNTING, TRUTH, "truth.card.json", SESSION_FILE, RECORDING, TEXT, PAGE,
)  # fmt: skip
WITHOUT_BROWSER: Final = 20.0
WITH_BROWSER: Final = 600.0
"""How long the live page is served, s."""
SEED: Final = 1
SPEED: Final = 60
DURATION: Final = "600s"
SETTLE: Final = 120.0
"""Left out of the errors, s: what a calibration by hand does not find (sensitivity to g) is learned as a bias first."""
SETTLE_SHARE: Final = 0.2
"""Of a shorter sea."""
DISK: Final = 120.0
"""Longest wait for the disk of a busy machine at the end, s."""
SESSION: Final = """\
# The buoy on its serial line. For hardware: the real port and baud rate, and without 'speed' and 'time'. A line that
# runs faster than time says nothing by when it is read: its time is counted from its frames.
kind = "plumbob session"
version = 1

[source]
kind = "serial"
port = "{port}"
baud = 115200
speed = {speed}
time = "count"

[format]
name = "buoy"

[imu]
device = "{device}"
frame = "NED"
declination = "0 deg"

[calibration]
card = "{card}"

[estimate]
filter = "mekf"

[record]
path = "{recording}"

[output]
every = "50 ms"
text = "{text}"
"""


def stages() -> "list[Stage]":
    """Filters that are compared with the live one: a compass alone, the paper's filter, and the same for waves."""
    from plumbob.filters.offline import Stage

    return [
        Stage("tilt_compass", {}, "accelerometer and compass"),
        Stage("mahony", {"kp": 0.5, "ki": 0.03, "gate": None}, "paper, no gate"),
        Stage("mahony", {"kp": 0.5, "ki": 0.03, "gate": "0.08 g"}, "paper, gate 0.08 g"),
        Stage("mahony", {"kp": 0.1, "ki": 0.003, "gate": None, "quick_start": True}, "gains for waves"),
    ]


def demo(args: argparse.Namespace, verb: Verb, call: Callable[..., Any]) -> int:
    """Run the buoy's line, or whole papers."""
    papers = bool(getattr(args, "papers", []))
    idle = [
        name for name in (("view", "duration") if papers else ("seed", "lang", "jobs")) if getattr(args, name, None)
    ]
    if idle:
        raise ParameterError(f"--{idle[0]} is for {'the buoy alone' if papers else 'papers'}; leave it out.")
    if not papers:
        return _tour(args)
    results = call(progress=lambda what, done, of: common.note(f"{what} ({done}/{of})"))  # a step takes minutes
    return show(args, verb, results, f"{'pages':12} {results.folder / 'index.html'}")


def _tour(args: argparse.Namespace) -> int:
    from plumbob.data import calibration_told
    from plumbob.door.evaluate import evaluate
    from plumbob.evaluation.report import comparison
    from plumbob.live.emulated import running_rig

    duration, args.out = parse(args.duration or DURATION, Quantity.TIME), Path(getattr(args, "out", "demo-out"))
    settle = min(SETTLE, SETTLE_SHARE * duration)
    started = time.perf_counter()
    args.out.mkdir(parents=True, exist_ok=True)
    common.check_outputs(args, *(args.out / name for name in FILES))  # from here on, they may be replaced
    card = calibrate_unit(args.out, seed=SEED)
    _say(args, f"1 calibrated  by 40 poses by hand and a raised nose: {args.out / CARD}, {args.out / CERTIFICATE}")
    rig = ("--speed", str(SPEED), "--seed", str(SEED), "--duration", f"{duration!r}s")
    with running_rig("buoy", *rig, "--truth", str(args.out / TRUTH), "--force") as port:
        _say(args, f"2 emulated    the buoy's hardware on {port}, {duration:g} s of sea at {SPEED} times its speed")
        line = _live(args.out, port, card.device)
    counts = line.decoder.counts
    _say(args, f"3 recorded    {args.out / RECORDING}: {counts.received} bytes, {counts.junk} of them junk")
    sent, truth = _truth(args.out)
    tracks, same = _replayed(args.out, sent)
    _say(args, f"4 replayed    {same} live attitudes come out again, every bit")
    results = {name: evaluate(track, truth, settle=settle) for name, track in tracks.items()}
    facts = {"scenario": truth.source, "sensors": card.device, "calibration": calibration_told(card.name)}
    title = "A buoy in waves, five ways to its attitude, and one without calibration"
    report = comparison(results, title=title, facts=list(facts.items()))
    if not args.json:
        print(f"5 evaluated   after {settle:.3g} s of settling, in {time.perf_counter() - started:.1f} s\n")
        print(replace(report, facts=(), remarks=(), parts=()).text())
    page = report.write_html(args.out / PAGE, overwrite=True)
    certificate = args.out / CERTIFICATE
    if args.json:
        numbers = {name: result.summary() for name, result in results.items()}
        common.print_json({"report": str(page), "certificate": str(certificate), "filters": numbers})
        return 0
    print(f"\ncertificate  {certificate.resolve()}\nreport       {page.resolve()}")
    if args.view:
        _show(args.out)
    return 0


def _show(out: Path) -> None:
    """Show the buoy on the live page for a while; where that cannot be, say why."""
    from plumbob.cli.special import has_display
    from plumbob.live.transports.transport import Stop
    from plumbob.viewer.view import view

    browser, stop = has_display(), Stop()
    wait = WITH_BROWSER if browser else WITHOUT_BROWSER
    how = f"for {wait / 60.0:.0f} min, or until Ctrl-C" if browser else f"for {wait:.0f} s"

    def opened(url: str) -> None:
        print(f"live page    {url}\n             {how}; 'plumbob view --emulate buoy' shows it again", flush=True)

    try:
        with common.stopped_by_signals(stop):
            shown = view(
                emulate="buoy", also=("mahony",), control=True, http_port=0, folder=out, duration=wait,
                open_browser=browser, stop=stop, opened=opened,
            )  # fmt: skip
    except MissingExtraError as missing:
        common.note(f"the live page is not shown: {missing}")
        return
    print(f"shown        {counted(0 if shown.ran is None else shown.ran.samples, 'sample')} as they came")


def _live(out: Path, port: str, device: str) -> "Stream":
    """Run the line on the port until the buoy has said everything."""
    from plumbob.live.runner import run_stream
    from plumbob.live.sinks import Collected, RecordingSink, TextSink
    from plumbob.live.sources import open_source
    from plumbob.live.stream import Stream

    session = _session(out, port, device)
    line, collected = Stream(session), Collected()
    assert session.record and session.output.text
    recording_sink = RecordingSink(session, session.record)
    sink = TextSink(session.output.text, session.output.every)
    run_stream(line, open_source(session.source), sinks=[collected, sink], recording=recording_sink, until_lost=True)
    recording_sink.recorder.close(DISK)
    return line


def _session(out: Path, port: str, device: str) -> "Session":
    """Write the session file as a user would, for this unit's card, and load it."""
    from plumbob.live.session_toml import load_session

    for name in (RECORDING, TEXT):
        (out / name).unlink(missing_ok=True)
    file = out / SESSION_FILE
    paths = {"card": CARD, "recording": out / RECORDING, "text": out / TEXT}
    write_text(file, SESSION.format(port=port, speed=SPEED, device=device, **paths), overwrite=True)
    return load_session(file)


def _replayed(out: Path, sent: "ImuData") -> "tuple[dict[str, AttitudeTrack], int]":
    """Attitudes by name, the live filter's, that without its card and the others', and how many live ones are equal."""
    from plumbob.filters.offline import run_stage
    from plumbob.live.replay import open_recording, replay

    log, session = open_recording(out / RECORDING)
    assert session.stage and session.frame
    replayed = replay(log, session=session, check=True)
    raw, calibrated = (replayed.found.imu(calibrated=calibrated) for calibrated in (False, True))
    require_as_sent(raw, sent, replayed.stream.decoder.counts)
    same = replayed.comparison
    if same is None or not same.equal or raw is None or calibrated is None or replayed.track is None:
        raise PlumbobError(f"the replay differs from what was live: {same}")
    tracks = {"error-state EKF (live)": replayed.track}
    others = [(raw, replace(session.stage, label="the same, uncalibrated")), *((calibrated, s) for s in stages())]
    with common.progress("estimating", len(others)) as advance:
        for imu, stage in others:
            tracks[stage.name] = run_stage(imu, stage, frame=session.frame)
            advance(1)
    return tracks, same.compared


def _truth(out: Path) -> "tuple[ImuData, AttitudeTrack]":
    """What the emulation put into its frames, and the attitude behind it."""
    from plumbob import files

    recording = files.read(out / TRUTH)
    if recording.imu is None or recording.track is None:
        raise DecodeError(f"{out / TRUTH} lacks samples or attitude.")
    return recording.imu, recording.track


def _say(args: argparse.Namespace, line: str) -> None:
    if not args.json:
        print(line, flush=True)
