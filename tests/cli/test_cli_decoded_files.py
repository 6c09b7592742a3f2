"""What plumbob decode writes is a recording: info, run, allan, calibrate and convert read it without a further word."""

import numpy as np
import pytest
from pyarrow import parquet as pq

from benchmarks.harness.decoder_streams import frames_of, settled
from plumbob import read
from plumbob.core.errors import DecodeError
from plumbob.protocols import catalog
from plumbob.protocols.decode import decode, prefixes_of, triads_of
from plumbob.protocols.find import find_format
from plumbob.protocols.rigs import names
from tests.helpers.commandline import call, ok, refused

SENSORS = [name for name in (*catalog.names(), *names()) if any(map(prefixes_of, find_format(name).messages))]


@pytest.fixture(scope="module")
def buoy(tmp_path_factory):
    folder = tmp_path_factory.mktemp("buoy")
    ok("emulate", "buoy", "--seed", "1", "--duration", "12s", "--write", "sea.bin", cwd=folder)
    return folder


@pytest.mark.parametrize("name", SENSORS)
def test_every_format_with_sensors_is_read_back(name, tmp_path):
    form = settled(find_format(name))
    raw = b"".join(frames_of(form, 30, np.random.default_rng(1)))
    (tmp_path / "raw.bin").write_bytes(raw)
    asked = {key: next(iter(o.choices), "1") for key, o in find_format(name).options.items() if o.default is None}
    options = [word for key, value in asked.items() for word in ("--option", f"{key}={value}")]
    for message, unit in ((m, u) for m in form.messages for u in prefixes_of(m)):
        want = triads_of(decode(raw, form)[0][message.name], unit)
        if not any(np.isfinite(values).any() for values in want.values()):
            continue
        for suffix, slack in (("csv", 1e-11), ("parquet", 0.0)):  # CSV has twelve digits
            out = tmp_path / f"a.{suffix}"
            words = ["--message", message.name, "--unit", unit, "--rate", "50 Hz", *options, "--force", "--out", out]
            ok("decode", tmp_path / "raw.bin", "--format", name, *words)
            imu = read(out).imu
            assert imu.meta.device == name
            assert imu.t == pytest.approx(np.arange(len(imu)) / 50.0, abs=1e-9)
            for triad, values in want.items():
                got = getattr(imu, triad)
                assert np.allclose(got, values, rtol=slack, atol=slack, equal_nan=True), (message.name, triad)


@pytest.mark.parametrize("suffix", ["csv", "txt", "parquet"])
def test_every_verb_reads_it(buoy, suffix):
    file = f"{suffix}.{suffix}"
    ok("decode", "sea.bin", "--format", "buoy", "--out", file, cwd=buoy)
    assert "1200 samples, 11.990 s, 100 Hz" in ok("info", file, cwd=buoy).stdout
    assert "1200 samples" in ok("run", file, "--filter", "mahony", "--frame", "NED", cwd=buoy).stdout
    ok("convert", file, f"from_{suffix}.parquet", cwd=buoy)
    imu = read(buoy / f"from_{suffix}.parquet").imu
    assert np.count_nonzero(np.isnan(imu.mag[:, 0])) == 300  # the magnetometer has 75 Hz: each fourth is absent
    for verb in (["allan", file], ["calibrate", "gyro", file, "--method", "rest"]):
        done = call(*verb, cwd=buoy)
        assert done.returncode == 1 and "still" in done.stderr  # it was read, and judged: a buoy moves


def test_a_table_without_a_time_asks_for_its_rate(tmp_path):
    form = settled(find_format("hmc5983"))
    (tmp_path / "raw.bin").write_bytes(b"".join(frames_of(form, 30, np.random.default_rng(1))))
    for suffix in ("csv", "parquet"):
        ok("decode", tmp_path / "raw.bin", "--format", "hmc5983", "--out", tmp_path / f"a.{suffix}")
        with pytest.raises(DecodeError, match=r"1 open question: time\.rate"):
            read(tmp_path / f"a.{suffix}")


def test_the_unit_that_is_read_is_one_of_the_frame(tmp_path):
    raw = tmp_path / "raw.bin"
    raw.write_bytes(b"".join(frames_of(settled(find_format("arm")), 30, np.random.default_rng(1))))
    done = ok("decode", raw, "--format", "arm", "--out", tmp_path / "a.csv")
    assert "read as unit u1 of u1, u2, u3, u4, u5, u6" in done.stderr
    line = refused("decode", raw, "--format", "arm", "--unit", "u7", "--out", tmp_path / "b.csv")
    assert "has no unit 'u7'; known are u1, u2" in line
    assert not (tmp_path / "b.csv").exists()


def test_a_changed_table_is_refused(buoy):
    ok("decode", "sea.bin", "--format", "buoy", "--out", "whole.parquet", cwd=buoy)
    table = pq.read_table(buoy / "whole.parquet")
    pq.write_table(table.drop_columns(["gyr.x [rad/s]"]), buoy / "less.parquet")
    with pytest.raises(DecodeError, match=r"less\.parquet: it has no column gyr\.x \[rad/s\], which its own profile"):
        read(buoy / "less.parquet")
    words = table.column_names.index("flags")
    pq.write_table(table.set_column(words, "flags", [["gap+tired"] * len(table)]), buoy / "odd.parquet")
    with pytest.raises(DecodeError, match="'tired' is not the name of a flag"):
        read(buoy / "odd.parquet")
