"""Damage, noise and mutated bytes for the decoder of every format, and whether the project's targets are met.

Per fault at most one undamaged frame may be lost, and never more than two in a row; no wrong frame may be believed
where a cyclic check or parity guards, and elsewhere no more than the check's size explains; mutated bytes may raise
nothing and make nothing grow. Seeds are fixed. It exits 1 where a target is missed.

    python -m benchmarks.decoder_faults [--frames 20000] [--noise 100000000] [--fuzz 10000000] [--json]
"""

import argparse
import json
import sys

from benchmarks.harness.decoder_streams import user_frame
from benchmarks.harness.decoders import measure_decoders
from plumbob.protocols.format_toml import device_names, find_format


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--frames", type=int, default=20_000)
    parser.add_argument("--noise", type=int, default=100_000_000)
    parser.add_argument("--fuzz", type=int, default=10_000_000)
    parser.add_argument("--json", action="store_true")
    args = parser.parse_args()
    forms = [*map(find_format, device_names()), user_frame()]
    result = measure_decoders(forms, frames=args.frames, noise=args.noise, fuzzing=args.fuzz)
    print(json.dumps(result.summary(), indent=2) if args.json else result.text())
    if not args.json:
        print("targets met" if result.met else "targets MISSED")
    return 0 if result.met else 1


if __name__ == "__main__":
    sys.exit(main())
