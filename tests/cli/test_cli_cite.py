"""plumbob list references as a user meets it."""

import re

import plumbob
from plumbob.filters import estimator_names, load
from plumbob.filters.known import bibliography, in_a_line
from tests.helpers import commandline

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
