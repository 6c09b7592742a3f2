"""Drafted profiles: answered as they guess, they read what the logger meant; unanswered, they read nothing."""

import bz2
import gzip
import io
import json
import lzma
import tomllib
import zipfile
from datetime import datetime, timedelta

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import zstandard
from pyarrow import feather, orc

import plumbob
from plumbob.core.constants import G0
from plumbob.core.errors import ParameterError
from plumbob.core.files import profile_beside
from plumbob.files import arrow, parse_profile, read
from plumbob.files.profile import questions
from plumbob.rotations import quat_conjugate, quat_from_euler_zyx, quat_multiply, quat_rotate, rotvec_from_quat
from tests.helpers.io_samples import refused
from tests.helpers.real_data import DATA, needs

RATE = 50.0
T = np.arange(0.0, 16.0, 1.0 / RATE)
NOON = datetime(2024, 5, 1, 20, 30, 5)


@pytest.fixture(scope="module")
def moved():
    """Rates, °/s, specific force, g, and field, µT, of a unit that is turned by hand, with some noise."""
    rng = np.random.default_rng(3)
    q_nb = quat_from_euler_zyx(np.stack([0.5 * np.sin(0.7 * T), 0.4 * np.sin(0.9 * T), 0.6 * np.sin(0.5 * T + 1)], 1))
    rate = rotvec_from_quat(quat_multiply(quat_conjugate(q_nb[:-1]), q_nb[1:])) * RATE
    rate = np.degrees(np.vstack([rate, rate[-1]])) + rng.normal(0.0, 0.1, (T.size, 3))
    force = quat_rotate(quat_conjugate(q_nb), [0.0, 0.0, 1.0]) + rng.normal(0.0, 0.002, (T.size, 3))
    return rate, force, quat_rotate(quat_conjugate(q_nb), [0.0, 20.0, -43.0])


def table(path, head, columns, separator=",", form="{:.4f}", encoding="utf-8"):
    """Write a logger's file; columns of text stay as they are."""
    cells = [[v if isinstance(v, str) else form.format(v) for v in column] for column in columns]
    text = head + "".join(separator.join(row) + "\n" for row in zip(*cells, strict=True))
    path.write_bytes(text.encode(encoding))
    return path


def answered(text, **given):
    """Accept every guess; what has none is given, by its key."""
    given = {"frame": "ENU"} | given

    def answer(line):
        key, equals, value = line.partition(" = ")
        value, space, why = value.partition("  #")
        if value.strip() == '"?"':
            value = json.dumps(given[key])
        value = value.replace('["?", ', "[").replace('"? ', '"')
        number = key in {"counts_per_unit", "zero", "mirrored"} or (key == "column" and value.strip(' "').isdigit())
        return key + equals + (value.replace('"', "") if number else value) + space + why

    return "\n".join(map(answer, text.splitlines()))


