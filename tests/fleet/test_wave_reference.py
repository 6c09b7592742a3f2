"""Tables of other buoys, in the forms that their makers publish, beside sea states of a simulated buoy."""

import json
import math
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

import plumbob as pb
from plumbob.core.errors import DecodeError, ParameterError, UnitError

T0_NS = 1_790_000_000_000_000_000  # 2026-09-21 14:13:20 UTC
MIDDLE = T0_NS / 1e9 + 600.0
# The forms: names, units, order and signs for what is missing as in files of their makers or of tests of public readers
# (wavespectra's tests/sample_files/spotter_20210929.csv; the header of Sofar's parser of SD cards; Sofar's API; NDBC's
# realtime2 and its files of a year; gauteh/sfy's tests/events/02-omb-imu.json; trajan's reader of OpenMetBuoy;
# mcuttler/wavebuoy_tools). The numbers are those of `ROW`.
ROW = {"hm0_m": 1.3, "tp_s": 8.5, "mean": 6.25, "direction_deg": 350.0, "spread_deg": 30.0, "peak": 355.0}
FORMS = {
    "spotter.csv": (
        "Battery Voltage (V) ,Epoch Time ,Significant Wave Height (m) ,Peak Period (s) ,Mean Period (s) ,"
        "Peak Direction (deg) ,Mean Direction (deg) ,Mean Directional Spread (deg) ,f_0 \n"
        f"   4.07 ,{MIDDLE - 86400:.0f} ,  9.0 , 9.0 , 9.0 , 9.0 , 9.0 , 9.0 ,0.0293 \n"
        f"   4.07 ,{MIDDLE:.0f} ,  1.30 ,  8.500 , 6.250 ,  355.000 , 350.000 , 30.000 ,0.0293 \n",
        {"tm01_s": "mean", "peak_direction_deg": "peak", "direction_deg": "", "spread_deg": ""},
    ),
    "bulkparameters.csv": (
        "# year , month , day, hour ,min, sec, milisec , Significant Wave Height, Mean Period, Peak Period, "
        "Mean Direction, Peak Direction, Mean Spreading, Peak Spreading\n"
        "2026, 9, 21, 14, 23, 20, 0,   1.30,   6.25,   8.50, 350.00, 355.00,  30.00,  28.00 \n",
        {"tm01_s": "mean", "peak_direction_deg": "peak", "direction_deg": "", "spread_deg": ""},
    ),
    "api.json": (
        json.dumps({"data": {"spotterId": "SPOT-0001", "limit": 20, "waves": [
            {"significantWaveHeight": 1.3, "peakPeriod": 8.5, "meanPeriod": 6.25, "peakDirection": 355.0,
             "meanDirection": 350.0, "meanDirectionalSpread": 30.0, "timestamp": "2026-09-21T14:23:20.000Z"}]}}),
        {"tm01_s": "mean", "peak_direction_deg": "peak", "direction_deg": "", "spread_deg": ""},
    ),
    "44013.txt": (
        "#YY  MM DD hh mm WDIR WSPD GST  WVHT   DPD   APD MWD   PRES  ATMP\n"
        "#yr  mo dy hr mn degT m/s  m/s     m   sec   sec degT   hPa  degC\n"
        "2026 09 21 14 30  MM   MM   MM    MM    MM    MM  MM     MM  16.8\n"
        "2026 09 21 14 20 350  6.0  8.0   1.3   8.5  6.25 355 1013.3  25.3\n"
        "2026 09 21 14 10 35",  # cut in mid-line
        {"tm02_s": "mean", "peak_direction_deg": "peak"},
    ),
    "imu.json": (
        json.dumps({"device": "OMB", "datetime": 1742754139000.0, "body": {"messages": [
            {"datetime_fix": MIDDLE, "Hs": 1.31, "Tz": 6.3, "processed_Hs": 1.3, "processed_Tz": 6.25}]}}),
        {"tm02_s": "mean"},
    ),
    "drifter_wavestats.csv": (
        "time,pcutoff,pHs0,pT02,pT24,Hs0,T02,T24\n2026-09-21 14:23:20,7,1.3,6.25,5.1,1.4,6.4,5.2\n", {"tm02_s": "mean"},
    ),
    "archive.csv": (
        "Time (UTC), Site, Hsig (m), Tp (s), Tm (s), Dp (deg), Dm (deg), DmSpr (deg), SST (degC)\n"
        f"{MIDDLE:.0f},Hilarys,1.30,8.50,6.25,355.00,350.00,30.00,-9999.0\n",
        {"tm01_s": "mean", "peak_direction_deg": "peak", "direction_deg": "", "spread_deg": ""},
    ),
}  # fmt: skip


