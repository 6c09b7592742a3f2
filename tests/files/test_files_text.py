"""Text files in the dialects that LabVIEW and loggers write."""

import csv
import json
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from plumbob.core.constants import G0
from plumbob.core.errors import ClockError, DecodeError, ShapeError, UnitError
from plumbob.data.recording import Recording
from plumbob.files import parse_profile, read, text_table, write
from plumbob.files.columns import FORM
from plumbob.files.text import read_labels, read_spans, text_cell
from plumbob.rotations import Frame, North, body_axes, quat_angle, quat_from_euler_zyx, quat_rotate
from tests.helpers import beside, examples
from tests.helpers.io_samples import make_imu, refused

HEAD = 'separator = ","\n[header]\nnames = true\n'
TIME = '[time]\ncolumn = "t"\nunit = "s"\n'
GYR = '[gyr]\ncolumns = ["gx", "gy", "gz"]\nunit = "rad/s"\n'
ACC = '[acc]\ncolumns = ["gx", "gy", "gz"]\nunit = "g"\nsign = "specific-force"\n'
PLAIN = HEAD + TIME + GYR
ROWS = "t,gx,gy,gz\n0.00,1,2,3\n0.01,4,5,6\n0.02,7,8,9\n"


@pytest.fixture
def parse(tmp_path):
    def from_text(text, profile, encoding="utf-8"):
        path = tmp_path / "a.csv"
        path.write_bytes(text if isinstance(text, bytes) else text.encode(encoding))
        return read(path, profile=parse_profile(profile))

    return from_text


def refuse(*_, **__):
    """What Arrow does where it cannot read a table: it is then read line by line."""
    raise ValueError


LABVIEW = beside(__file__, "labview.txt")
LABVIEW_PROFILE = beside(__file__, "labview.profile.toml")


@pytest.mark.parametrize("line_end", ["\n", "\r\n", "\r"])
def test_labview_tab_decimal_comma_gbk_two_headers(parse, line_end):
    imu = parse(LABVIEW.replace("\n", line_end), LABVIEW_PROFILE, "gbk").imu
    expected = np.radians([[1.5, -2.5, 30.0], [np.nan] * 3, [4.5, 5.0, 6.0]])  # definition of the degree
    assert np.allclose(imu.gyr, expected, rtol=1e-15, equal_nan=True)
    assert imu.t.tolist() == [0.0, 0.01, 0.02]


@pytest.mark.parametrize(
    ("separator", "decimal"), [(",", "."), (";", "."), (";", ","), ("\t", "."), ("\t", ","), (" ", "."), (" ", ",")]
)
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "gbk", "latin-1", "utf-16", "cp1252"])
def test_separators_decimals_and_encodings(parse, separator, decimal, encoding):
    text = ROWS.replace(".", "\0").replace(",", separator).replace("\0", decimal)
    profile = PLAIN.replace('separator = ","', f"separator = {json.dumps(separator)}\ndecimal = '{decimal}'")
    profile = f"encoding = '{encoding.removesuffix('-sig')}'\n" + profile
    imu = parse(text, profile, encoding).imu
    assert imu.gyr.tolist() == [[1, 2, 3], [4, 5, 6], [7, 8, 9]]
    assert imu.t.tolist() == [0.0, 0.01, 0.02]


BY_NUMBER = (
    'separator = ","\n[header]\nnames = false\n[time]\ncolumn = 4\nunit = "ms"\n'
    '[gyr]\ncolumns = [3, 1, 2]\nunit = "rad/s"\n'
)
SKIPPED = 'comment = "#"\n' + PLAIN.replace("names = true", "names = true\nskip = 2")


@pytest.mark.parametrize(
    ("text", "profile"),
    [
        ("  t  gx gy\tgz \n   0.00   1  2     3\n 0.01 4   5 6  \n", PLAIN.replace('","', '" "')),  # runs of blanks
        ("made by\nlogger\n# a\n\nt,gx,gy,gz\n# b\n0.00,1,2,3\n\n#,,,\n0.01,4,5,6\n", SKIPPED),
        ('t,"note, long",gx,gy,gz\n"0.00","a, b",1,2,3\n0.01,plain,4,5,6\n', PLAIN),  # text that is not used
        ("t,gx,gy,gz\n0.00,1,2,3,\n0.01,4,5,6,\n", PLAIN),  # a separator at the end of rows only
        ("2,3,1,0\n5,6,4,10\n", BY_NUMBER),
    ],
)
def test_layouts(parse, text, profile):
    imu = parse(text, profile).imu
    assert np.allclose(imu.gyr, [[1, 2, 3], [4, 5, 6]], rtol=1e-15)
    assert imu.t.tolist() == [0.0, 0.01]


