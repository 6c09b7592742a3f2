"""What the kinds of `plumbob calibrate` share: their options, the capture, and what is printed and written."""

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from plumbob.cli import common
from plumbob.cli.calibrating import live, room

if TYPE_CHECKING:
    from plumbob.calib.fitted import Fitted
    from plumbob.calib.mount import Mounted
    from plumbob.calib.refusal import CaptureRefusedError
    from plumbob.pipeline.calibration import Capture


def add_options(
    p: argparse.ArgumentParser, *, file: str = "recording of the capture", guide: str | None = None
) -> None:
    """Options that every kind has; a kind with a guide of `plumbob.pipeline.guided` also those of a live capture."""
    p.add_argument("file", type=Path, nargs="?" if guide else None, metavar="INPUT", help=file)
    common.add_profile(p)
    raw = "; with --live: raw bytes in a file, as a logger keeps them" if guide else ""
    p.add_argument("--from", dest="start", metavar="TIME", help=f"leave out what comes before, such as 5s{raw}")
    p.add_argument("--to", dest="stop", metavar="TIME", help="leave out what comes after")
    p.add_argument("--device", metavar="ID", help="the unit, where the recording does not name it")
    common.add_calibration(p, "card so far: used for other triads, and kept")
    p.add_argument("--out", type=Path, metavar="JSON", help="card to write; that of --calibration is completed")
    p.add_argument("--html", type=Path, metavar="FILE", help="also write a page with figures that opens offline")
    common.add_force(p)
    common.add_json(p)
    p.set_defaults(told={}, live=False, guided=guide)
    if guide:
        live.add_options(p)


def opened(
    args: argparse.Namespace,
    *triads: str,
    if_present: tuple[str, ...] = (),
    inputs: tuple[Path | None, ...] = (),
) -> "Capture":
    """Capture that the options name, for the triads that are calibrated, some of them only where it has them.

    Without a triad it is the mounting that is found. What else is read is among `inputs`.
    """
    from plumbob.cards import CalibrationCard
    from plumbob.pipeline.calibration import capture_of

    out = None if room.completes(args) else args.out
    common.check_outputs(args, out, args.html, inputs=(args.file, args.profile, args.calibration, *inputs))
    base = None if args.calibration is None else CalibrationCard.load(args.calibration)
    if args.live:
        return live.live_capture(args, triads, base)
    if args.guided:
        live.require_recording(args)
    found = capture_of(
        args.file,
        triads=triads,
        if_present=if_present,
        profile=args.profile,
        span=_span(args),
        device=args.device,
        base=base,
    )
    common.note(*(f"{args.file.name}: {line}" for line in found.found))
    made = {*triads, *(name for name in if_present if name in found.imu.triads)} or {"mount"}
    room.require_room(args, found.device, made, base)
    if args.guided and args.guide:
        live.tell(args, found.imu)
    return found


def finish(
    args: argparse.Namespace, capture: "Capture", fits: "Mapping[str, Fitted]", *, mounted: "Mounted | None" = None
) -> int:
    """Print what was found, and write the card."""
    from plumbob import certificate
    from plumbob.pipeline.calibration import card_of

    card = card_of(capture, fits, mounted=mounted)
    if args.out is not None:
        card.save(args.out, overwrite=args.force or room.completes(args))
    if args.html is not None:
        title = f"Calibration of {card.device}"
        facts = {"recording": args.file.name if args.file else "live"}
        certificate.write_html(args.html, card, fits, title=title, facts=facts, overwrite=args.force)
    if args.json:
        written = {"out": args.out and str(args.out), "html": args.html and str(args.html)}
        common.print_json(_read(args) | written | certificate.as_dict(card, fits))
        return 0
    print(certificate.text(card, fits))
    print(f"card         {args.out}" if args.out else "card         NOT WRITTEN: name a file with --out")
    if args.html is not None:
        print(f"page         {args.html}")
    return 0


def refused(args: argparse.Namespace, why: "CaptureRefusedError") -> int:
    """Print the reasons, as text on standard error or as JSON; nothing is written."""
    import sys

    from plumbob import certificate
    from plumbob.plain import visible

    if args.json:
        common.print_json(_read(args) | {"out": None, "html": None} | certificate.refusal_as_dict(why))
    else:
        told = visible(certificate.refusal_text(why), keep="\n")
        print(f"plumbob calibrate {args.kind}: {told}", file=sys.stderr)
    return 1


def _read(args: argparse.Namespace) -> dict[str, Any]:
    """What was read, and what a guide told about it."""
    return {"file": args.file and str(args.file), **getattr(args, "told", {})}


def _span(args: argparse.Namespace) -> tuple[float, float] | None:
    from plumbob.units import Quantity, parse

    if args.start is None and args.stop is None:
        return None
    first = 0.0 if args.start is None else parse(args.start, Quantity.TIME)
    return first, float("inf") if args.stop is None else parse(args.stop, Quantity.TIME)
