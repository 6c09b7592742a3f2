"""Names of other packages: what is taken or cannot be used is refused with its package, and harms no other."""

import json

import pytest

import plumbob
from plumbob.core.errors import ParameterError
from plumbob.filters import estimator_names
from tests.helpers.commandline import ok, refused

BROKEN = (
    "[plumbob.filters]", *("absent=no", "mahony=no", "bare=bare"), "[plumbob.files]",
    *("seven=no", "csv=bare", "dat=path"),
)  # fmt: skip
PATH = "accepts = lambda path: path.stem == 'log'\nread = lambda path: path\n"
PROCESS = {"PYTHONDONTWRITEBYTECODE": "1"}
"""With it a line has a process of its own, which finds what is installed in its folder."""


@pytest.fixture
def folder(tmp_path):
    """One in which a package with nothing but faults is installed."""
    (info := tmp_path / "faults-1.0.dist-info").mkdir()
    texts = {info / "METADATA": "Name: faults\nVersion: 1.0", info / "entry_points.txt": "\n".join(BROKEN)}
    for file, text in {**texts, tmp_path / "bare.py": "", tmp_path / "path.py": PATH}.items():
        file.write_text(text)
    for name in ("log.csv", "log.dat", "other.dat"):
        (tmp_path / name).write_text("1,2\n")
    return tmp_path


@pytest.mark.parametrize(("line", "message"), [
    ("list filters absent", "filter 'absent' of faults 1.0 cannot be used (ModuleNotFoundError: No module named"),
    ("list filters bare", "filter 'bare' of faults 1.0 cannot be used (ParameterError: it must have SUMMARY,"),
    ("info log.seven", "file 'seven' of faults 1.0 cannot be used"),
    ("info log.csv", "log.csv: a table does not say its units"),
    ("info log.dat", "log.dat: what read gives must be a Recording"),
    ("info other.dat", "other.dat: a table does not say its units"),
])  # fmt: skip
def test_what_cannot_be_used_is_refused_with_its_package(folder, line, message):
    assert message in refused(*line.split(), cwd=folder, **PROCESS)


def test_what_cannot_be_used_leaves_the_others(folder):
    printed = ok("list", "filters", "--json", cwd=folder, **PROCESS)
    assert tuple(json.loads(printed.stdout)["filters"]) == estimator_names()
    assert [line.partition("of faults")[0] for line in printed.stderr.splitlines()] == [
        "note: the filter 'mahony' ", "note: the filter 'absent' ", "note: the filter 'bare' "
    ]  # fmt: skip


TAKEN = ("filter mahony", "filter smoother", "filter scalar", "file parquet", "format mpu6000", "format buoy")


@pytest.mark.parametrize("name", [*TAKEN, "file .x", "unit x"])
def test_a_name_that_is_taken_or_none_is_refused(name):
    names = plumbob.filter_names()
    with pytest.raises(ParameterError, match=r"exists already; choose|must have a-z|kind must be one of"):
        plumbob.register(*name.split(), "absent_one")
    assert plumbob.filter_names() == names