def test_a_row_without_a_time_stamp_is_left_out_and_named(parse):
    rows = [f"{'' if k == 7 else k / 100},{k},2,3\n" for k in range(50)]
    recording = parse("t,gx,gy,gz\n" + "".join(rows), PLAIN)
    assert recording.imu.gyr[:, 0].tolist() == [k for k in range(50) if k != 7]
    assert recording.imu.t.tolist() == [k / 100 for k in range(50) if k != 7]
    assert any("line 9: the time stamp is missing" in str(note) for note in recording.notes)


@pytest.mark.parametrize("form", ["s", "unix", "stamps"])
def test_rows_whose_burst_alone_has_a_stamp_are_all_read_and_rows_of_nothing_are_not(parse, form):
    def stamp(k):
        return {"s": f"{k / 100}", "unix": f"{1464877043 + k / 100:.2f}"}.get(form, f"10:00:{k / 100:05.2f}")

    rows = [f"{'' if k % 10 else stamp(k)},{k},2,3\n" + ",,,\n" * (k == 55) for k in range(100)]
    time = {"unix": 'unit = "s"\nepoch = "unix"', "stamps": f'format = "{FORM}"'}.get(form, 'unit = "s"')
    recording = parse("t,gx,gy,gz\n" + "".join(rows), PLAIN.replace('unit = "s"', time, 1))
    assert recording.imu.gyr[:, 0].tolist() == [*range(100)]
    assert recording.imu.t == pytest.approx(np.arange(100) / 100, abs=1e-9)
    assert any("90 of 100 rows have no stamp" in str(note) for note in recording.notes)


def test_a_marker_between_samples_is_none_and_a_sample_without_a_value_is(parse):
    rows = [f"{k / 100},{k},2,3\n" + "0.3012,,,\n" * (k == 30) for k in range(100)]
    rows[60] = "0.6,,,\n"
    recording = parse("t,gx,gy,gz\n" + "".join(rows), PLAIN)
    assert recording.imu.t.tolist() == [k / 100 for k in range(100)]
    assert np.flatnonzero(np.isnan(recording.imu.gyr[:, 0])).tolist() == [60]
    assert any("line 33: it has a time and no value" in str(note) for note in recording.notes)


@pytest.mark.parametrize("by_line", [False, True])
def test_unix_time_keeps_every_nanosecond(parse, monkeypatch, by_line):
    if by_line:
        monkeypatch.setattr("pyarrow.csv.read_csv", refuse)
    text = ROWS.replace("0.00", "1464877043.123456789").replace("0.01", "1464877043.133456791")
    text = text.replace("0.02", "1464877043.143456792")
    imu = parse(text, PLAIN.replace('unit = "s"', 'unit = "s"\nepoch = "unix"')).imu
    assert imu.meta.t0_ns == 1_464_877_043_123_456_789
    assert imu.t_ns.tolist() == [0, 10_000_002, 20_000_003]


@pytest.mark.parametrize(("unit", "digits"), [("s", 0), ("ms", 3), ("us", 6), ("ns", 9)])
def test_unix_time_in_any_unit(parse, unit, digits):
    stamps = [1_464_877_043 * 10**digits, 1_464_877_044 * 10**digits]
    text = "t,gx,gy,gz\n" + "".join(f"{stamp},1,2,3\n" for stamp in stamps)
    imu = parse(text, PLAIN.replace('unit = "s"', f'unit = "{unit}"\nepoch = "unix"')).imu
    assert imu.meta.t0_ns == 1_464_877_043_000_000_000
    assert imu.t_ns.tolist() == [0, 1_000_000_000]


