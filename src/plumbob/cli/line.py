"""What verbs on a live stream share: the options of it and of its estimate, and a line on the terminal meanwhile."""

import argparse
import sys
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from plumbob.cli import common

if TYPE_CHECKING:
    from plumbob.session.watch import Watch


def add_line(p: argparse._ActionsContainer) -> None:
    """Options of a line, besides its session file and ``--from``."""
    p.add_argument("--port", metavar="DEV", help="serial line, such as /dev/ttyUSB0")
    p.add_argument(
        "--rate",
        metavar="HZ",
        help="frames per second of --port or --from, where the format has neither clock nor rate",
    )
    p.add_argument(
        "--time",
        choices=("host", "count"),
        help="of --port; count: by the frames alone, for a line that loses nothing, such as one faster than real time",
    )
    p.add_argument("--iio", metavar="DEV", help="buffer of an IIO device (Linux), by its name or number")
    p.add_argument("--baud", type=int, default=115200, help="its speed (115200)")
    p.add_argument("--format", metavar="NAME|TOML", help="known device, see 'plumbob devices', or a format file")
    p.add_argument(
        "--unit", metavar="NAME|N", help="which unit, where a frame has several, as the six of the rig 'arm'"
    )


def line_of(args: argparse.Namespace) -> dict[str, Any]:
    """What the options of `add_line` say, as `plumbob.record` takes it."""
    return {name: getattr(args, name) for name in ("port", "rate", "time", "iio", "baud", "format", "unit")}


def add_estimate(p: argparse.ArgumentParser) -> None:
    """Options of the estimate."""
    p.add_argument("--filter", metavar="NAME", help="estimate with this filter; see 'plumbob filters'")
    p.add_argument("--params", metavar="P", help=common.PARAMS_HELP)
    common.add_frame(p, "navigation frame; needed with --filter")
    common.add_calibration(p, "calibration card to apply")
    common.add_noise(p)
    common.add_init(p)


def estimate_of(args: argparse.Namespace) -> dict[str, Any]:
    """What the options of `add_estimate` say, as `plumbob.record` and `plumbob.replay` take it."""
    from plumbob.core.errors import ParameterError

    given = {name: getattr(args, name) for name in ("filter", "frame", "calibration", "noise", "init")}
    if args.filter is None:
        return given | {"params": dict(common.pairs(args.params))}
    chosen = common.stages(args.filter, args.params)
    if len(chosen) != 1:
        raise ParameterError(f"{args.verb} takes one filter; run it again for another.")
    return given | {"filter": chosen[0].filter, "params": chosen[0].params}


class Status:
    """One line on a terminal, once a second, and every remark as a note out of its way."""

    def __init__(self, *, quiet: bool = False) -> None:
        self._next = 0.0
        self._shown = sys.stderr.isatty() and not quiet

    def show(self, watch: "Watch") -> None:
        """Show now and then what a stream gives."""
        from plumbob.session.watch import attitude_of

        if not self._shown or watch.last is None or (t := float(watch.last.imu.t[-1])) < self._next:
            return
        self._next = t + 1.0
        bare = "" if watch.stream.session.card else " UNCALIBRATED"
        junk = watch.stream.decoder.counts.junk
        told = attitude_of(watch.last)
        self._draw(f"\r{t:9.1f} s  {watch.samples} samples{bare}  {junk} junk bytes  {told}\033[K")

    def note(self, text: str) -> None:
        """Tell the user, and never mind if nobody reads it any more: a recording outlives its terminal."""
        self._draw("\r\033[K")
        with suppress(OSError):
            common.note(text)

    def close(self) -> None:
        """End the line on the terminal."""
        self._draw("\r\033[K")
        self._shown = False

    def _draw(self, text: str) -> None:
        if self._shown:
            with suppress(OSError):
                sys.stderr.write(text)
                sys.stderr.flush()
