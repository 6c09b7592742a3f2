"""What loggers write that no two write alike: dates and clock times, counts around a middle, sensors mounted askew."""

import json
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest

from plumbob import ImuData, estimate
from plumbob.core.constants import G0
from plumbob.core.errors import ClockError, DecodeError, FrameError, UnitError
from plumbob.files import parse_profile, read
from plumbob.rotations import quat_angle, quat_conjugate, quat_from_euler_zyx, quat_rotate
from tests.helpers.hand_motion import FIELD_ENU, by_hand
from tests.helpers.io_samples import refused

HEAD = 'separator = ","\n[header]\nnames = true\n'
GYR = '[gyr]\ncolumns = ["gx", "gy", "gz"]\nunit = "rad/s"\n'
ISO = '[time]\ncolumn = "t"\nformat = "ISO 8601"\n'
NOON = 1_714_566_605  # date -u -d 2024-05-01T12:30:05Z +%s (GNU coreutils 9.1)


@pytest.fixture
def parse(tmp_path):
    def from_text(text, profile):
        path = tmp_path / "a.csv"
        path.write_text(text, encoding="utf-8")
        return read(path, profile=parse_profile(profile))

    return from_text


def rows(stamps, names="t"):
    return f"{names},gx,gy,gz\n" + "".join(f"{stamp},1,2,3\n" for stamp in stamps)


@pytest.mark.parametrize(
    ("first", "second"),
    [
        ("2024-05-01T12:30:05.120Z", "2024-05-01T12:30:05.130Z"),
        ("2024-05-01 12:30:05.120 UTC", "2024-05-01 12:30:05.13 UTC"),
        ("2024-05-01T20:30:05.120+08:00", "2024-05-01T20:30:05.130+0800"),
        ("2024-05-01t07:00:05.12-05:30", "2024-05-01t07:00:05.130000000-05:30"),
        ('"2024/5/1 12:30:05,120Z"', '"2024/5/1 12:30:05,130Z"'),
    ],
)
@pytest.mark.parametrize("fast", [True, False])
def test_dates_with_a_zone_start_the_recording_in_utc(parse, monkeypatch, first, second, fast):
    if not fast:  # Arrow refuses, so that the file is read line by line
        monkeypatch.setattr("pyarrow.csv.read_csv", lambda *_, **__: float(""))
    imu = parse(rows([first, second]), HEAD + ISO + GYR).imu
    assert imu.t.tolist() == [0.0, 0.01]
    assert imu.meta.t0_ns == NOON * 10**9 + 120_000_000
    assert imu.gyr.tolist() == [[1, 2, 3]] * 2


def test_midnight_and_leap_days_are_passed(parse):
    start = datetime(2024, 2, 28, 23, 59, 59, tzinfo=UTC)
    stamps = [(start + timedelta(hours=13 * i)).isoformat() for i in range(4)]
    assert parse(rows(stamps), HEAD + ISO + GYR).imu.t.tolist() == [13 * 3600.0 * i for i in range(4)]


def test_a_zone_is_declared_where_the_file_names_none(parse):
    text = rows(["2024-05-01T20:30:05", "2024-05-01T20:30:06"])
    recording = parse(text, HEAD + ISO + GYR)
    assert recording.imu.meta.t0_ns == 0
    assert any("start in UTC is not known" in str(note) for note in recording.notes)
    zoned = parse(text, HEAD + ISO + 'zone = "+08:00"\n' + GYR)
    assert zoned.imu.meta.t0_ns == NOON * 10**9
    assert not any("UTC" in str(note) for note in zoned.notes)
    both = ISO.replace('column = "t"', 'columns = ["d", "t"]')
    imu = parse(rows(["2024-05-01,12:30:05.1Z", "2024-05-01,12:30:05.3Z"], "d,t"), HEAD + both + GYR).imu
    assert (imu.t.tolist(), imu.meta.t0_ns) == ([0.0, 0.2], NOON * 10**9 + 100_000_000)
    imu = parse(rows(["9:30:05.1", "9:30:05.3"]), HEAD + ISO + GYR).imu
    assert (imu.t.tolist(), imu.meta.t0_ns) == ([0.0, 0.2], 0)