def test_units_signs_axes_and_ranges(parse):
    half = GYR.replace('"rad/s"', '"dps"\ncounts_per_unit = 16.4')  # MPU-6050 data sheet, ±2000 °/s
    imu = parse(ROWS, HEAD + TIME + half).imu
    assert imu.gyr[0, 0] == pytest.approx(math.radians(1.0 / 16.4), rel=1e-14)
    worth = GYR.replace('"rad/s"', '"dps"\nunit_per_count = 0.0609756097560975')
    assert parse(ROWS, HEAD + TIME + worth).imu.gyr[0, 0] == pytest.approx(imu.gyr[0, 0], rel=1e-12)
    text = "t,gx,gy,gz\n0,0,0,-1\n1,0,0,-1\n"  # z up, at rest, a device that reports gravity
    recording = parse(text, HEAD + TIME + ACC.replace("specific-force", "gravity"))
    assert recording.imu.acc.tolist() == [[0.0, 0.0, G0], [0.0, 0.0, G0]]  # specific force points up
    assert any("acc was negated" in str(note) for note in recording.notes)
    # A missing component stays one
    imu = parse(ROWS.replace("1,2,3", "1,,3"), 'axes = "y -x z"\n' + PLAIN).imu
    assert np.isnan(imu.gyr[0]).tolist() == [True, False, False]
    assert imu.gyr[0, 1:].tolist() == [-1.0, 3.0]
    assert imu.gyr[1:].tolist() == (np.array([[4, 5, 6], [7, 8, 9.0]]) @ body_axes("y -x z").T).tolist()
    assert imu.meta.axes == "y -x z"
    profile = HEAD + TIME + GYR.replace('rad/s"', 'rad/s"\nrange = "9 rad/s"') + '[temperature]\ncolumn = 5\nunit = "K"'
    text = "t,gx,gy,gz,T\n0,1,2,3,273.15\n1,4,5,6,300\n2,7,8,9,--\n"
    imu = parse(text, 'missing = ["--"]\n' + profile).imu
    assert imu.temp_c == pytest.approx([0.0, 26.85, np.nan], nan_ok=True)  # ITS-90: 0 °C is 273.15 K
    assert imu.flags[2] & 1 << 3  # 9 of 9 rad/s is the end of the range
    text = "gx,gy,gz\n" + "1,2,3\n" * 8
    imu = parse(text, HEAD + '[time]\nrate = "300 Hz"\n' + GYR).imu
    assert imu.t_ns.tolist() == [round(k * 1_000_000_000 / 300) for k in range(8)]
    assert imu.meta.rate_nominal == 300.0
    acc = parse("t,gx,gy,gz\n" + LINES, "unit_check = false\n" + METRES).imu.acc
    assert acc.tolist() == [[0.0, 0.0, 1.0]] * 200


QUAT = "t,w,x,y,z\n0,0.5,0.5,-0.5,0.5\n1,1,0,0,0\n"
TRACK = '[reference]\ncolumns = ["w", "x", "y", "z"]\norder = "wxyz"\nframe = "NED"\nnorth = "true"\n'


