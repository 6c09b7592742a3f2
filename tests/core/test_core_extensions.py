"""Names of other packages: what is taken or cannot be used is refused with its package, and harms no other."""

import json
from types import SimpleNamespace
from typing import Annotated, NamedTuple

import numpy as np
import pytest

import plumbob
from plumbob import filters
from plumbob.core.errors import DecodeError, ParameterError
from plumbob.core.params import Spec
from plumbob.core.units import Quantity
from plumbob.files import formats
from plumbob.filters import estimator_names
from plumbob.filters.layout import OWN, Q
from tests.helpers.commandline import ok, refused

BROKEN = (
    "[plumbob.filters]", *("absent=no", "mahony=no", "bare=bare", "left=gone", "Up=bare", "both=bare"),
    "[plumbob.files]", *("seven=no", "csv=bare", "dat=path"), "[plumbob.filter]", "misspelt=bare",
)  # fmt: skip
PATH = "accepts = lambda path: path.stem == 'log'\nread = lambda path: path\n"
PROCESS = {"PYTHONDONTWRITEBYTECODE": "1"}
"""With it a line has a process of its own, which finds what is installed in its folder."""


@pytest.fixture
def folder(tmp_path):
    """One in which a package with nothing but faults is installed."""
    (info := tmp_path / "faults-1.0.dist-info").mkdir()
    (other := tmp_path / "again-2.0.dist-info").mkdir()
    texts = {info / "METADATA": "Name: faults\nVersion: 1.0", info / "entry_points.txt": "\n".join(BROKEN)}
    texts |= {other / "METADATA": "Name: again\nVersion: 2.0", other / "entry_points.txt": "[plumbob.filters]\nboth=x"}
    modules = {tmp_path / "bare.py": "", tmp_path / "path.py": PATH, tmp_path / "gone.py": "raise SystemExit(5)"}
    for file, text in {**texts, **modules}.items():
        file.write_text(text)
    for name in ("log.csv", "log.dat", "other.dat"):
        (tmp_path / name).write_text("1,2\n")
    return tmp_path


@pytest.mark.parametrize(("line", "message"), [
    ("list filters absent", "filter 'absent' of faults 1.0 cannot be used (ModuleNotFoundError: No module named"),
    ("list filters bare", "filter 'bare' of faults 1.0 cannot be used (it must have SUMMARY,"),
    ("list filters both", "'both' of again 2.0 and of faults 1.0 cannot be used (both have this name; uninstall one"),
    ("list filters left", "'left' of faults 1.0 cannot be used (SystemExit: 5, gone.py:1)"),
    ("info log.seven", "file format 'seven' of faults 1.0 cannot be used"),
    ("info log.csv", "log.csv: a table does not say its frame and axes"),
    ("info log.dat", "log.dat: what read gives must be a Recording"),
    ("info other.dat", "other.dat: a table does not say its frame and axes"),
])  # fmt: skip
def test_what_cannot_be_used_is_refused_with_its_package(folder, line, message):
    assert message in refused(*line.split(), cwd=folder, **PROCESS)


def test_what_cannot_be_used_leaves_the_others(folder):
    printed = ok("list", "filters", "--json", cwd=folder, **PROCESS)
    assert tuple(json.loads(printed.stdout)["filters"]) == estimator_names()
    first, *others = printed.stderr.splitlines()
    assert "'plumbob.filter' of faults 1.0; the groups that are known are plumbob.filters," in first
    names = ["mahony", "Up", "absent", "bare", "both", "left"]
    assert [line.partition(" of ")[0] for line in others] == [f"note: the filter '{name}'" for name in names]


TAKEN = ("filter mahony", "filter smoother", "filter scalar", "file parquet", "format mpu6000", "format buoy")


@pytest.mark.parametrize("name", [*TAKEN, "file .x", "unit x"])
def test_a_name_that_is_taken_or_none_is_refused(name):
    names = plumbob.filter_names()
    with pytest.raises(ParameterError, match=r"exists already; choose|must have a-z|kind must be one of"):
        plumbob.register(*name.split(), "absent_one")
    assert plumbob.filter_names() == names


class Gain(NamedTuple):
    gain: Annotated[float, Spec(Quantity.RATIO, "part of the way", 0.0, 1.0)] = 0.5


class Wide(NamedTuple):
    gain: Annotated[float, Spec(Quantity.RATIO, "part of the way", 0.0, 1.0)] = 2.0


class Common(NamedTuple):
    mag: Annotated[float, Spec(Quantity.RATIO, "part of the way", 0.0, 1.0)] = 0.5


class Bare(NamedTuple):
    gain: float


def rests(c, x, *_):
    x[OWN] += 1.0
    return 0


def doubles(c, x, *_):
    rests(c, x)
    x[Q] = 2.0 if x[OWN] > 150.0 else 1.0
    return 0


def raises(c, x, *_):
    rests(c, x)
    if x[OWN] > 150.0:
        raise OverflowError("too far")
    return 0