COMMENTED = 'comment = "#"\n' + HEAD + ISO + GYR
SECONDS = '[time]\ncolumn = "t"\nunit = "s"\n'
STAMPS = [
    ("May the 1st 12:30:06", "line 4: .* is not a time in the form of ISO 8601, as 2024-05-01"),
    ("2024-02-30T12:30:06Z", "line 4: .*names a day that does not exist"),
    ("2024-05-01T24:30:06Z", "line 4: .*names a time that does not exist"),
    ("2024-05-01T12:30:06", "line 4: .*zone"),
]
UNREADABLE = [  # the second after a comment, which counts as a line
    *((rows(["2024-05-01T12:30:05Z"]) + f"#\n{second},1,2,3\n", COMMENTED, match) for second, match in STAMPS),
    *((rows(["2024-05-01T12:30:05Z"]) + f"#\n{cell},1,2,3\n", COMMENTED, "line 4", ClockError) for cell in ("", "NaN")),
    (rows(["23:59:59", "00:00:01"]), HEAD + ISO + GYR, "no time stamp is later", ClockError),
    (rows(["2024-05-01T12:30:05Z"]), HEAD + SECONDS + GYR, r'declare \[time\] format = "ISO 8601"'),
    (rows(["2024-05-01T12:30:05Z"]), HEAD + ISO + 'zone = "+08:00"\n' + GYR, "names its zone itself"),
]


@pytest.mark.parametrize("case", UNREADABLE, ids=range(len(UNREADABLE)))
def test_a_time_that_cannot_be_read_is_named(parse, case):
    text, profile, match, error = (*case, DecodeError)[:4]
    refused(parse, text, profile, match=match, error=error, name="a.csv")


def test_counts_around_a_middle(parse):
    """Offset binary: 32768 is zero, and a scale below zero turns the sign."""
    text = "gx,gy,gz,ax,ay,az\n32768,32778,32758,32768,32768,36864\n32768,32768,32768,32768,32768,36864\n"
    profile = (
        HEAD + '[time]\nrate = "100 Hz"\n' + GYR.replace('"rad/s"', '"rad/s"\nunit_per_count = -0.01\nzero = 32768')
    )
    acc = '[acc]\ncolumns = ["ax", "ay", "az"]\nunit = "g"\ncounts_per_unit = 4096\nzero = [32768, 32768.0, 32768]\n'
    imu = parse(text, profile + acc + 'sign = "specific-force"\n').imu
    assert imu.gyr[0] == pytest.approx([0.0, -0.1, 0.1], rel=1e-15)
    assert imu.acc.tolist() == [[0.0, 0.0, G0]] * 2


MOUNTED = {
    "gyr": ("rad/s", "-y x z", "y -x z"),  # what the profile says, and the turn the other way round
    "acc": ("m/s2", "z x y", "y z x"),
    "mag": ("uT", "x y -z", "x y -z"),  # left-handed
}
"""Unit, axes of the sensor, and its inverse, worked out by hand: row i of the inverse is column i of the matrix."""


def picked(axes, vectors):
    place = ["xyz".index(word[-1]) for word in axes.split()]
    sign = [-1.0 if word.startswith("-") else 1.0 for word in axes.split()]
    return vectors[:, place] * sign


def test_each_sensor_has_its_own_axes_and_the_case_has_others(parse):
    rng = np.random.default_rng(5)
    q_ns = quat_from_euler_zyx(rng.uniform(-1.0, 1.0, (120, 3)))
    case = {"gyr": rng.normal(0.0, 0.1, (120, 3)), "acc": quat_rotate(quat_conjugate(q_ns), [0.0, 0.0, G0])}
    case["mag"] = quat_rotate(quat_conjugate(q_ns), [20.0, 0.0, -40.0])
    columns, profile = {}, 'axes = "x -y -z"\n' + HEAD + '[time]\nrate = "100 Hz"\n'
    for name, (unit, axes, inverse) in MOUNTED.items():
        names = [f"{name}{axis}" for axis in "xyz"]
        columns |= dict(zip(names, picked(inverse, case[name]).T, strict=True))
        profile += f'[{name}]\ncolumns = {json.dumps(names)}\nunit = "{unit}"\naxes = "{axes}"\n'
        profile += 'sign = "specific-force"\n' if name == "acc" else "mirrored = true\n" if name == "mag" else ""
    table = "\n".join(",".join(map(repr, row)) for row in np.stack(list(columns.values()), axis=1).tolist())
    recording = parse(f"{','.join(columns)}\n{table}\n", profile)
    for name, values in case.items():
        assert np.array_equal(getattr(recording.imu, name), picked("x -y -z", values)), name
    assert "mag: the case's x, y, z are its 'x y -z', as the profile says" in map(str, recording.notes)