def test_references_alone_as_angles_and_beside_samples(parse):
    last = "t,w,x,y,z\n0,0.5,-0.5,0.5,0.5\n1,0,0,0,1\n"
    for text, profile in ((QUAT, TRACK), (last, TRACK.replace("wxyz", "xyzw"))):
        recording = parse(text, HEAD + TIME + profile)
        assert recording.imu is None
        assert recording.track.q_nb.tolist() == [[0.5, 0.5, -0.5, 0.5], [1, 0, 0, 0]]
        assert (recording.track.frame, recording.track.north) == (Frame.NED, North.TRUE)
    text = "t,yaw,pitch,roll\n0,90,0,0\n1,10,20,30\n"
    profile = (
        '[reference]\ncolumns = [2, 3, 4]\norder = "yaw pitch roll"\nunit = "deg"\nframe = "ENU"\nnorth = "magnetic"\n'
    )
    track = parse(text, HEAD + TIME + profile).track
    assert track.q_nb[0] == pytest.approx([math.sqrt(0.5), 0, 0, math.sqrt(0.5)])  # a quarter turn about z
    assert quat_angle(track.q_nb[1], quat_from_euler_zyx(np.radians([10.0, 20.0, 30.0]))) < 1e-15
    text = "t,gx,gy,gz,w,x,y,z\n0,1,2,3,1,0,0,0\n1,4,5,6,nan,0,0,0\n"
    recording = parse(text, PLAIN + TRACK)
    assert recording.imu.t.tolist() == recording.track.t.tolist() == [0.0, 1.0]
    assert recording.track.known.tolist() == [True, False]
    names = [f"c{i}" for i in range(9)]
    text = "t,w,x,y,z,bx,by,bz," + ",".join(names) + "\n"
    text += "".join(f"{k},1,0,0,0,1,2,3,4,1,2,1,5,3,2,3,6\n" for k in range(2))
    profile = HEAD + TIME + TRACK + 'of = "case"\n[reference.bias]\ncolumns = ["bx", "by", "bz"]\nunit = "dps"\n'
    profile += f'[reference.covariance]\ncolumns = {names}\nangle_unit = "deg"\n'
    track = parse(text, 'axes = "y -x z"\n' + profile).track
    c_bs = body_axes("y -x z")
    assert np.allclose(track.bias_b[1], c_bs @ np.radians([1.0, 2.0, 3.0]))
    cov_s = np.array([[4.0, 1, 2], [1, 5, 3], [2, 3, 6]]) * math.radians(1.0) ** 2
    assert np.allclose(track.cov_b[1], c_bs @ cov_s @ c_bs.T, rtol=1e-14)


@pytest.mark.parametrize("of", ["case", "body"])
@pytest.mark.parametrize("axes", ["x -y -z", "y -x z", "z x y"])
def test_axes_turn_the_reference_of_the_case(parse, of, axes):
    """The same vector, measured in either set of axes, must have the same navigation coordinates."""
    track = parse(QUAT, f'axes = "{axes}"\n' + HEAD + TIME + TRACK + f'of = "{of}"').track
    v_s = np.array([1.0, 2.0, 3.0])
    v_b = body_axes(axes) @ v_s
    as_read = np.array([0.5, 0.5, -0.5, 0.5])
    expected = quat_rotate(as_read, v_s if of == "case" else v_b)
    assert np.allclose(quat_rotate(track.q_nb[0], v_b), expected, atol=1e-15)


