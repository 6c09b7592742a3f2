"""A paper's run in a process of its own: ``python -m plumbob.papers.alone NAME FOLDER SEED LANG``.

It says on standard error how far it is, a line for each step, and on standard output what it found, as JSON.
"""

import json
import sys
from pathlib import Path

from plumbob.core.errors import PlumbobError
from plumbob.papers.reproduce import STEP, run_paper


def main(name: str, folder: str, seed: str, lang: str) -> int:
    """Run the paper."""

    def told(what: str, done: int, of: int) -> None:
        sys.stderr.write(f"{STEP}\t{what}\t{done}\t{of}\n")
        sys.stderr.flush()

    try:
        found = run_paper(name, Path(folder), int(seed), lang, told)
    except PlumbobError as error:
        sys.stderr.write(f"{error}\n")
        return 1
    sys.stdout.write(json.dumps([one.stored() for one in found]))
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
