"""Profiles: whatever is not declared, misspelt or without a unit is refused, with advice."""

import math
import re

import pytest

from plumbob import Frame, ImuMeta, North, files, json_schema
from plumbob.core.constants import G0
from plumbob.core.errors import DecodeError, FrameError, ParameterError, UnitError
from plumbob.files import Profile, load_profile, parse_profile
from plumbob.files.profile import TimeSource
from tests.helpers import beside
from tests.helpers.io_samples import ROOT, refused, schema_keys

MINIMAL = beside(__file__, "minimal.profile.toml")
FULL = beside(__file__, "full.profile.toml")


def test_a_minimal_profile_takes_only_declared_defaults():
    profile = parse_profile(MINIMAL)
    assert profile.layout.decimal == "."
    assert profile.layout.encoding == "utf-8"
    assert profile.layout.missing == ("", "NaN")
    assert profile.time == TimeSource(("t",), "s")
    assert set(profile.triads) == {"gyr"}
    assert profile.reference is None
    assert ImuMeta(**profile.meta) == ImuMeta()


def test_every_key_is_understood():
    profile = parse_profile(FULL)
    assert (profile.layout.marker, profile.layout.occurrence) == ("***End_of_Header***", 2)
    assert profile.triads["gyr"].unit_per_count == 1.0 / 16.4
    assert profile.triads["acc"].unit_per_count == 0.000488
    assert profile.triads["acc"].gravity
    meta = ImuMeta(**profile.meta)
    assert meta.gyr_range == pytest.approx(math.radians(2000.0), rel=1e-15)  # definition of the degree
    assert meta.acc_range == pytest.approx(16.0 * G0, rel=1e-15)  # definition of g
    assert (meta.frame, meta.north) == (Frame.NED, North.TRUE)
    assert meta.declination == pytest.approx(math.radians(-3.5), rel=1e-15)
    assert (meta.rate_nominal, meta.t0_ns, meta.unit_check) == (100.0, 5, False)
    assert profile.turn == "y -x z"
    assert len(profile.used) == 30


def test_three_ranges_are_of_the_columns_and_the_meta_has_them_by_body_axis():
    """The case's x is the sensor's y and its y the sensor's −x, so ranges change places; and in the body once more."""
    three = FULL.replace('range = "2000 dps"', 'range = ["1 rad/s", "2 rad/s", "3 rad/s"]')
    assert three != FULL
    assert ImuMeta(**parse_profile(three).meta).gyr_range == (1.0, 2.0, 3.0)
    once = three.replace('axes = "y -x z"\naxes_applied', 'axes = "x y z"\naxes_applied')
    assert ImuMeta(**parse_profile(once).meta).gyr_range == (2.0, 1.0, 3.0)


def test_every_key_is_documented_and_stands_in_the_full_profile():
    keys = schema_keys(json_schema("profile"))
    page = (ROOT / "docs" / "file-formats.md").read_text()
    assert {key for key in keys if not re.search(rf"[`\[.]{key}[`\] ]", page)} == set()
    # exclude others, and have tests of their own
    excluded = {"rate", "epoch", "format", "zone", "columns", "place", "date", "arrays", "delay", "words"}
    excluded |= {"mark", "checksum", "where", "week", "seconds", "thousands", "cells", "end", "plus", "channels"}
    excluded |= {f"{sensor}_left" for sensor in ("gyr", "acc", "mag")}
    assert keys - set(re.findall(r"\w+", FULL)) <= excluded


def test_a_place_tells_the_declination(tmp_path):
    """MATLAB's example of wrldmagm: −13.6891° at 1000 m over Natick on 2028-07-04."""
    pytest.importorskip("pygeomag", reason="the extra geomag is not installed")
    (tmp_path / "a.csv").write_text("t,x,y,z\n" + "".join(f"{i / 10},0.1,0.2,0.{i}\n" for i in range(1, 9)))
    place = 'place = "42.283,-71.35,1000"'
    for day in ('date = "2028-07-04"', "t0_ns = 1846281600000000000"):
        (tmp_path / "a.toml").write_text(MINIMAL.replace("[header]", f"{place}\n{day}\n[header]", 1))
        meta = files.read(tmp_path / "a.csv").imu.meta
        assert math.degrees(meta.declination) == pytest.approx(-13.6891, abs=0.0055)
    (tmp_path / "a.toml").write_text(MINIMAL.replace("[header]", f"{place}\n[header]", 1))
    refused(files.read, tmp_path / "a.csv", match="does not say when it was made", error=ParameterError)


