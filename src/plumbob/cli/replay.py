"""plumbob replay: send a recording through the line again, with its own session or another."""

import argparse
from pathlib import Path

from plumbob.cli import common

DIFFERENT = 3


def add_parser(verbs: common.Adder) -> None:
    """Declare the verb."""
    p = verbs.add_parser(
        "replay",
        help="process a recorded line again, with its own filter or another",
        description="Send the raw bytes of a recording through the same line again: with the session that it holds, or "
        "with another session, filter, calibration or noise. With --check, compare with the attitude that was "
        "estimated live, bit for bit; exit code 3 where they differ.",
        epilog=common.more("plumbob replay sea.mcap --filter vqf --out vqf.parquet", "recordings.md"),
    )
    p.add_argument("recording", type=Path, help="recording made by 'plumbob record' (.mcap)")
    p.add_argument("--session", type=Path, metavar="TOML", help="session to use instead of the recording's own")
    common.add_estimate(p)
    common.add_unit(p, "another unit of the same frames, as one of the six of the rig 'arm'")
    p.add_argument("--out", type=Path, metavar="FILE", help="where to write the track (.parquet, .csv or .tum)")
    common.add_force(p)
    p.add_argument("--speed", type=float, metavar="K", help="K times as fast as it was; without it, as fast as it goes")
    p.add_argument("--check", action="store_true", help="compare with the live attitude that the recording holds")
    common.add_send(p)
    common.add_json(p)
    p.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Do it."""
    from dataclasses import replace

    from plumbob.live.recorded import convert
    from plumbob.live.replay import replay

    inputs = (args.recording, args.session, args.calibration, args.noise)
    common.check_outputs(args, *common.with_profile(args.out), inputs=inputs)
    result = replay(
        args.recording,
        session=args.session,
        **common.estimate_args(args),
        unit=args.unit,
        speed=args.speed,
        check=args.check,
        send=args.send,
        keep="track" if args.out else "nothing",
        note=common.note,
    )
    if args.out:
        convert(replace(result.as_recording(), name=args.out.stem), args.out, overwrite=args.force)
    common.print_json(result.summary()) if args.json else print(result.text())
    if args.out and not args.json:
        print(f"written      {args.out}")
    return 0 if result.comparison is None or result.comparison.equal else DIFFERENT
