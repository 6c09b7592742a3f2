"""Profiles: whatever is not declared, misspelt or without a unit is refused, with advice."""

import math

import pytest

from plumbob import files
from plumbob.core.constants import G0
from plumbob.core.errors import DecodeError, FrameError, ParameterError, PlumbobError, UnitError
from plumbob.data import ImuMeta
from plumbob.files import Profile, load_profile, parse_profile
from plumbob.files.profile import TimeColumn, TimeRate
from plumbob.rotations import Frame, North

MINIMAL = """
separator = ","
[header]
names = true
[time]
column = "t"
unit = "s"
[gyr]
columns = ["x", "y", "z"]
unit = "dps"
"""
FULL = """
format_version = 1
separator = "\\t"
decimal = ","
encoding = "gbk"
comment = "%"
missing = ["", "--"]
rows = 100
device = "JY901"
axes = "y -x z"
axes_applied = false
frame = "ned"
north = "true"
declination = "-3.5 deg"
rate_nominal = "100 Hz"
t0_ns = 5
calibration = "card"
unit_check = false
notes = ["a", "b"]
[header]
marker = "***End_of_Header***"
occurrence = 2
skip = 1
names = true
after_names = 1
[time]
column = 1
unit = "ms"
[gyr]
columns = [2, 3, 4]
unit = "dps"
counts_per_unit = 16.4
zero = 32768
axes = "y -x z"
range = "2000 dps"
[acc]
columns = [5, 6, 7]
unit = "g"
unit_per_count = 0.000488
range = "±16 g"
sign = "gravity"
[mag]
columns = ["mx", "my", "mz"]
unit = "mGa"
axes = "x y -z"
mirrored = true
[temperature]
column = 11
unit = "K"
[flags]
column = "status"
[reference]
columns = [12, 13, 14]
order = "yaw pitch roll"
unit = "deg"
frame = "ENU"
north = "magnetic"
of = "case"
source = "turntable"
score = 15
flags = 16
mag_weight = 29
[reference.bias]
columns = [17, 18, 19]
unit = "deg/h"
[reference.covariance]
columns = [20, 21, 22, 23, 24, 25, 26, 27, 28]
angle_unit = "deg"
"""


def refused(text, match, error=DecodeError):
    with pytest.raises(error, match=match) as caught:
        parse_profile(text)
    assert "\n" not in str(caught.value)


def test_a_minimal_profile_takes_only_declared_defaults():
    profile = parse_profile(MINIMAL)
    assert profile.layout.decimal == "."
    assert profile.layout.encoding == "utf-8"
    assert profile.layout.missing == ("", "NaN")
    assert profile.time == TimeColumn("t", "s")
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
    refused(three.replace(', "3 rad/s"', ""), r"gyr\.range must be one range, or three in a list, but it has 2")
    refused(three.replace('"3 rad/s"', "3"), r"gyr\.range\[2\] must be a number and its unit", UnitError)


def test_every_key_of_the_full_profile_is_every_key_there_is():
    from plumbob.files import profile_toml

    tables = [
        profile_toml._PROFILE,
        profile_toml._HEADER,
        profile_toml._TIME,
        profile_toml._REFERENCE,
        profile_toml._COUNTS,
        profile_toml._MOUNT,
    ]
    words = FULL.replace("=", " ").replace("[", " ").replace("]", " ").replace(".", " ").split()
    missing = {key for table in tables for key in table} - set(words)
    # exclude t0_ns, the column, the declination and the layout, and have tests of their own
    assert missing == {"rate", "epoch", "format", "zone", "place", "date", "arrays", "delay"}


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
    with pytest.raises(ParameterError, match="does not say when it was made"):
        files.read(tmp_path / "a.csv")


@pytest.mark.parametrize(
    ("line", "told"),
    [
        ('date = "2028-07-04"', "date is the day of a place, which is missing"),
        ('place = "42,-71"\ndeclination = "1 deg"', "keep one of place and declination"),
    ],
)
def test_a_place_stands_alone(line, told):
    refused(MINIMAL.replace("[header]", f"{line}\n[header]", 1), told)


@pytest.mark.parametrize(
    ("old", "new", "known"),
    [
        ('separator = ","', 'seperator = ","', "format_version, separator, decimal"),
        ("names = true", "name = true", "marker, occurrence, skip, names"),
        ('column = "t"', 'colum = "t"', "column, unit, epoch, rate"),
        ('unit = "dps"', 'units = "dps"', "columns, unit, counts_per_unit, unit_per_count, zero, range"),
    ],
)
def test_an_unknown_key_lists_the_known(old, new, known):
    refused(MINIMAL.replace(old, new), f"has no key .* known are {known}")


