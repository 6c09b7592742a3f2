"""What verbs have in common: help, lists, pages, one line for what is wrong, strict JSON, and files that are kept."""

import json
import math
import os
import re
import shlex
import signal
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import plumbob
from plumbob import AttitudeTrack, Frame, ImuData, ImuMeta, North, Recording, convert, files, find_format
from plumbob.cli.main import build_parser, main
from plumbob.cli.verbs import VERBS
from plumbob.core.text import visible
from plumbob.data.cards import NoiseCard, TriadNoise
from plumbob.files.mcap import Recorder
from plumbob.filters import estimator_names, load
from plumbob.filters.known import bibliography, in_a_line
from plumbob.protocols.c_header import c_header
from tests.helpers import beside, commandline
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


REFUSED = Path(__file__).with_name("refusals.txt").read_text(encoding="utf-8")


@pytest.mark.parametrize(("words", "why"), table_of(REFUSED), ids=lambda cell: cell)
def test_what_a_verb_refuses_is_one_line_and_writes_nothing(samples, words, why):
    before = sorted(samples.rglob("*"))
    assert why in refused(*shlex.split(words.format(n="--rate 100Hz --scale '1 deg/s'")), cwd=samples)
    assert sorted(samples.rglob("*")) == before


STEER = "unit\x1b]0;owned\x07\x1b[2J\x9b31m\u202edoog\nverdict      whole"
SHOWN = "unit\\x1b]0;owned\\x07\\x1b[2J\\x9b31m\\u202edoog\\nverdict      whole"


def test_every_control_character_is_an_escape_and_a_title_does_not_end_the_comment_of_a_header():
    assert visible(STEER) == SHOWN
    controls = [chr(i) for i in range(0x20)] + [chr(i) for i in range(0x7F, 0xA0)]  # C0, DEL and C1 of Unicode
    assert all(visible(c).isascii() and visible(c).isprintable() for c in controls)
    assert visible("a\tb\nµ °", keep="\n\t") == "a\tb\nµ °"
    form = replace(find_format("fin"), title="fin */ int owned; /* \n#include <evil.h>")
    text = c_header(form)
    assert text.startswith("/* fin * / int owned; / * \\n#include <evil.h>\n")
    assert text.count("/*") == text.count("*/") == c_header(find_format("fin")).count("/*")