AT_100 = HEAD + '[time]\nrate = "100 Hz"\n' + GYR
WRONG = [
    (HEAD + ISO + 'unit = "s"\n' + GYR, "has a format, so it can have no unit"),
    (HEAD + ISO + 'columns = ["d", "t"]\n' + GYR, "needs column, or columns"),
    (HEAD + SECONDS + 'zone = "UTC"\n' + GYR, "time.zone is for dates"),
    (HEAD + ISO + 'zone = "XYZ"\n' + GYR, "time.zone: 'XYZ' is not a time zone"),
    (HEAD + ISO.replace("ISO 8601", "%H") + GYR, "must be one of 'ISO 8601'"),
    ("t0_ns = 1\n" + HEAD + ISO + GYR, "remove t0_ns"),
    (AT_100 + "zero = 32768\n", r"gyr\.zero is in counts; add gyr\.counts_per_unit"),
    (AT_100 + 'counts_per_unit = 1\nzero = [1, "2", 3]\n', r"gyr\.zero\[2\] must be a finite number"),
    (AT_100 + 'axes = "x y -z"', r"gyr\.axes = 'x y -z' are left-handed; .* say gyr\.mirrored = true", FrameError),
    (AT_100 + 'axes = "y -x z"\nmirrored = true', r"are right-handed; remove gyr\.mirrored", FrameError),
    (AT_100 + "mirrored = true", r"'x y z' are right-handed", FrameError),
    (AT_100 + 'axes = "x y y"', r"gyr\.axes: .*must name x, y and z once each", FrameError),
    ('axes = "x y -z"\n' + AT_100, r"mirrored = true in its own table, as in \[mag\]", FrameError),
    ("axes_applied = true\n" + AT_100 + 'axes = "y -x z"\n', "remove the axes of the sensors"),
]


@pytest.mark.parametrize("case", WRONG, ids=range(len(WRONG)))
def test_nonsense_about_time_counts_and_axes_is_refused(case):
    text, match, error = (*case, DecodeError)[:3]
    refused(parse_profile, text, match=match, error=error)


@pytest.mark.parametrize(("hand", "own"), [(1.0, 'axes = "z -x y"\nmirrored = true'), (-1.0, 'axes = "-z x -y"')])
def test_a_device_that_is_left_handed_throughout(parse, hand, own):
    """The table of docs/own-csv.md: x right, y up, z ahead; forward-left-up is its z, −x, y, worked out by hand."""
    body = np.array([[0.1, 0.2, 0.3], [0.2, 0.1, -0.3]])  # forward, left, up
    device = np.stack([-body[:, 1], body[:, 2], body[:, 0]], axis=1)  # right, up, ahead
    columns = np.hstack([hand * device, device * G0])
    table = "".join(",".join(map(repr, row)) + "\n" for row in columns.tolist())
    acc = '[acc]\ncolumns = ["ax", "ay", "az"]\nunit = "m/s2"\nsign = "specific-force"\n'
    profile = HEAD + '[time]\nrate = "100 Hz"\n' + GYR + own + "\n" + acc + 'axes = "z -x y"\nmirrored = true\n'
    imu = parse("gx,gy,gz,ax,ay,az\n" + table, profile).imu
    assert imu.gyr.tolist() == body.tolist()
    assert imu.acc == pytest.approx(body * G0, rel=1e-15)


def test_a_field_relative_to_that_of_the_place_is_said_and_changes_no_attitude(parse):
    """Shares of the local field: 50 µT stand for 1, and the attitude is that of the field in µT."""
    h = by_hand(20.0, 50.0, rest=((0.0, 5.0),), seed=1)
    shares = 0.6 * h.mag / np.linalg.norm(FIELD_ENU)
    cells = np.column_stack((h.t, h.gyr, h.acc, shares)).tolist()
    text = "t,gx,gy,gz,ax,ay,az,mx,my,mz\n" + "".join(",".join(map(repr, row)) + "\n" for row in cells)
    acc = '[acc]\ncolumns = ["ax", "ay", "az"]\nunit = "m/s2"\nsign = "specific-force"\n'
    mag = '[mag]\ncolumns = ["mx", "my", "mz"]\nunit = "relative"\n'
    found = parse(text, HEAD + '[time]\ncolumn = "t"\nunit = "s"\n' + GYR + acc + mag)
    assert "mag is relative to the field of the place, which is taken to be 50 µT" in map(str, found.notes)
    np.testing.assert_allclose(found.imu.mag, 50.0 * shares, rtol=1e-12)
    plain, relative = (estimate(imu, frame="ENU").track for imu in (h.imu(), found.imu))
    assert np.degrees(quat_angle(plain.q_nb, relative.q_nb)).max() < 0.3
    hint = "if 1 is the field of the place, 'relative'"
    refused(ImuData, t=h.t, gyr=h.gyr, acc=h.acc, mag=shares, match=hint, error=UnitError)
