"""What record and replay share: a session from a file or from options, its estimate, and how a run is reported."""

import argparse
import sys
from collections.abc import Mapping
from contextlib import suppress
from typing import TYPE_CHECKING, Any, Final

from plumbob.cli import common
from plumbob.core.text import counted

if TYPE_CHECKING:
    from plumbob.acquisition.transport import Event
    from plumbob.protocols.decode import Counts
    from plumbob.session.session import Session
    from plumbob.session.stream import Line, Part


LONG = 60.0
"""Duration from which on the drift of a device clock is told, s."""

SETTLED = 30.0
"""Time after which the estimated bias of a start in motion says something, s."""


def add_estimate(p: argparse.ArgumentParser) -> None:
    """Options of the estimate."""
    p.add_argument("--filter", metavar="NAME", help="estimate with this filter; see 'plumbob filters'")
    p.add_argument("--params", metavar="P", help=common.PARAMS_HELP)
    common.add_frame(p, "navigation frame; needed with --filter")
    common.add_calibration(p, "calibration card to apply")
    common.add_noise(p)
    common.add_init(p)


def estimate_tables(args: argparse.Namespace) -> dict[str, Mapping[str, Any]]:
    """Tables of a session from the options of the estimate."""
    from plumbob.core.errors import ParameterError

    tables: dict[str, Mapping[str, Any]] = {}
    if args.calibration:
        tables["calibration"] = {"card": str(args.calibration)}
    if args.filter is None:
        if args.params or args.noise or args.init:
            raise ParameterError("--params, --noise and --init belong to a filter; name one with --filter.")
        return tables
    estimate: dict[str, Any] = {"filter": args.filter}
    if given := dict(common.pairs(args.params)):
        estimate["params"] = {key.removeprefix(f"{args.filter}."): value for key, value in given.items()}
    if args.noise:
        estimate["noise"] = str(args.noise)
    if args.init:
        estimate["init"] = args.init
    return tables | {"estimate": estimate}


_DOUBT_BYTES: Final = 256
_DOUBT_FRAMES: Final = 8
"""Bytes, and frames of the greatest length, within which one frame must have been found."""


class Status:
    """One line on a terminal, once a second, and every event as a note."""

    def __init__(self, line: "Line", *, quiet: bool = False) -> None:
        self._line, self._next = line, 0.0
        self._shown = sys.stderr.isatty() and not quiet
        self.samples = 0
        self.last: Part | None = None
        self.temperature_beyond: str | None = None
        self.bias_beyond: str | None = None
        self._doubted = False

    def on_part(self, part: "Part") -> None:
        """Count, and show now and then."""
        self.samples += part.t_ns.size
        self.last = part
        self._watch(part)
        t = float(part.imu.t[-1])
        if self._shown and t >= self._next:
            self._next = t + 1.0
            counts = self._line.decoder.counts
            self._draw(
                f"\r{t:9.1f} s  {self.samples} samples{self._bare}  {counts.junk} junk bytes  {attitude_of(part)}\033[K"
            )

    @property
    def _bare(self) -> str:
        return "" if self._line.session.card else " UNCALIBRATED"

    def _watch(self, part: "Part") -> None:
        """Say once each that the temperature leaves the span of the card, and the bias the filter's prior."""
        from plumbob.data.calibrated import temperature_beyond
        from plumbob.filters.offline import bias_beyond

        card, filter_ = self._line.session.card, self._line.filter
        at = f"at {float(part.imu.t[0]):.1f} s"
        if card is not None and self.temperature_beyond is None:
            self.temperature_beyond = temperature_beyond(card, part.imu)
            self._tell(at, self.temperature_beyond)
        settled = float(part.imu.t[-1]) >= SETTLED
        if filter_ is not None and part.track is not None and settled and self.bias_beyond is None:
            self.bias_beyond = bias_beyond(filter_, part.track)
            self._tell(at, self.bias_beyond)

    def _tell(self, at: str, what: str | None) -> None:
        if what is not None:
            self._note(f"{at}: {what}")

    def _note(self, text: str) -> None:
        """Tell the user, and never mind if nobody reads it any more: a recording outlives its terminal."""
        self._draw("\r\033[K")
        with suppress(OSError):
            common.note(text)

    def _draw(self, text: str) -> None:
        if self._shown:
            with suppress(OSError):
                sys.stderr.write(text)
                sys.stderr.flush()

    def look(self) -> None:
        """Say once that bytes come and none of them is a frame, while there is time to do something about it."""
        counts, form = self._line.decoder.counts, self._line.decoder.form
        if self._doubted or counts.framed or counts.received < max(_DOUBT_BYTES, _DOUBT_FRAMES * form.framing.most):
            return
        self._doubted = True
        none = f"none of the first {counts.received} bytes is a frame of {form.name}{common.why_rejected(counts)}"
        self._note(f"{none}: is it the right format, and baud?")

    def on_event(self, event: "Event") -> None:
        """Say it."""
        self._note(f"{event.kind}: {event.text}")

    def close(self) -> None:
        """End the line on the terminal."""
        self._draw("\r\033[K")
        self._shown = False