def module(**changed):
    """A filter of another package, which stays at its start."""
    usual = {"SUMMARY": "rests", "REFERENCES": (), "NEEDS": ("gyr",), "STATE": 1, "Params": Gain, "step": rests}
    return SimpleNamespace(**{**usual, "coefficients": lambda params: (params[0],), **changed})


@pytest.fixture
def registered(monkeypatch):
    """Register a filter or a format of files, which other tests do not meet."""
    for table in filters.known.EXTENSIBLE, formats.EXTENSIBLE:
        for names in "_registered", "_made":
            monkeypatch.setattr(table, names, dict(getattr(table, names)))

    def add(kind, what):
        plumbob.register(kind, "late", what)
        return "late"

    return add


@pytest.mark.parametrize(("changed", "why"), [
    ({"step": lambda *_: None}, "step must return flags, an int, but it returned None"),
    ({"step": lambda c, x: 0}, r"TypeError: .*takes 2 positional arguments but 13 were given, \w+.py:\d+"),
    ({"coefficients": lambda params: 0.5}, "TypeError: object of type 'float' has no len"),
    ({"STATE": 0}, "IndexError: index .* is out of bounds"),
    ({"NEEDS": "gyr"}, "NEEDS must be a tuple of gyr, acc, mag, but it is 'gyr'"),
    ({"NEEDS": ("gyro",)}, r"NEEDS must be a tuple of gyr, acc, mag, but it is \('gyro',\)"),
    ({"Params": Wide}, "gain must be 0 to 1, but it is 2"),
    ({"Params": Common}, "every filter has the parameter mag; Params needs another name"),
    ({"Params": Bare}, "missing 1 required positional argument: 'gain'"),
    ({"step": lambda c, x, *_: x.__setitem__(Q, 2.0) or 0}, r"step must leave x\[Q\] a unit quaternion"),
])  # fmt: skip
def test_a_filter_that_cannot_take_one_sample_is_refused(registered, changed, why):
    name = registered("filter", module(**changed))
    with pytest.raises(ParameterError, match=f"^the filter '{name}' that was registered cannot be used \\(.*({why})"):
        plumbob.Filter(name, frame="ENU")


@pytest.mark.parametrize(("step", "why"), [
    (doubles, r"step must leave x\[Q\] a unit quaternion"),
    (raises, r"OverflowError: too far, test_core_extensions.py"),
])  # fmt: skip
def test_a_filter_that_fails_later_says_so_and_ends_no_recording(registered, step, why, tmp_path):
    name = registered("filter", module(step=step))
    sea = plumbob.simulate("buoy", frame="NED", duration=2.0, sensors="mpu6000", unit="calibrated", seed=1)
    with pytest.raises(ParameterError, match=f"^the filter '{name}' that was registered failed .*{why}"):
        plumbob.estimate(sea.imu, filter=name)
    filter_ = plumbob.Filter(name, frame="NED")
    with pytest.raises(ParameterError, match=f"'{name}' that was registered failed .*{why}"):
        for sample in sea.imu.samples():
            filter_.update(sample)
    ok("emulate", "buoy", "--seed", "1", "--duration", "3s", "--write", str(raw := tmp_path / "sea.bin"))
    kept, alone = (
        plumbob.record(capture=raw, format="buoy", out=tmp_path / f"{by}.mcap", filter=by, frame="NED")
        for by in (name, "integrate")
    )
    assert kept.failed and not alone.failed
    first, second = (plumbob.read(tmp_path / f"{by}.mcap").imu for by in (name, "integrate"))
    assert np.array_equal(first.gyr, second.gyr) and np.array_equal(first.t_ns, second.t_ns)


def test_a_format_of_files_that_fails_is_named(registered, tmp_path):
    sea = plumbob.simulate("static", frame="NED", duration=1.0, sensors="mpu6000", unit="calibrated", seed=1).imu
    both = {"read": lambda path: 1 / 0, "write": lambda path, recording: recording.imu.mag * 2}
    name = registered("file", SimpleNamespace(**both))
    with pytest.raises(
        DecodeError, match=f"'{name}' that was registered cannot write .*TypeError: unsupported operand"
    ):
        plumbob.write(tmp_path / f"a.{name}", sea)
    assert not [*tmp_path.iterdir()]
    (tmp_path / f"a.{name}").write_text("1")
    with pytest.raises(DecodeError, match=f"'{name}' that was registered cannot read .*ZeroDivisionError: division by"):
        plumbob.read(tmp_path / f"a.{name}")
    plumbob.register("file", name, SimpleNamespace(read=both["read"], write=lambda path, recording: None))
    with pytest.raises(DecodeError, match=r"cannot write .*wrote nothing"):
        plumbob.write(tmp_path / f"b.{name}", sea)


def test_a_track_names_the_package_of_its_filter(registered):
    name = registered("filter", module())
    assert (
        plumbob.Filter(name, frame="NED").describe()
        == f"{name}(gain=0.5, declination=off, max_gap=1 s, mag=on) that was registered"
    )
