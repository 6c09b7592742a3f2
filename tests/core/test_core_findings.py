"""Findings: what their sentences are made of, and that every code of the package has one in each language."""

import ast
import json
import tomllib
from pathlib import Path

import pytest

import plumbob
from plumbob.core import findings
from plumbob.core.errors import DecodeError, ShapeError
from plumbob.files.profile import toml_value

PACKAGE = Path(plumbob.__file__).parent


@pytest.mark.parametrize(
    ("template", "values", "sentence"),
    [
        ("{count:count gap}", {"count": 1}, "1 gap"),
        ("{count:count axis/axes} of {n}", {"count": 2, "n": 3}, "2 axes of 3"),
        ("left out: {names}", {"names": ("a", "b")}, "left out: a, b"),
        ("stuck[[, the longest of {count}]]", {"count": 3}, "stuck, the longest of 3"),
        ("stuck[[, the longest of {count}]]", {"count": None}, "stuck"),
        ("stuck[[, the longest of {count}]]", {}, "stuck"),
        ("free[[sure?; surely]]", {"sure": "yes"}, "free; surely"),
        ("free[[sure?; surely]]", {"sure": ""}, "free"),
        ("time: [[{about}: ]]late", {"about": "gyr"}, "time: gyr: late"),
        ("time: [[{about}: ]]late", {}, "time: late"),
        ("late by {by:.2f} s", {"by": 0.125, "about": "mag"}, "mag: late by 0.12 s"),
        ("{text}", {"text": "as {somebody} wrote [[it]]"}, "as {somebody} wrote [[it]]"),
    ],
)
def test_a_template_is_filled_in(template, values, sentence):
    assert findings.render(template, values) == sentence


def test_it_goes_through_json_and_toml_and_is_said_once():
    gaps = findings.warning("samples.gaps", count=1, samples=10, longest=0.25)
    fitted = (
        findings.warning("reading.clock_fitted", repeated=3, stamps=9, alone=None, rate=99.5, moved_ms=0.4)
        .on("acc")
        .on("b")
    )
    written = findings.as_findings("notes", ["by  hand"])[0]
    for finding in (gaps, fitted, written):
        assert findings.Finding.from_dict(json.loads(json.dumps(finding.to_dict()))) == finding
        (back,) = tomllib.loads(f"notes = [{toml_value(finding)}]")["notes"]
        assert str(findings.note("notes[1]", back)) == str(finding)
    assert str(fitted).startswith("time: b: acc: 3 of 9 stamps repeat")
    impossible = findings.warning("samples.field", median=float("inf"), low=22.0, high=67.0)  # JSON has no infinity
    assert json.loads(json.dumps(impossible.to_dict(), allow_nan=False))["values"]["median"] is None
    assert tomllib.loads(f"note = {toml_value(impossible)}")["note"]["values"]["median"] == float("inf")
    assert str(written) == "by hand"
    assert findings.warnings([gaps, written, gaps]) == (gaps,)
    assert findings.lasting([gaps, written, fitted, written]) == (written, fitted)


def test_a_code_that_is_not_known_keeps_its_sentence_and_nonsense_is_refused():
    later = {"code": "x.new", "severity": "warning", "values": {"n": 2}, "text": "two of them"}
    assert str(findings.Finding.from_dict(later)) == "two of them"
    for wrong in ({}, {"code": 1}, {"code": "x", "severity": "bad"}, {"code": "x", "values": 3}):
        with pytest.raises(DecodeError, match="a finding needs code, severity and values"):
            findings.Finding.from_dict(wrong)
    for values in (
        {},
        {"count": 1, "samples": 1, "longest": "long"},
        {"count": 1, "samples": 1, "longest": {"a": [1]}},
    ):
        damaged = findings.Finding.from_dict({"code": "samples.gaps", "severity": "warning", "values": values})
        assert str(damaged).startswith("samples.gaps: {") and findings.warnings([damaged, damaged]) == (damaged,)
    with pytest.raises(DecodeError, match="must be text or a table"):
        findings.note("notes[1]", 5)
    for wrong in ("one text", [1], None):
        with pytest.raises(ShapeError, match="notes must be"):
            findings.as_findings("notes", wrong)


def codes_in_use():
    """Codes of `info` and `warning` in the package, with the names of their values; and other texts with a dot."""
    made, texts = {}, set()
    for file in PACKAGE.rglob("*.py"):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Constant) and isinstance(node.value, str):
                texts.add(node.value)
            if not (isinstance(node, ast.Call) and getattr(node.func, "id", "") in ("info", "warning") and node.args):
                continue
            if isinstance(node.args[0], ast.Constant):
                names = {keyword.arg for keyword in node.keywords}
                made.setdefault(node.args[0].value, []).append((file.name, names))
    return made, texts


def test_every_code_has_a_sentence_of_its_values_and_every_sentence_a_code():
    made, texts = codes_in_use()
    table = findings.words("en")
    assert sorted(set(made) - set(table)) == []
    for code, places in made.items():
        for file, names in places:
            assert findings.fields(table[code]) <= names | {"about"}, (code, file)
    unused = [
        code
        for code in table
        if code not in texts
        and not any(code.startswith(text) for text in texts if len(text) > 12 and text.endswith("_"))
    ]
    assert unused == []


@pytest.mark.parametrize("lang", ["zh"])
def test_other_languages_have_the_same_codes_and_values(lang):
    assert sorted(findings.words(lang)) == sorted(findings.words("en"))
    for code, template in findings.words(lang).items():
        assert findings.fields(template) == findings.fields(findings.words("en")[code]), code
