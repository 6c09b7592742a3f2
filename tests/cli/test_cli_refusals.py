"""What a verb refuses itself: exit code 1, one line that says why, and no file is written.

What a function of the package refuses is tested with that function.
"""

import shlex
from pathlib import Path

import pytest

from tests.helpers.commandline import refused, table_of

REFUSED = Path(__file__).with_name("refusals.txt").read_text(encoding="utf-8")


@pytest.mark.parametrize(("words", "why"), table_of(REFUSED), ids=lambda cell: cell)
def test_what_a_verb_refuses_is_one_line_and_writes_nothing(samples, words, why):
    before = sorted(samples.rglob("*"))
    assert why in refused(*shlex.split(words.format(n="--rate 100Hz --scale '1 deg/s'")), cwd=samples)
    assert sorted(samples.rglob("*")) == before
