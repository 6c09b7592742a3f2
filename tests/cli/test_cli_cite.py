"""plumbob cite as a user meets it."""

import re

import pytest

import plumbob
from plumbob.filters import estimator_names, load
from plumbob.filters.known import bibliography, in_a_line
from tests.helpers import commandline

MAHONY = (
    "Mahony, Hamel, Pflimlin: Nonlinear Complementary Filters on the Special Orthogonal Group. "
    "IEEE Transactions on Automatic Control 53(5), 1203–1218, 2008, doi:10.1109/TAC.2008.923738"
)


def test_a_filter_has_a_line_for_each_reference():
    printed = commandline.ok("cite", "mahony", "mekf").stdout
    assert plumbob.cite("mahony", "mekf") == printed
    lines = printed.splitlines()
    assert lines[1].partition("] ")[2] == MAHONY
    words = [line.split()[0].strip("[]") for line in lines]
    assert words == ["mahony", "Mahony2008", "Yu2018", "mekf", "Sola2017"]


def test_bibtex_has_each_entry_once():
    """mahony and tilt_compass share one of their sources."""
    assert plumbob.cite(bib=True) == commandline.ok("cite", "--bib").stdout
    entries = plumbob.cite("mahony", "tilt_compass", bib=True)
    assert re.findall(r"^@\w+\{(\w+),$", entries, re.MULTILINE) == ["Mahony2008", "Yu2018"]
    assert entries.count("{") == entries.count("}")


def test_without_a_name_every_filter_is_cited():
    names = [line for line in plumbob.cite().splitlines() if not line.startswith(" ")]
    assert tuple(names) == estimator_names()
    assert {key for name in names for key in load(name).REFERENCES} <= bibliography().keys()


def test_every_entry_becomes_a_line_without_marks_of_latex():
    for key, entry in bibliography().items():
        line = in_a_line(entry)
        assert re.match(rf"\[{key}\] \S.*", line)
        assert not set(line) & set("{}\\$\n"), line


@pytest.mark.parametrize(
    ("key", "part"),
    [
        ("Kok2016", "Kok, Schön: Magnetometer"),
        ("DLMF", "National Institute of Standards and Technology: Digital Library"),
        ("Hasselmann1973", "Hasselmann et al.: Measurements"),
        ("Kasdin1995", "1/f^α Power Law"),
        ("Imhof1961", "Biometrika 48(3/4), 419–426, 1961"),
    ],
)
def test_names_and_signs_are_written_as_people_write_them(key, part):
    assert part in in_a_line(bibliography()[key])