def loggers(folder, moved):
    """Files of made-up loggers: name, file, answers that no file can tell, and whether it has a magnetometer."""
    rate, force, field = moved
    stamps = [NOON + timedelta(seconds=t) for t in T]
    comma = [[f"{v:.5f}".replace(".", ",") for v in c] for c in (T, *rate.T, *force.T)]
    counts = np.rint(np.hstack([force * 4096, rate * 16.4])) + 32768
    xyz = "xyz"
    return {
        "semicolons and decimal commas": (
            table(folder / "a.csv", "Zeit [s];" + ";".join([f"Gyro {a.upper()} [°/s]" for a in xyz] +
                  [f"Acc {a.upper()} [g]" for a in xyz]) + "\n", comma, ";"), {}),
        "tabs, milliseconds, lines before": (
            table(folder / "b.txt", "Logger 1.4\nSerial\t1234\n\ntime_ms\tgx\tgy\tgz\tax\tay\taz\ttemp\n",
                  [T * 1000, *rate.T, *(force * G0).T, np.full(T.size, 23.5)], "\t"), {}),
        "phyphox": (
            table(folder / "c.csv", ",".join(['"Time (s)"', *(f'"Acceleration {a} (m/s^2)"' for a in xyz),
                  *(f'"Gyroscope {a} (rad/s)"' for a in xyz)]) + "\n",
                  [T, *(force * G0).T, *np.radians(rate).T], form="{:.9E}"), {}),
        "names in a comment": (
            table(folder / "d.csv", "# my logger\n# t, ax, ay, az, gx, gy, gz\n#0, 0, 0, 1, 0, 0, 0\n",
                  [T, *force.T, *np.radians(rate).T], ", ", "{:.6f}"), {}),
        "no header": (table(folder / "e.csv", "", [T, *(force * G0).T, *rate.T, *field.T]), {}),
        "seconds since 1970, mg, mdps, mG": (
            table(folder / "f.csv", "timestamp,accel_x,accel_y,accel_z,gyro_x,gyro_y,gyro_z,mag_x,mag_y,mag_z\n",
                  [T + 1714566605.0, *(force * 1e3).T, *(rate * 1e3).T, *(field * 10).T]), {}),
        "counts": (
            table(folder / "g.csv", "sample,ax,ay,az,gx,gy,gz\n", [np.arange(T.size), *counts.T], form="{:.0f}"),
            {"rate": "50 Hz", "counts_per_unit": 16.4}),
        "date and clock": (
            table(folder / "h.csv", "Date,Time," + ",".join([f"Acc{a}_mg" for a in "XYZ"] +
                  [f"Gyr{a}_mdps" for a in "XYZ"]) + "\n",
                  [[s.strftime("%Y/%m/%d") for s in stamps], [s.strftime("%H:%M:%S.%f") for s in stamps],
                   *(force * 1e3).T, *(rate * 1e3).T]), {}),
        "a row of units without brackets": (
            table(folder / "k.csv", "Logger V2;fw 3.1\nts;gyro.x;gyro.y;gyro.z;accel.x;accel.y;accel.z\n" +
                  "ms;mdps;mdps;mdps;mg;mg;mg\n", [T * 1e3, *(rate * 1e3).T, *(force * 1e3).T], ";"), {}),
        "LabVIEW": (
            table(folder / "i.lvm", "LabVIEW Measurement\n***End_of_Header***\n" + "\t".join(["时间",
                  *(f"角速度{a}" for a in "XYZ"), *(f"加速度{a}" for a in "XYZ"), "备注"]) +
                  "\n[s]\t[°/s]\t[°/s]\t[°/s]\t[g]\t[g]\t[g]\n", comma, "\t", encoding="gbk"), {}),
        "runs of blanks, microseconds": (
            table(folder / "j.txt", "  t      gx gy gz   ax ay az\n",
                  [T * 1e6, *np.radians(rate).T, *force.T], "   ", "{:.5f}"), {}),
        "a stamp for each burst": (
            table(folder / "l.csv", "t_ms,gx,gy,gz,ax,ay,az\n",
                  [[f"{1e3 * t:.0f}" * (k % 8 == 0) for k, t in enumerate(T)], *rate.T, *force.T]), {}),
        "lines of a log, each of one number": (table(folder / "n.log", "", [[
            f"[20:30:{5 + t:09.6f}][D][sensor:094]: '{name} {axis}': now {row[k]:.5f} {unit}, 5 decimals"
            for t, turn, push in zip(T, rate, force, strict=True)
            for name, row, unit in (("Gyro", turn, "°/s"), ("Accel", push, "g")) for k, axis in enumerate("XYZ")]]),
            {}),
        "a log's words before plain numbers": (table(folder / "o.log", "", [
            [f"Dec 01 10:00:{t:09.6f} host imud[1234]: {k}" for k, t in enumerate(T)], *(force * G0).T, *rate.T]), {}),
        "no header, and a counter": (
            table(folder / "p.csv", "", [T, np.arange(700.0, 700.0 + 10 * T.size, 10), *(force * G0).T, *rate.T]), {}),
        "a rate below its name": (
            table(folder / "q.csv", "Sampling rate\n50\nframe,gx,gy,gz,ax,ay,az\n", [np.arange(T.size), *rate.T,
                   *force.T]), {}),
        "facts in as many lines as columns": (
            table(folder / "s.csv", "Start Time,8\nLast time,9\nFrequency,50 Hz\nX axis,up\nY axis,left\nZ axis,on\n"
                  "Time zone,0\n",
                  [T, *force.T, *rate.T]), {}),
        "a word before each row": (
            table(folder / "r.csv", "CLEARDATA\nT,GyX,GyY,GyZ,AcX,AcY,AcZ\n", [["Data"] * T.size, T, *rate.T,
                   *force.T]), {}),
        "a clock time for each burst": (
            table(folder / "m.csv", "Time,gx,gy,gz,ax,ay,az\n",
                  [[f"{s:%H:%M:%S.%f}" * (k % 8 == 0) for k, s in enumerate(stamps)], *rate.T, *force.T]), {}),
    }  # fmt: skip


