"""What all verbs have in common: help, one line for what is wrong, strict JSON, and files that are not replaced."""

import re
import shlex
from pathlib import Path

import pytest

from plumbob.cli.main import build_parser
from plumbob.cli.verbs import VERBS
from tests.helpers import beside
from tests.helpers.commandline import answer, ok, refused, table_of, typed

ROOT = Path(__file__).parents[2]
KINDS = {verb: [*table.kinds] for verb, table in VERBS.items() if table.kinds}
HELPED = [*VERBS, *(f"{verb} {kind}" for verb, kinds in KINDS.items() for kind in kinds)]


@pytest.mark.parametrize("verb", HELPED)
def test_help_has_an_example_that_the_parser_takes_and_a_page_that_is_there(verb):
    told = ok(*verb.split(), "--help").stdout
    assert re.match(rf"usage: plumbob {verb} .*?\n\n[A-Z]", told, re.DOTALL)  # a sentence, and then what it takes
    example, page = re.search(
        r"^example:\n  (.*?)\n\n.*^documentation:\n  (\S+)", told, re.DOTALL | re.MULTILINE
    ).groups()
    program, *words = shlex.split(example)
    assert (program, *words[: len(verb.split())]) == ("plumbob", *verb.split())
    build_parser(words[:1]).parse_args(words)
    assert (ROOT / page).is_file()
    assert set(re.findall(r"^    ([a-z]+)\b", told, re.MULTILINE)) >= set(KINDS.get(verb, []))


WRONG = table_of(beside(__file__, "wrong.txt"))


@pytest.mark.parametrize(("words", "why"), WRONG)
def test_wrong_usage_exits_2_and_asks_whether_another_word_was_meant(words, why, tmp_path):
    """Options are not abbreviated: a new one would change what an old script means."""
    assert why in typed(words, cwd=tmp_path, code=2).stderr
    assert not list(tmp_path.iterdir())


def test_without_a_verb_the_order_of_work_is_printed():
    """Its commands are those that the parser takes."""
    lines = ok().stdout.splitlines()
    commands = [line.partition("plumbob ")[2].split() for line in lines if line.startswith("  ")]
    assert [words[0] for words in commands] == ["sim", "record", "calibrate", "run", "eval"]
    for words in commands:
        assert build_parser(words[:1]).parse_args(words).verb == words[0]


REPORTS = beside(__file__, "reports.txt").splitlines()


@pytest.mark.parametrize("words", REPORTS)
def test_json_is_strict_and_is_not_the_text(samples, tmp_path, words):
    line = words.format(tmp_path)
    assert answer(line, cwd=samples)
    assert not typed(line, *["--force"] * ("--out" in line), cwd=samples).stdout.startswith("{")


OUTPUTS = table_of(beside(__file__, "outputs.txt"))


@pytest.mark.parametrize(("words", "suffix", "source"), OUTPUTS, ids=lambda cell: cell)
def test_an_output_replaces_no_file_unasked_and_never_an_input(samples, tmp_path, words, suffix, source):
    """By whatever name an input is reached: here it is a link to the same file."""
    there, same = tmp_path / f"there{suffix}", tmp_path / f"same{suffix}"
    there.write_text("before")
    assert "exists already" in refused(*shlex.split(words.format(there)), cwd=samples)
    assert there.read_text() == "before"
    if source:
        before = (samples / source).read_bytes()
        same.hardlink_to(samples / source)
        assert "is an input" in refused(*shlex.split(words.format(same)), "--force", cwd=samples)
        assert (samples / source).read_bytes() == before


READERS = beside(__file__, "readers.txt").splitlines()


@pytest.mark.parametrize("words", READERS)
def test_a_file_that_is_not_there_is_named_in_one_line(tmp_path, words):
    assert "none" in refused(*words.split(), cwd=tmp_path)
    assert not list(tmp_path.iterdir())