LINES = "".join(f"{0.01 * k:.2f},0,0,1\n" for k in range(200))
DEGREES = [
    "t,gx,gy,gz\n" + "".join(f"{0.01 * k:.2f},{size * 20 * k},0,0\n" for k in range(50)) for size in (1.0, 100.0)
]
RANGED = HEAD + TIME + GYR.replace('rad/s"', 'rad/s"\nrange = "500 dps"')
METRES = HEAD + TIME + ACC.replace('"g"', '"m/s2"')
MARKED = PLAIN.replace("names", 'marker = "END"\nnames')
DELAYED = PLAIN + 'delay = "5 ms"\n'
CELLS = [
    ("0.01,4,abc,6", r"line 3, column 'gy': 'abc' is not a number"),
    ("0.01,4,1_0,6", r"'1_0' is not a number"),
    ("0.01,4,--,6", r"'--' is not a number.*add it to 'missing'"),
    ("0.01,4,１２,6", r"is not a number"),
    ('0.01,4,"5,5",6', r"'5,5' is not a number.*declare decimal = ','"),
    ("0.01,4,5\x00,6", r"'5\\x00' is not a number"),
    ("0.01,4,5", "line 3 has 3 cells, but most rows of numbers have 4"),
    ("0.01,4,5,6,7", "line 3 has 5 cells"),
    ('0.01,4,"5,6', "line 3: .* cannot be split"),
    ("0.01,4," + "5" * 200_000 + "x,6", "is not a number"),
]
REFUSED = [
    *((ROWS.replace("0.01,4,5,6", row), PLAIN, match) for row, match in CELLS),
    ("one\ntwo\n\n# three\nt,gx,gy,gz\n# six\n\n0,1,2,3\n1,4,x,6\n", SKIPPED, "line 9, column 'gy'"),
    ("", PLAIN, "is empty: it has 0 bytes"),
    ("t,gx\n", PLAIN, "ends before"),
    ("t,gx,gy,gz\n\n", PLAIN, "no row of numbers"),
    ("t,gx,gx,gz\n0,1,2,3\n", PLAIN, "'gx' is twice or more"),
    ("t,gx,gy,GZ\n0,1,2,3\n", PLAIN, "'gz' is nowhere"),
    (ROWS, PLAIN.replace('"t"', "5"), "column 5 is declared, but a row has 4 cells"),
    (ROWS, PLAIN.replace('"t"', "2"), "are the same column"),
    (ROWS, PLAIN.replace("true", "false"), "none, as header.names = false"),
    (ROWS, MARKED, "the marker 'END' comes 0 times"),
    ("END\n" + ROWS, MARKED.replace("names", "occurrence = 2\nnames"), "comes 1 times"),
    ("1," * 600_000, PLAIN, "line 1 has 1200000 characters"),  # one of 200 MB took 2 GB
    (f"t,gx,gy,gz\n0,1,2,3\n{'1,' * 600_000}\n", PLAIN, "line 3 has 1200000 characters"),
    (b"t,gx,gy,gz\n\xe9\n", PLAIN, r"byte 12 \(line 2\) is not utf-8"),
    *((text, RANGED, r"its range is .*500 °/s", UnitError) for text in DEGREES),
    ("t,gx,gy,gz\n" + LINES, METRES, "it looks like g", UnitError),
    (ROWS.replace("0.0", "1464877043.0"), PLAIN, "For unix time", ClockError),
    *((ROWS.replace("0.01", stamp), PLAIN, "line 3", ClockError) for stamp in ("-1", "inf")),
    *((ROWS.replace("0.01", stamp), DELAYED, "line 3", ClockError) for stamp in ("-1", "inf")),
    *((ROWS.replace("0.01", s).replace("0.02", s), PLAIN, "line 3 has no time", ClockError) for s in ("NaN", "")),
    ("t,gx,gy,gz\n0,,,\n1,NaN,NaN,NaN\n", PLAIN, "gyr", ShapeError),
    (QUAT.replace("0.5", "0.6"), HEAD + TIME + TRACK, "norm", ShapeError),
]


@pytest.mark.parametrize("case", REFUSED, ids=range(len(REFUSED)))
def test_what_does_not_fit_is_named_by_line_column_and_text(parse, case):
    text, profile, match, error = (*case, DecodeError)[:4]
    assert len(refused(parse, text, profile, match=match, error=error, name="a.csv")) < 500


@pytest.mark.parametrize("delay", [25, -25])
def test_a_delay_makes_up_no_value_in_a_gap_or_beyond_an_end(parse, delay):
    stamps = [*range(0, 100, 10), *range(200, 290, 10)]  # ms; the gap of 110 ms has more than 5 steps
    rows = "t,gx,gy,gz\n" + "".join(f"{0.001 * ms:.3f},{ms},{'' if ms % 20 else 2 * ms},1\n" for ms in stamps)
    recording = parse(rows, PLAIN.replace('"rad/s"', f'"mrad/s"\ndelay = "{delay} ms"'))
    imu = recording.imu
    there = np.array(stamps) + delay
    known = ((there >= 0) & (there <= 90)) | ((there >= 200) & (there <= 280))
    assert np.array_equal(np.isfinite(imu.gyr[:, 0]), known)
    assert imu.gyr[known, 0] == pytest.approx(1e-3 * there[known])  # the values are their own stamps
    slower = known & (np.array(stamps) % 20 == 0) & (there <= np.where(there < 100, 80, 280))
    assert np.array_equal(np.isfinite(imu.gyr[:, 1]), slower), "a slower axis keeps its rows"
    assert imu.gyr[slower, 1] == pytest.approx(2e-3 * there[slower])
    assert any("beyond an end are missing" in str(note) for note in recording.notes)


def test_a_last_line_without_end_is_a_line_unless_a_cell_or_a_digit_is_missing(parse):
    assert len(parse(ROWS[:-1], PLAIN).imu) == 3
    for cut in (ROWS[: ROWS.rindex(",")], "t,gx,gy,gz\n0.0,1.25,2.25,3.25\n0.1,1.25,2.25,3.75\n0.2,1.25,2.25,3.2"):
        recording = parse(cut, PLAIN)
        assert len(recording.imu) == 2
        assert "cut: line 4, the last, is cut and was left out: the file may be incomplete" in map(str, recording.notes)