@pytest.fixture(scope="module")
def files(tmp_path_factory, moved):
    return loggers(tmp_path_factory.mktemp("loggers"), moved)


NAMES = ("semicolons and decimal commas", "tabs, milliseconds, lines before", "phyphox", "names in a comment",
         "no header", "seconds since 1970, mg, mdps, mG", "counts", "date and clock", "LabVIEW",
         "runs of blanks, microseconds", "a row of units without brackets", "a stamp for each burst",
         "a clock time for each burst", "lines of a log, each of one number", "a log's words before plain numbers",
         "no header, and a counter", "a rate below its name", "a word before each row",
         "facts in as many lines as columns")  # fmt: skip


@pytest.mark.parametrize("name", NAMES)
def test_a_draft_whose_guesses_are_accepted_reads_what_the_logger_meant(files, moved, name):
    path, given = files[name]
    draft = plumbob.profile(path)
    refused(parse_profile, draft.text, match=r"open questions: .*frame, axes")
    assert [key for key, _ in draft.questions] == questions(tomllib.loads(draft.text))
    assert {"frame", "axes", "gyr.columns", "acc.columns", "acc.sign"} <= {key for key, _ in draft.questions}
    imu = read(path, profile=parse_profile(answered(draft.text, **given))).imu
    rate, force, field = moved
    half = {"counts": (0.5 / 16.4, 0.5 / 4096)}.get(name, (1e-3, 1e-4))  # rounded to a count, or to the digits written
    assert imu.t == pytest.approx(T, abs=1e-6)
    assert np.degrees(imu.gyr) == pytest.approx(rate, abs=half[0] * 1.001)
    assert imu.acc / G0 == pytest.approx(force, abs=half[1] * 1.001)
    assert imu.mag is None or imu.mag == pytest.approx(field, abs=1e-3)
    assert (imu.mag is not None) == (name in {"no header", "seconds since 1970, mg, mdps, mG"})


