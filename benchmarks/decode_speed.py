"""Frames per second of the decoder of every format, whole stream, one core, and whether the project's target is met.

Thread CPU time, the best of some rounds, for a stream of the format's first message that carries values. The target is
50 MB/s or a million frames per second. It exits 1 where it is missed.

    python -m benchmarks.decode_speed [--frames 1000000] [--rounds 5] [--only ahrs400,rion] [--json]
"""

import argparse
import json
import platform
import sys
import time
from collections.abc import Sequence

import numpy as np

from benchmarks.harness.decoder_streams import columns_for, settled, user_frame
from plumbob.protocols.decode import decode
from plumbob.protocols.encode import encode
from plumbob.protocols.format import Format
from plumbob.protocols.format_toml import device_names, find_format

FRAMES_PER_S, BYTES_PER_S = 1e6, 50e6


def forms_of(only: str) -> list[Format]:
    """Formats of a comma list; the whole catalogue and a user's own frame where it is empty."""
    names = [name.strip() for name in only.split(",") if name.strip()]
    return [settled(find_format(name)) for name in names or device_names()] + ([] if names else [user_frame()])


def measure(form: Format, frames: int, rounds: int) -> dict[str, object]:
    """Rates of one format."""
    message = next((m for m in form.messages if any(f.physical for f in m.fields)), form.messages[0])
    columns = columns_for(message, frames, np.random.default_rng(1))
    rows = encode(form, columns, message=message.name)
    data = (rows if len(rows) == frames else np.repeat(rows, frames, axis=0)).tobytes()
    decode(data[: 100 * message.length], form)
    spent = []
    for _ in range(rounds):
        start = time.thread_time()
        found, _ = decode(data, form)
        spent.append(time.thread_time() - start)
    if len(found[message.name]) != frames:
        raise RuntimeError(f"{form.name}: {len(found[message.name])} of {frames} frames found")
    rates = frames / min(spent), len(data) / min(spent)
    met = rates[0] >= FRAMES_PER_S or rates[1] >= BYTES_PER_S
    return {
        "name": form.name,
        "length": message.length,
        "columns": len(found[message.name].columns),
        "frames_per_s": rates[0],
        "bytes_per_s": rates[1],
        "met": met,
    }


def show(rows: Sequence[dict[str, object]]) -> None:
    print(f"{'':16}{'bytes':>6}{'columns':>9}{'Mframes/s':>11}{'MB/s':>8}")
    for row in rows:
        rates = f"{row['frames_per_s'] / 1e6:11.2f}{row['bytes_per_s'] / 1e6:8.0f}"
        print(f"{row['name']:16}{row['length']:6}{row['columns']:9}{rates}{'' if row['met'] else '  MISSED'}")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--frames", type=int, default=1_000_000)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--only", default="", metavar="A,B", help="these formats only")
    parser.add_argument("--json", action="store_true")
    args = parser.parse_args()
    rows = [measure(form, args.frames, args.rounds) for form in forms_of(args.only)]
    machine = f"{platform.machine()}, {platform.system()}, Python {platform.python_version()}"
    if args.json:
        print(json.dumps({"machine": machine, "frames": args.frames, "formats": rows}, indent=2))
    else:
        print(f"{machine}; {args.frames} frames each, best of {args.rounds}, thread CPU time")
        show(rows)
    return 0 if all(row["met"] for row in rows) else 1


if __name__ == "__main__":
    sys.exit(main())
