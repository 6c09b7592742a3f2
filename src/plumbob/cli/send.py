"""plumbob send: the attitude of a file to another program."""

import argparse
import sys
from contextlib import ExitStack
from pathlib import Path

from plumbob.cli import common

TARGETS = "udp:HOST:PORT, udp-broadcast:HOST:PORT, tcp:HOST:PORT, tcp-listen:[HOST:]PORT, serial:DEV@BAUD, file:PATH, -"


def add_parser(verbs: common.Adder) -> None:
    """Declare the verb."""
    p = verbs.add_parser(
        "send",
        help="send the attitude of a file to another program, ship or aircraft",
        description="Send the attitude of a track or a recording as NMEA 0183, TSS1, MAVLink, JSON lines or ROS 2, as "
        "fast as it was recorded and with what is known of its quality. A line sends live with --send of record, view "
        "and replay.",
        epilog=common.more(
            "plumbob send track.parquet --as nmea --to udp:127.0.0.1:10110 --rate 10Hz --sentences HDT,PASHR", "send.md"
        ),
    )
    p.add_argument("source", type=Path, help="track, recording with an attitude, or recording of 'plumbob record'")
    forms = ("nmea", "tss1", "mavlink", "json", "ros2")
    p.add_argument("--as", dest="form", required=True, choices=forms, help="form of the messages")
    p.add_argument("--to", required=True, metavar="TARGET", help=TARGETS)
    p.add_argument("--rate", metavar="RATE", help="attitudes per second at most, as 10Hz; without it, all")
    p.add_argument(
        "--speed", default="1", metavar="K|max", help="K times as fast as it was (1); max: as fast as it goes"
    )
    p.add_argument("--sentences", default="", metavar="A,B", help="NMEA: of HDT, HDG, HDM, PASHR, XDR, ROT")
    p.add_argument("--body", metavar="FRD|FLU", help="body axes; without it FRD in NED, FLU in ENU and NWU")
    p.add_argument("--declination", metavar="ANGLE", help="as 3.2deg, east positive, where the source has none")
    common.add_force(p)
    common.add_json(p)
    p.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Do it."""
    from plumbob.door.send import send
    from plumbob.live.transports.transport import Stop

    stop = Stop()
    with ExitStack() as stack:
        stack.enter_context(common.stopped_by_signals(stop))
        result = send(
            args.source,
            args.form,
            args.to,
            rate=args.rate,
            speed=args.speed,
            sentences=[name for name in args.sentences.split(",") if name.strip()],
            body=args.body,
            declination=args.declination,
            overwrite=args.force,
            stop=stop,
            note=common.note,
        )
    if args.to == "-":  # standard output holds the messages, and nothing else
        print(result.text(), file=sys.stderr)
    elif args.json:
        common.print_json(result.summary())
    else:
        print(result.text())
    return 0
