"""What plumbob decode writes is a recording: info, run, allan, calibrate and convert read it without a further word."""

import numpy as np
import pytest
from pyarrow import parquet as pq

from benchmarks.harness.decoder_streams import frames_of, settled
from plumbob import read
from plumbob.core.errors import DecodeError
from plumbob.protocols.decode import decode, prefix_by_unit, triads_of
from plumbob.protocols.format_toml import device_names, find_format, rig_names
from tests.helpers.commandline import answer, ok, typed

SENSORS = [name for name in (*device_names(), *rig_names()) if any(map(prefix_by_unit, find_format(name).messages))]


@pytest.fixture(scope="module")
def buoy(tmp_path_factory):
    folder = tmp_path_factory.mktemp("buoy")
    ok("emulate", "buoy", "--seed", "1", "--duration", "12s", "--write", "sea.bin", cwd=folder)
    return folder


def bytes_of(form):
    """Thirty frames of each message."""
    return b"".join(frames_of(form, 30, np.random.default_rng(1)))


@pytest.mark.parametrize("name", SENSORS)
def test_every_format_with_sensors_is_read_back(name, tmp_path):
    form = settled(find_format(name))
    raw = bytes_of(form)
    (tmp_path / "raw.bin").write_bytes(raw)
    asked = {key: next(iter(o.choices), "1") for key, o in find_format(name).options.items() if o.default is None}
    options = [word for key, value in asked.items() for word in ("--option", f"{key}={value}")]
    for message, unit in ((m, u) for m in form.messages for u in prefix_by_unit(m)):
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
    typed(f"decode sea.bin --format buoy --out {file}", cwd=buoy)
    time = answer(f"info {file}", cwd=buoy)["sensors"]["time"]
    assert (time["samples"], time["rate_hz"]) == (1200, pytest.approx(100.0))
    assert answer(f"run {file} --filter mahony --frame NED", cwd=buoy)["samples"] == 1200
    typed(f"convert {file} from_{suffix}.parquet", cwd=buoy)
    imu = read(buoy / f"from_{suffix}.parquet").imu
    assert np.count_nonzero(np.isnan(imu.mag[:, 0])) == 300  # the magnetometer has 75 Hz: each fourth is absent
    for verb in ("allan", "calibrate gyro --method rest"):  # it was read, and judged: a buoy moves
        assert "still" in typed(verb, file, cwd=buoy, code=1).stderr


def test_the_unit_that_is_read_is_one_of_the_frame(tmp_path):
    raw, form = tmp_path / "raw.bin", settled(find_format("arm"))
    raw.write_bytes(bytes_of(form))
    typed("decode raw.bin --format arm --unit u2 --rate '50 Hz' --out a.csv", cwd=tmp_path)
    done = typed("decode raw.bin --format arm --rate '50 Hz' --out b.csv", cwd=tmp_path)
    assert "read as unit u1 of u1, u2, u3, u4, u5, u6" in done.stderr
    decoded = next(iter(decode(raw.read_bytes(), form)[0].values()))
    for name, unit in (("a", "u2"), ("b", "u1")):
        np.testing.assert_allclose(read(tmp_path / f"{name}.csv").imu.gyr, triads_of(decoded, unit)["gyr"], rtol=1e-11)


def test_a_table_that_was_changed_or_has_no_time_is_refused(buoy, tmp_path):
    typed(f"decode sea.bin --format buoy --out {tmp_path}/whole.parquet", cwd=buoy)
    table = pq.read_table(tmp_path / "whole.parquet")
    assert len(read(tmp_path / "whole.parquet").imu) == len(table)
    pq.write_table(table.drop_columns(["gyr.x [rad/s]"]), tmp_path / "less.parquet")
    flags = table.column_names.index("flags")
    pq.write_table(table.set_column(flags, "flags", [["gap+tired"] * len(table)]), tmp_path / "odd.parquet")
    (tmp_path / "raw.bin").write_bytes(bytes_of(settled(find_format("hmc5983"))))
    for suffix in ("csv", "parquet"):
        typed(f"decode raw.bin --format hmc5983 --out timeless.{suffix}", cwd=tmp_path)
    for name, why in (
        ("less.parquet", r"less\.parquet: it has no column gyr\.x \[rad/s\], which its own profile"),
        ("odd.parquet", "'tired' is not the name of a flag"),
        ("timeless.csv", r"1 open question: time\.rate"),
        ("timeless.parquet", r"1 open question: time\.rate"),
    ):
        with pytest.raises(DecodeError, match=why):
            read(tmp_path / name)