REFERENCE = '[reference]\ncolumns = [4, 5, 6, 7]\norder = "wxyz"\nframe = "ENU"\nnorth = "true"\n'
WITH_REFERENCE = MINIMAL + REFERENCE
TURNED = 'axes = "x -y -z"\n' + WITH_REFERENCE
ANGLES = WITH_REFERENCE.replace("[4, 5, 6, 7]", "[4, 5, 6]").replace("wxyz", "yaw pitch roll")
TRACK = MINIMAL.partition("[gyr]")[0] + REFERENCE
ACC = MINIMAL + '[acc]\ncolumns = [4, 5, 6]\nunit = "g"\n'
THREE = 'unit = "dps"\nrange = ["1 rad/s", "2 rad/s", "3 rad/s"]'
UNIX = MINIMAL.replace('unit = "s"', 'unit = "s"\nepoch = "unix"')


def minimal(old, new):
    assert old in MINIMAL
    return MINIMAL.replace(old, new, 1)


def with_reference(old, new):
    assert old in REFERENCE
    return MINIMAL + REFERENCE.replace(old, new)


REFUSED = [
    (minimal("[header]", 'date = "2028-07-04"\n[header]'), "date is the day of a place, which is missing"),
    (minimal("[header]", 'place = "42,-71"\ndeclination = "1 deg"\n[header]'), "place already gives the declination"),
    # keys
    (minimal('separator = ","', 'seperator = ","'), "has no key .* known: format_version, separator, decimal"),
    (minimal("names = true", "name = true"), "has no key .* known: marker, occurrence, skip, names"),
    (minimal('separator = ","', ""), "needs the key 'separator'"),
    (ACC, "acc needs the key 'sign'"),
    (ACC + 'sign = "down"', "must be one of 'specific-force', 'gravity'"),
    # units
    *((minimal(f'unit = "{unit}"', ""), 'needs a unit.*Add unit = "', UnitError) for unit in ("s", "dps")),
    (minimal('"dps"', '"DPS"'), "'DPS' is not a unit of rate; if 'dps' was meant.*known: rad/s", UnitError),
    (minimal('unit = "s"', 'unit = "Hz"'), "is not a unit of time", UnitError),
    (minimal('"dps"', '"dps"\nrange = "2000"'), "has no unit", UnitError),
    (minimal('unit = "dps"', THREE.replace(', "3 rad/s"', "")), r"gyr\.range must be a list of 3 ranges, or one"),
    (minimal('unit = "dps"', THREE.replace('"3 rad/s"', "3")), r"gyr\.range\[3\] must be a number and its", UnitError),
    (minimal('","', '","\nrate_nominal = "100"'), "rate_nominal: '100' has no unit", UnitError),
    (minimal('","', '","\nrate_nominal = "fast Hz"'), "not a number with a unit", UnitError),
    # references
    (with_reference('frame = "ENU"', ""), "needs 'frame', because there is no default; known:", FrameError),
    (with_reference('north = "true"', ""), "reference needs 'north'", FrameError),
    (with_reference("ENU", "NEU"), "'NEU' is not a navigation frame", FrameError),
    (with_reference('"true"', '"grid"'), "'grid' is not a heading reference", FrameError),
    (with_reference('"wxyz"', '"yaw pitch roll"'), "needs 3 columns, but has 4"),
    (with_reference("[4, 5, 6, 7]", "[4, 5, 6]"), "needs 4 columns, but has 3"),
    (with_reference('order = "wxyz"', 'order = "wxyz"\nunit = "deg"'), "a quaternion has none"),
    (with_reference("7]", "7]\nunit = 1"), "must be text"),
    (with_reference("[4, 5, 6, 7]", '[4, 5, 6, "x"]'), "column 'x' is declared twice"),
    (ANGLES, "reference needs a unit", UnitError),
    (TURNED, "reference needs 'of'", FrameError),
    (TRACK + '[temperature]\ncolumn = 9\nunit = "degC"', "belong to a triad"),
    (TRACK + "[flags]\ncolumn = 9", "belong to a triad"),
    # values
    ('axes = "x y -z"\n' + MINIMAL, "axes: .*left-handed", FrameError),
    ("t0_ns = 1\n" + UNIX, "remove t0_ns"),
    (minimal('","', '"/"'), "separator must be one of"),
    (minimal('","', '","\ndecimal = ","'), "separator and decimal are both ','"),
    (minimal('","', '","\nencoding = "klingon"'), "not a text encoding"),
    (minimal('","', '","\nencoding = "hex"'), "not a text encoding"),
    (minimal('","', '","\nmissing = "NaN"'), "list of texts"),
    (minimal('","', '","\nrows = 0'), "whole number of at least 1"),
    (minimal('","', '","\nrows = true'), "whole number of at least 1"),
    (minimal('","', '","\nformat_version = 2'), "reads 1; update Plumbob"),
    (minimal('","', '","\nunit_check = 0'), "true or false"),
    (minimal('","', '","\nrate_nominal = "-5 Hz"'), "above 0"),
    (minimal("names = true", "names = false\nafter_names = 1"), "needs names = true"),
    (minimal("names = true", "names = true\noccurrence = 2"), "add header.marker"),
    (minimal('column = "t"\nunit = "s"', ""), "either column and unit .*or a declared rate"),
    (minimal('unit = "s"', 'unit = "s"\nrate = "100 Hz"'), "either column and unit .*or a declared rate"),
    (minimal('column = "t"\nunit', 'rate = "100 Hz"\nunit'), "so it can have nothing else; remove unit"),
    (minimal('unit = "s"', 'unit = "s"\nepoch = "gps"'), "must be one of 'unix'"),
    (minimal('["x", "y", "z"]', '["x", "y"]'), "a list of 3 columns"),
    *((minimal('["x", "y", "z"]', f'["x", "y", {third}]'), "number from 1") for third in ("0", '""', "true")),
    (minimal('["x", "y", "z"]', '["x", "y", "y"]'), "declared twice"),
    (minimal('"dps"', '"dps"\ncounts_per_unit = 0'), "other than 0"),
    *((minimal('"dps"', f'"dps"\ncounts_per_unit = {number}'), "finite number") for number in ("nan", "inf")),
    (minimal('"dps"', '"dps"\ncounts_per_unit = 2\nunit_per_count = 3'), "keep the one from the data sheet"),
    (minimal("[gyr]", "[gyr"), "not valid TOML"),
    (minimal("[header]\nnames = true", "header = 3"), "header must be a table"),
    (minimal('[gyr]\ncolumns = ["x", "y", "z"]\nunit = "dps"', ""), "it declares no data"),
    (minimal("[gyr]", '[temperature]\ncolumn = 9\nunit = "degC"\n[reference]'), "has no key|needs"),
    *((text, "TOML|no key") for text in ("[" * 5000, "a = " + "[" * 5000, "\x00", "a = 1\na = 2", "x" * 100_000)),
]