def test_info_and_files_for_other_programs_hold_no_command_for_a_terminal(tmp_path, capsys):
    t = np.arange(100) * 0.01
    imu = ImuData(t=t, gyr=np.random.default_rng(0).normal(size=(100, 3)), meta=ImuMeta(device=STEER))
    files.write(tmp_path / "a.parquet", Recording(imu=imu, name="a", notes=(STEER,)))
    assert main(["info", str(tmp_path / "a.parquet")]) == 0
    shown = capsys.readouterr()
    assert f"device       {SHOWN}, body axes" in shown.out
    assert "note         unit\\x1b]0;owned" in shown.out
    assert (shown.out + shown.err).replace("\n", "").isprintable()
    assert main(["info", str(tmp_path / "a.parquet"), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["sensors"]["device"] == STEER
    # Head of CSV, TUM and text: what somebody looks at with `cat`.
    track = AttitudeTrack(t=t, q_nb=np.tile([1.0, 0, 0, 0], (100, 1)), frame=Frame.ENU, north=North.FREE, source=STEER)
    whole = Recording(imu=imu, track=track, name=STEER, notes=(STEER,))
    for suffix in (".csv", ".tum", ".txt"):
        convert(whole, tmp_path / f"a{suffix}")
        text = (tmp_path / f"a{suffix}").read_text(encoding="utf-8")
        assert text.replace("\n", "").replace("\t", "").isprintable()
    assert files.read(tmp_path / "a.csv").imu.meta.device == STEER  # its profile has it as it was


def test_topics_cards_and_errors_are_shown_so_too(tmp_path, capsys, monkeypatch):
    """Wherever a verb prints: output and messages go through one door."""
    monkeypatch.chdir(tmp_path)
    recorder = Recorder(tmp_path / "a.mcap", epoch_offset_ns=0)
    number = recorder.channel(STEER, "json")
    with recorder:
        recorder.write(number, 1, b"{}")
    noise = TriadNoise([1e-4] * 3, [1e-5] * 3, [0.0] * 3)
    NoiseCard("unit\x1b[2J", "data\x1b[1m sheet", gyr=noise).save("card.json")
    assert [main(["verify", "a.mcap"]), main(["info", "card.json"])] == [0, 0]
    text = (tmp_path / "card.json").read_text().replace("format_version", "\\u001b[2J")
    (tmp_path / "card.json").write_text(text)
    assert main(["run", "x.parquet", "--noise", "card.json", "--filter", "mekf\x1b[2J"]) == 1
    shown = capsys.readouterr()
    assert f"rows         {SHOWN}: 1" in shown.out
    assert [("\\x1b[2J" in text, "\x1b" in text) for text in (shown.out, shown.err)] == [(True, False)] * 2


DOCS = Path(__file__).parents[2] / "docs"
TIME = (DOCS / "time.md").read_text(encoding="utf-8")


def test_a_page_is_printed_by_the_name_that_a_message_gives_and_else_all_are_listed():
    for name in ("time", "time.md", "docs/time.md", str(DOCS / "time.md")):
        assert commandline.ok("docs", name).stdout == plumbob.docs(name) == TIME
    assert plumbob.docs("allan") == plumbob.docs("noise")  # a verb leads to its page
    lines = commandline.ok("docs").stdout.splitlines()
    assert lines == plumbob.docs().splitlines()
    assert [line.split()[0] for line in lines] == sorted(page.stem for page in DOCS.glob("*.md"))


@pytest.mark.skipif(os.name != "posix", reason="the browser is a shell script")
def test_open_gives_the_page_to_the_browser(tmp_path):
    """The browser is a script that writes down what it was given."""
    browser = tmp_path / "browser"
    browser.write_text(f'#!/bin/sh\necho "$1" > {tmp_path}/seen\n')
    browser.chmod(0o755)
    for words, page in ((("time",), "time.md"), ((), "start.md")):
        done = commandline.start("docs", *words, "--open", BROWSER=str(browser))
        assert done.returncode == 0, done.stderr
        assert (tmp_path / "seen").read_text().strip() == (DOCS / page).as_uri()


@pytest.mark.skipif(sys.platform != "linux", reason="other systems open a browser in ways of their own")
def test_without_a_browser_the_error_says_where_the_page_is(tmp_path):
    done = commandline.start("docs", "time", "--open", BROWSER="", PATH=str(tmp_path), DISPLAY="", WAYLAND_DISPLAY="")
    assert done.returncode == 1
    assert done.stderr.strip() == f"plumbob docs: No browser could be opened. The page is {DOCS / 'time.md'}."


MAHONY = (
    "Mahony, Hamel, Pflimlin: Nonlinear Complementary Filters on the Special Orthogonal Group. "
    "IEEE Transactions on Automatic Control 53(5), 1203–1218, 2008, doi:10.1109/TAC.2008.923738"
)


def test_filters_have_lines_and_entries_for_their_references_each_once():
    printed = commandline.ok("list", "references", "mahony", "mekf").stdout
    assert plumbob.cite("mahony", "mekf") == printed
    lines = printed.splitlines()
    assert lines[1].partition("] ")[2] == MAHONY
    words = [line.split()[0].strip("[]") for line in lines]
    assert words == ["mahony", "Mahony2008", "Yu2018", "mekf", "Sola2017"]
    # mahony and tilt_compass share one of their sources
    assert plumbob.cite(bib=True) == commandline.ok("list", "references", "--bib").stdout
    entries = plumbob.cite("mahony", "tilt_compass", bib=True)
    assert re.findall(r"^@\w+\{(\w+),$", entries, re.MULTILINE) == ["Mahony2008", "Yu2018"]
    assert entries.count("{") == entries.count("}")
    names = [line for line in plumbob.cite().splitlines() if not line.startswith(" ")]
    assert tuple(names) == estimator_names()
    assert {key for name in names for key in load(name).REFERENCES} <= bibliography().keys()


WRITTEN = {
    "Kok2016": "Kok, Schön: Magnetometer",
    "DLMF": "National Institute of Standards and Technology: Digital Library",
    "Hasselmann1973": "Hasselmann et al.: Measurements",
    "Kasdin1995": "1/f^α Power Law",
    "Imhof1961": "Biometrika 48(3/4), 419–426, 1961",
}


def test_every_entry_becomes_a_line_as_people_write_it():
    for key, entry in bibliography().items():
        line = in_a_line(entry)
        assert re.match(rf"\[{key}\] \S.*", line) and WRITTEN.get(key, "") in line
        assert not set(line) & set("{}\\$\n"), line


@pytest.fixture(scope="module")
def listed():
    return answer("list filters")


def test_every_filter_says_what_it_claims_and_takes_and_its_parameters(listed):
    assert tuple(listed["filters"]) == estimator_names()
    for name, entry in listed["filters"].items():
        assert entry["covariance"] == hasattr(load(name), "COVARIANCE")
        assert entry["noise_card"] == hasattr(load(name), "from_noise")
        assert entry["summary"] and entry["references"]
    assert [listed["filters"][name]["covariance"] for name in ("ekf7", "mahony")] == [True, False]
    claims = sum(entry["covariance"] for entry in listed["filters"].values())
    assert typed("list filters").stdout.count("claims a covariance") == claims
    out = typed("list filters mekf").stdout
    assert all(f"    {name} " in out for name in load("mekf").Params._fields)
    assert [name for name in estimator_names() if f"{name}: " in out] == ["mekf"]
    described = answer("list filters mekf")
    assert (list(described["filters"]), len(described["filters"]["mekf"]["description"]) > 500) == (["mekf"], True)
    assert {row["name"] for row in described["every_filter"]} == {"declination", "max_gap", "mag"}


def test_a_parameter_has_unit_default_range_and_meaning(listed):
    """Ranges are those of the declarations: kp 0 to 100 1/s, declination ±180°, max_gap from 0 s on."""
    rows = [row for entry in listed["filters"].values() for row in entry["parameters"]] + listed["every_filter"]
    for row in rows:
        assert row["meaning"]
        if isinstance(row["default"], float):
            assert (row["low"] or -math.inf) <= row["default"] <= (row["high"] or math.inf), row["name"]
    shared = {row["name"]: row for row in listed["every_filter"]}
    mahony = {row["name"]: row for row in listed["filters"]["mahony"]["parameters"]} | shared
    for name, text, low, high in (
        ("kp", "0 to 100 1/s", 0.0, 100.0),
        ("gate", "0 to 1000 m/s2, or off", 0.0, 1000.0),
        ("quick_start", "on or off", None, None),
        ("declination", "-180 to 180 deg, or off", mahony["declination"]["low"], mahony["declination"]["high"]),
        ("max_gap", "0 s or more", 0.0, None),
    ):
        assert [mahony[name][key] for key in ("range_text", "low", "high")] == [text, low, high]
    assert [mahony["kp"][key] for key in ("unit", "default")] == ["1/s", 0.5]


def test_ctrl_c_while_a_class_is_made_ends_it_in_a_line(capsys):
    class Interrupting:
        def __set_name__(self, owner, name):  # what it raises is wrapped before Python 3.12
            os.kill(os.getpid(), signal.SIGINT)

    assert main(["demo"], lambda words: type("Made", (), {"of": Interrupting()})) == 130
    assert capsys.readouterr().err == "plumbob demo: ended by Ctrl-C.\n"
