"""A paper's run in a process of its own: ``python -m plumbob.papers.standalone NAME FOLDER SEED LANG``.

It says on standard error how far it is, a line for each step, and at the end what it found, as JSON in one line.
"""

import json
import sys
from pathlib import Path

from plumbob.core.errors import PlumbobError
from plumbob.papers.reproduce import FOUND, STEP, run_paper


def main(name: str, folder: str, seed: str, lang: str) -> int:
    """Run the paper."""

    def say(*words: object) -> None:
        sys.stderr.write("\t".join(map(str, words)) + "\n")
        sys.stderr.flush()

    try:
        outcomes = run_paper(name, Path(folder), int(seed), lang, lambda *step: say(STEP, *step))
    except (PlumbobError, OSError) as error:
        say(error)
        return 1
    say(FOUND, json.dumps([outcome.stored() for outcome in outcomes]))
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