@pytest.mark.parametrize(
    ("old", "match"),
    [('separator = ","', "separator"), ("[header]\nnames = true", "header"), ("names = true", "names")],
)
def test_a_missing_key_is_named(old, match):
    refused(MINIMAL.replace(old, ""), f"needs the key '{match}'")


@pytest.mark.parametrize("unit", ["s", "dps"])
def test_a_missing_unit_is_an_error_with_an_example(unit):
    refused(MINIMAL.replace(f'unit = "{unit}"', ""), 'needs a unit.*Add unit = "', UnitError)


@pytest.mark.parametrize(
    ("old", "new", "match"),
    [
        ('unit = "dps"', 'unit = "DPS"', "gyr.unit: 'DPS' is not a unit of rate; if 'dps' was meant.*known are rad/s"),
        ('unit = "dps"', 'unit = "g"', "is not a unit of rate"),
        ('unit = "s"', 'unit = "Hz"', "is not a unit of time"),
        ('unit = "dps"', 'unit = "dps"\nrange = "2000"', "has no unit"),
        ('unit = "dps"', 'unit = "dps"\nrange = "16 g"', "is not a unit of rate"),
        ('","', '","\nrate_nominal = "100"', "rate_nominal: '100' has no unit"),
        ('","', '","\nrate_nominal = "fast Hz"', "not a number with a unit"),
        ('","', '","\ndeclination = "3.5"', "has no unit"),
    ],
)
def test_a_wrong_unit_is_an_error(old, new, match):
    refused(MINIMAL.replace(old, new, 1), match, UnitError)


def test_the_sign_of_an_accelerometer_must_be_declared():
    acc = '[acc]\ncolumns = [4, 5, 6]\nunit = "g"\n'
    refused(MINIMAL + acc, "acc needs the key 'sign'")
    refused(MINIMAL + acc + 'sign = "down"', "must be one of 'specific-force', 'gravity'")


REFERENCE = '[reference]\ncolumns = [4, 5, 6, 7]\norder = "wxyz"\nframe = "ENU"\nnorth = "true"\n'


@pytest.mark.parametrize(
    ("old", "new", "match", "error"),
    [
        ('frame = "ENU"', "", "reference needs 'frame', because there is no default; known are ENU", FrameError),
        ('north = "true"', "", "reference needs 'north'", FrameError),
        ('order = "wxyz"', "", "needs the key 'order'", DecodeError),
        ("ENU", "NEU", "'NEU' is not a navigation frame", FrameError),
        ('"true"', '"grid"', "'grid' is not a heading reference", FrameError),
        ('"wxyz"', '"yaw pitch roll"', "needs 3 columns, but 4 came", DecodeError),
        ("[4, 5, 6, 7]", "[4, 5, 6]", "needs 4 columns, but 3 came", DecodeError),
        ('order = "wxyz"', 'order = "wxyz"\nunit = "deg"', "a quaternion has none", DecodeError),
        ("7]", "7]\nunit = 1", "must be a text", DecodeError),
        ("[4, 5, 6, 7]", "[4, 5, 6, 4]", "column '4' is declared twice", DecodeError),
        ("[4, 5, 6, 7]", '[4, 5, 6, "x"]', "column 'x' is declared twice", DecodeError),
    ],
)
def test_a_reference_leaves_nothing_open(old, new, match, error):
    refused(MINIMAL + REFERENCE.replace(old, new), match, error)


def test_angles_need_their_unit():
    angles = REFERENCE.replace("[4, 5, 6, 7]", "[4, 5, 6]").replace("wxyz", "yaw pitch roll")
    refused(MINIMAL + angles, "reference needs a unit", UnitError)


def test_turned_axes_ask_whose_attitude_the_reference_is():
    turned = 'axes = "x -y -z"\n' + MINIMAL + REFERENCE
    refused(turned, "reference needs 'of'", FrameError)
    assert parse_profile(turned + 'of = "case"').turn == "x -y -z"
    assert parse_profile("axes_applied = true\n" + turned).turn is None


