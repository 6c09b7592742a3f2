"""Names of other packages: what is taken or cannot be used is refused with its package, and harms no other."""

import pytest

import plumbob
from plumbob.core.errors import ParameterError
from tests.helpers.commandline import ok, refused

BROKEN = """
[plumbob.filters]
absent = absent_one
mahony = absent_one
bare = bare
[plumbob.files]
seven = absent_one
csv = bare
"""
PROCESS = {"PYTHONDONTWRITEBYTECODE": "1"}
"""With it a line has a process of its own, which finds what is installed in its folder."""


@pytest.fixture
def folder(tmp_path):
    """One in which a package with nothing but faults is installed."""
    (tmp_path / "faults-1.0.dist-info").mkdir()
    (tmp_path / "faults-1.0.dist-info" / "METADATA").write_text("Name: faults\nVersion: 1.0\n")
    (tmp_path / "faults-1.0.dist-info" / "entry_points.txt").write_text(BROKEN)
    (tmp_path / "bare.py").touch()
    (tmp_path / "log.csv").write_text("1,2\n")
    return tmp_path


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("list filters absent", "filter 'absent' of faults 1.0 cannot be used (ModuleNotFoundError: No module named"),
        ("list filters bare", "filter 'bare' of faults 1.0 cannot be used (ParameterError: it must have SUMMARY,"),
        ("list filters absend", "there is no filter 'absend'; known are complementary,"),
        ("info log.seven", "file 'seven' of faults 1.0 cannot be used"),
        ("info log.csv", "log.csv: a text file does not say its units"),
    ],
)
def test_what_cannot_be_used_is_refused_with_its_package(folder, line, message):
    assert message in refused(*line.split(), cwd=folder, **PROCESS)


def test_what_cannot_be_used_leaves_the_others(folder):
    printed = ok("list", "filters", cwd=folder, **PROCESS)
    assert printed.stdout == ok("list", "filters").stdout
    assert [line.partition("of faults")[0] for line in printed.stderr.splitlines()] == [
        "note: filter 'mahony' ", "note: the filter 'absent' ", "note: the filter 'bare' "
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("kind", "name"),
    [
        ("filter", "mahony"), ("filter", "smoother"), ("filter", "scalar"), ("file", "parquet"), ("file", ".x"),
        ("format", "mpu6000"), ("format", "buoy"), ("unit", "x"),
    ],
)  # fmt: skip
def test_a_name_that_is_taken_or_none_is_refused(kind, name):
    with pytest.raises(ParameterError, match=r"exists already; choose|must have a-z|kind must be one of"):
        plumbob.register(kind, name, "absent_one")