def test_no_cut_gives_a_number_that_was_not_written(tmp_path):
    path = write(tmp_path / "a.csv", make_imu(rows=3, gyr=None, mag=None, temp_c=None))
    raw, whole = path.read_bytes(), read(path)
    first = raw.index(b"\n", raw.index(b"t [s]")) + 1
    declared = path.with_name("a.profile.toml").read_text().splitlines()
    profile = parse_profile("\n".join(line for line in declared if not line.startswith("rows")))
    for size in range(raw.index(b"\n", first) + 1, len(raw)):
        path.write_bytes(raw[:size])
        part = read(path, profile=profile)
        assert len(part.imu) == raw[first : size + 1].count(b"\n")  # the line end alone may be missing
        assert part.imu.acc.tobytes() == whole.imu.acc[: len(part.imu)].tobytes()
    for size in (len(raw) - 1, raw.rindex(b"\n", 0, -1) + 1):  # cut in the last line, and just before it
        path.write_bytes(raw[:size])
        refused(read, path, match="2 complete rows of numbers, but the profile says rows = 3")


@pytest.mark.parametrize("name", ["a.toml", "a.profile.toml"])
def test_a_profile_beside_the_file_is_taken_and_said(tmp_path, name):
    (tmp_path / "a.csv").write_text(ROWS)
    (tmp_path / name).write_text(PLAIN)
    assert f"read with the profile {name}, found beside the file" in map(str, read(tmp_path / "a.csv").notes)