def zipped(raw):
    with zipfile.ZipFile(made := io.BytesIO(), "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("logs/a.csv", raw)
    return made.getvalue()


PACKED = {".gz": gzip.compress, ".bz2": lambda raw: bz2.compress(raw, 1), ".zip": zipped,
          ".xz": lambda raw: lzma.compress(raw, preset=0), ".zst": zstandard.ZstdCompressor().compress}  # fmt: skip


@pytest.mark.parametrize("suffix", PACKED)
def test_packed_it_is_the_same_and_damage_and_bombs_are_refused(files, tmp_path, suffix):
    plain, _ = files["semicolons and decimal commas"]
    path = tmp_path / f"a.csv{suffix}"
    path.write_bytes(PACKED[suffix](plain.read_bytes()))
    given = {"accept": True, "answers": {"acc.sign": "specific-force"}}
    draft = plumbob.profile(path, out=profile_beside(path), **given)
    assert draft.text.partition("\n")[2] == plumbob.profile(plain, **given).text.partition("\n")[2]
    np.testing.assert_array_equal(read(path).imu.gyr, read(plain, profile=parse_profile(draft.text)).imu.gyr)
    path.write_bytes(path.read_bytes()[: 2 * path.stat().st_size // 3])
    refused(read, path, match="it is cut or damaged")
    path.write_bytes(PACKED[suffix](bytes(80 << 20)))
    refused(read, path, match="are allowed: 64 MiB and 128 times the file")


@pytest.mark.parametrize("suffix", [".parquet", ".feather", ".orc"])
def test_tables_of_other_programs_are_read_by_a_profile_too(tmp_path, moved, suffix):
    rate, force, field = moved
    path, noon = tmp_path / f"a{suffix}", np.datetime64("2024-05-01T12:00", "ns")
    columns = {"time": noon + np.rint(1e9 * T).astype("timedelta64[ns]"), "gyro": list(np.radians(rate))}
    columns |= dict(zip(("acc_x", "acc_y", "acc_z"), G0 * force.T, strict=True))
    made = pa.table(columns | {"mag": list(field), "label": ["walk"] * T.size})
    {".parquet": pq.write_table, ".feather": feather.write_feather, ".orc": orc.write_table}[suffix](made, path)
    answers = {"acc.sign": "specific-force", "gyr.unit": "rad/s", "time.zone": "UTC"}
    plumbob.profile(path, accept=True, answers=answers, out=profile_beside(path))
    imu = plumbob.read(path).imu
    assert imu.meta.t0_ns == int(noon.astype(np.int64)) and arrow.text_bytes(path, 999) == arrow.text_bytes(path)[:999]
    np.testing.assert_allclose(imu.t, T, rtol=0, atol=1e-9)
    np.testing.assert_array_equal(imu.gyr, np.radians(rate))
    np.testing.assert_allclose([imu.acc, imu.mag], [G0 * force, field], rtol=1e-12)
    native = plumbob.write(tmp_path / "own.parquet", imu)
    refused(plumbob.read, native, profile=profile_beside(path), match="describes itself", error=ParameterError)


def whole_rates(fraction=0.0):
    rates = np.rint(300.0 * np.sin(np.outer(T, [1.0, 1.3, 0.7])))
    rates[::2] += fraction
    return rates


STATED = "t [s],gx [rad/s],gy [rad/s],gz [rad/s],ax [m/s2],ay [m/s2],az [m/s2]\n"
OTHERS = "time,lin_acc_x,lin_acc_y,lin_acc_z,acc_x,acc_y,acc_z,roll\n"
CONSTANT = np.tile([0.1, 0.2, 0.3, 0.0, 0.0, 9.8, 5.0], (10, 1))
GUESSED = [  # head, columns by rates and forces, what stands in the draft, and what does not
    # a unit is asked for again where the numbers contradict the one that is stated
    (STATED, lambda rate, force: [T, *rate.T, *force.T], ['unit = "? deg/s"', 'unit = "? g"', 'unit = "s"'], None),
    # of a gyroscope alone, of which nothing tells the unit: no logger turns at 300 rad/s
    ("t,gx,gy,gz\n", lambda *_: [T, *whole_rates().T], ['unit = "? deg/s"', 'counts_per_unit = "?"'], None),
    ("t,gx,gy,gz\n", lambda *_: [T, *whole_rates(0.5).T], ['unit = "? deg/s"'], 'counts_per_unit = "?"'),
    # without names: 2048 counts of a g are the fewest in use, of ±16 g in 16 bits; weaker ones are no gravity
    ("", lambda rate, force: [T, *(2048.0 * force).T, *rate.T], ['[acc]\ncolumns = ["?", 2, 3, 4]'], None),
    (OTHERS, lambda *_: [T[:10], *CONSTANT.T], ['columns = ["?", "acc_x", "acc_y", "acc_z"]',
     "# Not used: lin_acc_x, lin_acc_y, lin_acc_z, roll"], None),
]  # fmt: skip


@pytest.mark.parametrize(("head", "columns", "there", "absent"), GUESSED)
def test_what_is_guessed_of_odd_tables(tmp_path, moved, head, columns, there, absent):
    draft = plumbob.profile(table(tmp_path / "a.csv", head, columns(*moved[:2]))).text
    assert [text for text in there if text not in draft] == []
    assert absent is None or absent not in draft


@pytest.mark.parametrize(
    ("turn", "axes", "instead"),
    [
        (lambda a: a[:, [1, 0, 2]] * [1, -1, 1], "y -x z", "-y x z"),  # sits a quarter turn about z
        (lambda a: a * [1, 1, -1], "-x -y z", "x y -z"),  # left-handed
    ],
)
def test_sensors_that_do_not_turn_alike_are_asked_about(tmp_path, moved, turn, axes, instead):
    """Worked out by hand: case axes of the rates in the accelerometer's, and the accelerometer's own in the case's."""
    rate, force, _ = moved
    path = table(tmp_path / "a.csv", "t,ax,ay,az,gx,gy,gz\n", [T, *turn(force).T, *rate.T])
    draft = plumbob.profile(path)
    files = [table(tmp_path / f"{s}.csv", "t,x,y,z\n", [T, *v.T]) for s, v in (("acc", turn(force)), ("gyr", rate))]
    for text in (draft.text, plumbob.profile(files).text):  # in one table, and in a file for each
        assert [said for said in (f'? {axes}"', f'axes = "{instead}"', '"? deg/s"') if said not in text] == []
    kept = "\n".join(line for line in draft.text.splitlines() if not line.startswith(f'axes = "? {axes}"'))
    mounted = f'axes = "{instead}"\nmirrored = {str(instead == "x y -z").lower()}\n'
    imu = read(path, profile=parse_profile(answered(kept).replace("sign = ", mounted + "sign = "))).imu
    assert imu.acc / G0 == pytest.approx(force, abs=1e-4)


@pytest.mark.parametrize(
    ("text", "match"),
    [
        ("", "no separator makes a table"),
        ("a b c\n" * 20, "no separator makes a table"),
        ("1.5\n" * 20, "plumbob allan"),
        ("t,speed\n" + "".join(f"{i},{i}\n" for i in range(9)), "no three columns look like"),
        ("\0" * 5000, "no separator"),
        ("t,ax,ay,az\n" + "2024-02-30 10:00:00,0,0,1\n" * 9, r"a\.csv: .*a day that does not exist"),
        ('"' * 5000 + "\n", "no separator"),
    ],
)
def test_what_is_no_table_is_refused(tmp_path, text, match):
    (tmp_path / "a.csv").write_text(text)
    refused(plumbob.profile, tmp_path / "a.csv", match=match)


def test_names_stay_in_their_line_and_a_draft_is_written_once(tmp_path, files):
    """What a file says of itself stands in texts and comments of the draft, and in nothing else."""
    head = '"t\x1b[2J","gx\x85frame","gy\u2028x","gz\\",ax,ay,az,"=evil""]"\n'
    rows = np.tile([0.1, 0.2, 0.3, 0.0, 0.0, 9.8, 5.0], (10, 1))
    draft = plumbob.profile(table(tmp_path / "a.csv", head, [T[:10], *rows.T]))
    assert set(tomllib.loads(draft.text)) <= {"separator", "decimal", "frame", "axes", "header", "time", "acc", "gyr"}
    assert all(line.isprintable() for line in draft.text.split("\n"))
    path = tmp_path / "a.csv"
    path.write_bytes(files["phyphox"][0].read_bytes())
    out = tmp_path / "a.profile.toml"
    assert plumbob.profile(path, out=out).text == out.read_text(encoding="utf-8")
    refused(read, path, match=r"a\.profile\.toml: 6 open questions")
    refused(plumbob.profile, path, out=out, match="exists already; answer its questions", error=ParameterError)


@needs("phones", "ferraris")
@pytest.mark.parametrize(
    ("name", "found"),
    [
        ("phones/Jakob_Nexus5_NoDist_Texting/accelerometer.txt", ['"? 1"', '["?", 2, 3, 4]', '"? m/s2"']),
        ("ferraris/annotated_session.csv", ['"gyr_x", "gyr_y", "gyr_z"]', 'counts_per_unit = "? 2048"', 'rate = "?"']),
        ("ferraris/ferraris_example.csv", ['"acc_x", "acc_y", "acc_z"]', '"? m/s2"', 'rate = "?"']),
    ],
)
def test_real_loggers(name, found):
    """Units by the data's own description: m/s²; counts of 1/2048 g; m/s²."""
    draft = plumbob.profile(DATA / name)
    assert not [text for text in found if text not in draft.text]