@pytest.mark.parametrize("case", REFUSED, ids=range(len(REFUSED)))
def test_what_is_not_declared_misspelt_or_nonsense_is_refused(case):
    text, match, error = (*case, DecodeError)[:3]
    refused(parse_profile, text, match=match, error=error)


def test_axes_time_and_separator_are_written_in_several_ways():
    assert parse_profile(TURNED + 'of = "case"').turn == "x -y -z"
    assert parse_profile("axes_applied = true\n" + TURNED).turn is None
    assert parse_profile(TRACK).triads == {}
    assert parse_profile(UNIX).time == TimeSource(("t",), "s", epoch="unix")
    assert parse_profile(MINIMAL.replace('column = "t"\nunit = "s"', 'rate = "0.5 Hz"')).time == TimeSource(rate=0.5)
    for word in ('"tab"', '"\\t"', "'\\t'"):
        assert parse_profile(MINIMAL.replace('","', word)).layout.separator == "\t"


def test_a_profile_file_is_named_in_its_errors(tmp_path):
    path = tmp_path / "logger.toml"
    path.write_text(MINIMAL.replace("dps", "rps"))
    refused(load_profile, path, match=r"logger\.toml: line 9: gyr\.unit", error=UnitError)
    path.write_bytes(b'separator = "\xff"')
    refused(load_profile, path, match=r"logger\.toml .*UTF-8")
    path.write_bytes(b"\xef\xbb\xbf" + MINIMAL.encode())
    assert isinstance(load_profile(path), Profile)
    refused(load_profile, tmp_path / "none.toml", match="does not exist")