def nothing_of(line: "Line") -> str:
    """Why a line gave no sample, and where to look."""
    counts, session = line.decoder.counts, line.session
    if not counts.received:
        return "no byte has arrived: is the device on, is it the right port, does it send by itself?"
    if counts.frames[session.message]:
        return (
            f"none of {counts.frames[session.message]} frames could be used: their times repeat or contradict others."
        )
    if others := ", ".join(f"{count} of {name}" for name, count in counts.frames.items() if count):
        return f"no frame of message {session.message} has come, but {others}; name that in [format] message."
    none = f"none of {counts.received} bytes is a frame of {session.form.name}{common.why_rejected(counts)}"
    return f"{none}. {_look_at(counts)}"


def _look_at(counts: "Counts") -> str:
    """What to look at first, by what most candidates failed."""
    advice = (
        (counts.bad_checksum, "Frames begin as they should, but their checksum fails. Check [frame] length, and kind, "
         "at, from and to of its checksum."),
        (counts.bad_content, "Frames begin as they should, but constants, digits or parity differ. Check those."),
        (counts.bad_length, "Check [frame] length_field, or the speed of the line."),
        (counts.unknown, "Frames pass their check, but match no message. Check the constants of each."),
    )  # fmt: skip
    most, told = max(advice, key=lambda one: one[0])
    told = told if most else "Nothing begins as a frame should. Check the speed of the line and [frame] sync."
    return f"{told} 'plumbob decode' tries other formats on a file of raw bytes."


def attitude_of(part: "Part | None") -> str:
    """Last attitude of a part in words."""
    from plumbob.core.units import to_deg
    from plumbob.rotations import euler_zyx_from_quat

    if part is None or part.track is None:
        return ""
    yaw, pitch, roll = to_deg(euler_zyx_from_quat(part.track.q_nb[-1]))
    return f"roll {roll:.2f}°, pitch {pitch:.2f}°, yaw {yaw:.2f}°"


def report_of(session: "Session", line: "Line", status: Status) -> dict[str, Any]:
    """What a run gave, for JSON."""
    from plumbob.files import inferred
    from plumbob.filters.offline import declination_deg
    from plumbob.protocols.overlap import passes_anything
    from plumbob.session.sources import KERNEL

    last = status.last
    by_kernel = session.source is not None and session.source.kind in KERNEL
    track = None if last is None else last.track
    return {
        "session": session.name,
        "format": session.form.name,
        "unchecked_bytes": session.form.framing.length if passes_anything(session.form) and not by_kernel else None,
        "device": session.meta.device,
        "calibration": last.imu.meta.calibration if last else session.card and session.card.name,
        "temperature_beyond": status.temperature_beyond,
        "bias_beyond": status.bias_beyond,
        "filter": None if line.filter is None else line.filter.describe(),
        "frame": None if session.frame is None else str(session.frame),
        "north": None if track is None else str(track.north),
        "declination_deg": None if track is None or line.filter is None else declination_deg(line.filter, track),
        "samples": status.samples,
        "duration_s": 0.0 if last is None else float(last.imu.t[-1]),
        **line.report(),
        "inferred_gaps": next(iter(inferred(line.time_report())), None),
    }


def print_report(report: Mapping[str, Any], last: str) -> None:
    """Print what a run gave, as text."""
    from plumbob.data import calibration_told
    from plumbob.protocols.page import UNCHECKED
    from plumbob.rotations.headings import counted_from

    told, counts = report["time"], report["bytes"]
    rate = "unknown" if told["rate"] is None else f"{told['rate']:.6g} Hz"
    print(f"samples      {report['samples']} in {report['duration_s']:.3f} s, rate {rate} by {told['mode']}")
    print(f"bytes        {counts['received']}, of frames {counts['framed']}, junk {counts['junk']}")
    if report["unchecked_bytes"]:
        print(f"checks       {UNCHECKED.format(report['unchecked_bytes'])}")
    rejected = {k: counts[k] for k in ("bad_checksum", "bad_content", "bad_length", "unknown") if counts[k]}
    if rejected:
        words = ", ".join(f"{name.replace('_', ' ')} {count}" for name, count in rejected.items())
        print(f"rejected     {words}")
    if told["lost"] or told["gap_count"] or report["not_usable"]:
        lost, gaps = counted(told["lost"], "frame"), counted(told["gap_count"], "gap")
        print(f"lost         {lost} in {gaps}; {report['not_usable']} repeated or late")
    if report["inferred_gaps"]:
        print(f"inferred     {report['inferred_gaps'].partition(': ')[2]}")
    long_enough = report["duration_s"] >= LONG  # before, jitter of the host passes for drift
    if long_enough and told["drift_ppm"] is not None and told["mode"] == "clock":
        print(f"device clock {told['drift_ppm']:+.1f} ppm against this host")
    print(f"calibration  {calibration_told(report['calibration'])}")
    if report["filter"]:
        print(f"filter       {report['filter']}")
    if report["north"]:
        print(
            f"frame        {report['frame']}, heading from {counted_from(report['north'], report['declination_deg'])}"
        )
        print(f"at the end   {last}")