def test_no_profile_and_two_are_refused(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text(ROWS)
    refused(read, path, match=r"--profile FILE\.toml.*'t,gx,gy,gz'.*plumbob profile .*a\.csv drafts one", name="a.csv")
    path.with_suffix(".toml").write_text(PLAIN)
    path.with_suffix(".profile.toml").write_text(PLAIN)
    refused(read, path, match="name one")
    assert "read with the profile a.toml" in map(str, read(path, profile=tmp_path / "a.toml").notes)
    (tmp_path / "b.toml").write_text(PLAIN)
    refused(write, tmp_path / "b.csv", make_imu(), match="two profiles")
    assert not (tmp_path / "b.csv").exists()


@pytest.mark.parametrize("sign", ["=", "+", "-", "@", "\t=", "\r=", " =", "\n@"])
def test_no_cell_is_a_formula(tmp_path, sign):
    evil = f'{sign}HYPERLINK("http://x","y")'
    imu = make_imu()
    imu = replace(imu, meta=replace(imu.meta, device=evil))
    path = write(tmp_path / "a.csv", Recording(imu=imu, name=evil), notes=[evil, f"a,{evil}", f"b\n{evil}"])
    rows = list(csv.reader(path.read_text().splitlines()))
    cells = [cell for row in rows[: rows.index(next(r for r in rows if r[0] == "t [s]"))] for cell in row]
    assert len(cells) == 12  # two in each of six lines: a note cannot open a cell or a line of its own
    assert not [cell for cell in cells if cell.startswith(("=", "+", "-", "@", "\t", "\r"))]
    assert read(path).imu.meta.device == evil


@given(st.text(max_size=40))
@examples(0.8)
def test_a_text_cell_is_one_harmless_cell(text):
    rows = list(csv.reader([text_cell(text)]))
    assert len(rows) <= 1
    assert all(len(row) <= 1 and not row[0].startswith(("=", "+", "-", "@")) for row in rows if row)


@given(
    device=st.text(max_size=20),
    note=st.text(max_size=20),
    values=st.lists(st.floats(-99.0, 99.0), min_size=3, max_size=3),
)
@examples(0.3)
def test_any_text_and_number_survives_the_csv(tmp_path_factory, device, note, values):
    folder = tmp_path_factory.mktemp("csv")
    imu = make_imu(rows=1, gyr=np.array([values]), mag=None)
    imu = replace(imu, meta=replace(imu.meta, device=device, gyr_range=None))
    back = read(write(folder / "a.csv", imu, notes=[note]))
    assert back.imu.gyr.tobytes() == imu.gyr.tobytes()
    assert back.imu.meta.device == device.encode("utf-8", "replace").decode()


NUMBERS = st.floats(allow_nan=False, width=64).map(repr) | st.sampled_from(
    ["1e400", "-0", "+3", ".5", "5.", "1E5", "nan", "NaN", "inf", "-Infinity", " 7 ", "00012", "1e-400", "4.9e-324"]
)


@given(st.lists(st.tuples(NUMBERS, NUMBERS, NUMBERS), min_size=1, max_size=20))
@examples(0.5)
def test_every_number_is_the_same_by_line(cells):
    raw = ("a,b,c\n" + "".join(",".join(row) + "\n" for row in cells)).encode()
    layout = parse_profile(PLAIN).layout
    fast = text_table.read_table(raw, layout, ["a", "b", "c"]).columns
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("pyarrow.csv.read_csv", refuse)
        slow = text_table.read_table(raw, layout, ["a", "b", "c"]).columns
    for name in "abc":
        assert np.array_equal(fast[name], slow[name], equal_nan=True)
        assert np.array_equal(np.signbit(fast[name]), np.signbit(slow[name]))


@given(st.binary(max_size=300))
@examples(0.6)
def test_any_bytes_are_read_or_refused_with_one_of_our_errors(raw):
    for encoding in ("utf-8", "gbk", "utf-16", "latin-1"):
        layout = replace(parse_profile(PLAIN).layout, encoding=encoding, names=False)
        try:
            text_table.read_table(raw, layout, [1])
        except DecodeError as error:
            assert "\n" not in str(error)


LABELLED = parse_profile(
    'separator = ","\ncomment = "#"\n[header]\nnames = true\n[time]\nrate = "100 Hz"\n'
    '[gyr]\ncolumns = ["x", "y", "z"]\nunit = "rad/s"\n'
)
PARTS = 'part,x,y,z\nrest,0,0,0\n# a remark\n"turn, slow",1,0,0\n,2,0,0\nrest,3,0,0\ncut,4'


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text(PARTS)
    return path


def test_each_sample_has_the_label_of_its_row(file):
    labels = read_labels(file, "part", LABELLED)
    assert labels == ["rest", "turn, slow", "", "rest"]  # the comment is no row, the cut last line no sample
    assert len(labels) == len(read(file, profile=LABELLED).imu)
    assert read_labels(file, 1, LABELLED) == labels
    refused(read_labels, file, "section", LABELLED, match="'section' is nowhere in the row of names")


def test_spans(tmp_path):
    path = tmp_path / "parts.csv"
    path.write_text("part,from_s,to_s\nx_p,1,2.5\nx_a,3,4\n")
    assert read_spans(path) == {"x_p": (1.0, 2.5), "x_a": (3.0, 4.0)}
    for rows, words in (
        ("x_p,1\n", "line 2: to_s must be a number"),
        ("x_p,1,1\n", "line 2: numbers must be finite, and from_s before to_s"),
        ("x_p,nan,1\n", "line 2: numbers must be finite"),
        ("x_p,1,2\nx_p,3,4\n", "a part comes twice among x_p, x_p"),
    ):
        path.write_text("part,from_s,to_s\n" + rows)
        refused(read_spans, path, match=words)
    for text in ("", "a,b,c\n"):
        path.write_text(text)
        refused(read_spans, path, match="line 1: the columns must be part, from_s, to_s")


@pytest.mark.parametrize("end", ["", "\n"])
@pytest.mark.parametrize("sign", ["\n", "\r\n", "\r"])
def test_a_head_may_be_longer_than_a_block(end, sign):
    """Of 9 MB, before numbers, a line that cannot be read, and a last line with or without its end."""
    head = ("# " + 10_000 * "c" + "\n") * 900
    text = head + "t,a\n" + "".join(f"{k},{k * k}\n" for k in range(99)) + "x,y\n" + "99,9801" + end
    layout = replace(parse_profile(PLAIN).layout, comment="#")
    table = text_table.read_table(text.replace("\n", sign).encode(), layout, ["t", "a"])
    assert table.columns["a"].tolist() == [float(k * k) for k in range(100)]
    assert table.line_of(99) == 1002 and len(table.notes) == 1