@pytest.mark.parametrize(
    ("old", "new", "match"),
    [
        ('","', '"|"', "separator must be one of"),
        ('","', '","\ndecimal = ","', "separator and decimal are both ','"),
        ('","', '","\nencoding = "klingon"', "not a text encoding"),
        ('","', '","\nencoding = "hex"', "not a text encoding"),
        ('","', '","\nmissing = "NaN"', "list of texts"),
        ('","', '","\nrows = 0', "whole number of at least 1"),
        ('","', '","\nrows = true', "whole number of at least 1"),
        ('","', '","\nformat_version = 2', "reads 1; update Plumbob"),
        ('","', '","\nunit_check = 0', "true or false"),
        ('","', '","\nrate_nominal = "-5 Hz"', "above 0"),
        ("names = true", "names = 1", "true or false"),
        ("names = true", "names = false\nafter_names = 1", "needs names = true"),
        ("names = true", "names = true\noccurrence = 2", "add header.marker"),
        ('column = "t"\nunit = "s"', "", "either column and unit .*or a declared rate"),
        ('unit = "s"', 'unit = "s"\nrate = "100 Hz"', "either column and unit .*or a declared rate"),
        ('column = "t"\nunit = "s"', 'rate = "100 Hz"\nunit = "s"', "so it can have nothing else; remove unit"),
        ('unit = "s"', 'unit = "s"\nepoch = "gps"', "must be one of 'unix'"),
        ('["x", "y", "z"]', '["x", "y"]', "a list of 3 columns"),
        ('["x", "y", "z"]', '["x", "y", 0]', "number from 1"),
        ('["x", "y", "z"]', '["x", "y", ""]', "number from 1"),
        ('["x", "y", "z"]', '["x", "y", true]', "number from 1"),
        ('["x", "y", "z"]', '["x", "y", "y"]', "declared twice"),
        ('unit = "dps"', 'unit = "dps"\ncounts_per_unit = 0', "must not be 0"),
        ('unit = "dps"', 'unit = "dps"\ncounts_per_unit = nan', "finite number"),
        ('unit = "dps"', 'unit = "dps"\ncounts_per_unit = inf', "finite number"),
        ('unit = "dps"', 'unit = "dps"\ncounts_per_unit = 2\nunit_per_count = 3', "keep the one from the data sheet"),
        ("[gyr]", "[gyr", "not valid TOML"),
        ("[header]\nnames = true", "header = 3", "header must be a table"),
        ('[gyr]\ncolumns = ["x", "y", "z"]\nunit = "dps"', "", "it declares no data"),
        ("[gyr]", '[temperature]\ncolumn = 9\nunit = "degC"\n[reference]', "has no key|needs"),
    ],
)
def test_nonsense_is_refused(old, new, match):
    assert old in MINIMAL
    refused(MINIMAL.replace(old, new, 1), match)


def test_left_handed_axes_are_refused():
    refused('axes = "x y -z"\n' + MINIMAL, "axes: .*left-handed", FrameError)


def test_temperature_and_flags_need_a_triad():
    track = MINIMAL.partition("[gyr]")[0] + REFERENCE
    parse_profile(track)
    refused(track + '[temperature]\ncolumn = 9\nunit = "degC"', "belong to a triad")
    refused(track + "[flags]\ncolumn = 9", "belong to a triad")


def test_unix_time_excludes_a_declared_start():
    unix = MINIMAL.replace('unit = "s"', 'unit = "s"\nepoch = "unix"')
    assert parse_profile(unix).time == TimeColumn("t", "s", unix=True)
    refused("t0_ns = 1\n" + unix, "remove t0_ns")


@pytest.mark.parametrize("word", ['"tab"', '"\\t"', "'\\t'"])
def test_a_tab_may_be_written_in_three_ways(word):
    assert parse_profile(MINIMAL.replace('","', word)).layout.separator == "\t"


def test_a_rate_stands_for_time():
    assert parse_profile(MINIMAL.replace('column = "t"\nunit = "s"', 'rate = "0.5 Hz"')).time == TimeRate(0.5)


@pytest.mark.parametrize("text", ["[" * 5000, "a = " + "[" * 5000, "\x00", "a = 1\na = 2", "x" * 100_000])
def test_hostile_toml_is_refused(text):
    refused(text, "TOML|no key")


def test_a_profile_file_is_named_in_its_errors(tmp_path):
    path = tmp_path / "logger.toml"
    path.write_text(MINIMAL.replace("dps", "rps"))
    with pytest.raises(UnitError, match=r"logger\.toml: gyr\.unit"):
        load_profile(path)
    path.write_bytes(b'separator = "\xff"')
    with pytest.raises(DecodeError, match=r"logger\.toml: .*UTF-8"):
        load_profile(path)
    path.write_bytes(b"\xef\xbb\xbf" + MINIMAL.encode())
    assert isinstance(load_profile(path), Profile)
    with pytest.raises(PlumbobError, match="does not exist"):
        load_profile(tmp_path / "none.toml")
