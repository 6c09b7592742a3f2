"""``python -m plumbob.core.kernels build`` makes the extension, ``… export mahony --out DIR`` the C of one filter."""

import argparse
import sys
from pathlib import Path

from plumbob.core.kernels.build import BuildError, build
from plumbob.core.kernels.sources import UnsupportedError


def main() -> None:
    """Do what is asked for."""
    parser = argparse.ArgumentParser(prog="python -m plumbob.core.kernels", description=__doc__)
    verbs = parser.add_subparsers(dest="verb", required=True)
    verbs.add_parser("build", help="make the extension beside the package")
    exporting = verbs.add_parser("export", help="write the C of one filter, with its state")
    exporting.add_argument("filter")
    exporting.add_argument("--out", type=Path, required=True, help="folder")
    exporting.add_argument("--frame", choices=("ENU", "NED"), default="ENU")
    args = parser.parse_args()
    if args.verb == "build":
        build()
        return
    from plumbob.core.kernels.emit import export

    sys.stdout.writelines(f"{file}\n" for file in export(args.filter, args.out, args.frame))


if __name__ == "__main__":
    try:
        main()
    except (BuildError, UnsupportedError, ValueError) as error:
        sys.exit(str(error))