@pytest.fixture(scope="module")
def sea():
    """Sea states of a burst that knows its UTC."""
    made = pb.simulate("buoy", frame="NED", sensors="icm20948", unit="calibrated", seed=3, rate=10.0, duration=1200.0)
    return pb.waves(pb.Recording(imu=made.imu.corrected(meta=replace(made.imu.meta, t0_ns=T0_NS)), name="sea"))


@pytest.mark.parametrize("name", FORMS)
def test_each_form_is_read_by_its_names(sea, tmp_path, name):
    text, names = FORMS[name]
    (tmp_path / name).write_text(text)
    beside = sea.compare(tmp_path / name)
    assert beside.reference["hm0_m"] == pytest.approx([1.3])
    for quantity, of_row in names.items():
        assert beside.reference[quantity] == pytest.approx([ROW[of_row or quantity]]), quantity
    burst = sea.bursts[0]
    assert beside.differences()["hm0_m"] == pytest.approx([burst["hm0_m"] - 1.3])
    if "peak_direction_deg" in names:  # the shorter way round, from 355° to about 225°
        apart = math.remainder(burst["peak_direction_deg"] - 355.0, 360.0)
        assert beside.differences()["peak_direction_deg"] == pytest.approx([apart])
    assert "rms difference" in beside.text() and "1.30 (" in beside.text()
    assert beside.columns()["reference hm0 [m]"] == pytest.approx([1.3])


def test_tables_in_netcdf_and_of_plumbob_itself_are_read(sea, tmp_path):
    import xarray

    at = np.array([["2026-09-21T14:23:20", "NaT"]], dtype="datetime64[ns]")
    like = ("trajectory", "obs_waves_imu")
    xarray.Dataset({"time_waves_imu": (like, at), "pHs0": (like, np.array([[1.3, np.nan]])),
                    "time": (("trajectory", "obs"), at[:, :1])}).to_netcdf(tmp_path / "omb.nc")  # fmt: skip
    assert sea.compare(tmp_path / "omb.nc").reference["hm0_m"] == pytest.approx([1.3])
    for name in ("own.nc", "own.csv"):
        sea.save(tmp_path / name)
        beside = sea.compare(tmp_path / name)
        assert {"hm0_m", "tp_s", "tm02_s", "direction_deg"} <= beside.reference.keys()
        assert all(abs(each[0]) < 1e-6 for each in beside.differences().values())


def test_what_cannot_be_compared_is_refused(sea, tmp_path):
    table = tmp_path / "table.csv"
    for text, error, match in (
        ("time,Hs (kg)\n2026-09-21T14:23:20Z,1.3\n", UnitError, "kg"),
        ("time,temperature\n2026-09-21T14:23:20Z,1.3\n", DecodeError, "temperature"),
        ("2026,1.3\n", DecodeError, "no table of waves"),
        ("", DecodeError, "no columns"),
        ("time,Hs\n2026-09-20T14:23:20Z,1.3\n", ParameterError, "2026-09-20T14:23:20"),
        ('{"waves": [', DecodeError, "cut or damaged"),
    ):
        table.write_text(text)
        with pytest.raises(error, match=match):
            sea.compare(table)
    table.write_text("time,Hs [cm],Tp\n2026-09-21T14:23:20Z,130,99.0\n2026-09-21T15:00:00Z,150,8\n")
    assert sea.compare(table).reference["hm0_m"] == pytest.approx([1.3])
    assert np.isnan(sea.compare(table).reference["tp_s"]).all()  # 99 stands for a period that is missing
    table.write_text("time,Hs,Dm\n2026-09-21T14:23:20Z,1.3,99\n2026-09-21T14:40:00Z,99.0,999\n")
    assert sea.compare(table).reference["direction_deg"].tolist() == [99.0]  # but not for a direction
    blind = replace(sea, bursts=({**sea.bursts[0], "begin_utc": None},))
    with pytest.raises(ParameterError, match="UTC"):
        blind.compare(table)


def test_the_verb_gives_both(sea, tmp_path):
    made = pb.simulate("buoy", frame="NED", sensors="icm20948", unit="calibrated", seed=3, rate=10.0, duration=1200.0)
    recording, table = tmp_path / "sea.parquet", tmp_path / "44013.txt"
    pb.write(recording, made.imu.corrected(meta=replace(made.imu.meta, t0_ns=T0_NS)))
    table.write_text(FORMS["44013.txt"][0])
    command = [sys.executable, "-m", "plumbob", "waves", str(recording), "--reference", str(table), "--json"]
    done = json.loads(subprocess.run(command, capture_output=True, text=True, check=True).stdout)
    assert done["reference"]["hm0_m"] == [1.3] and done["bursts"][0]["hm0_m"] == pytest.approx(1.3, abs=0.2)
