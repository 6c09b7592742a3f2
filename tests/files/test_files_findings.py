"""What is said about the data of a recording."""

import numpy as np
import pytest

from plumbob import Frame, ImuData, ImuMeta, files
from plumbob.core.findings import info, lasting, warning
from plumbob.data.plausibility import doubts, turning, upside_down
from plumbob.data.recording import EARTH_FIELD, findings
from plumbob.simulation import SCENARIOS, simulate
from tests.helpers.io_samples import make_imu
from tests.helpers.real_data import DATA, needs

META = ImuMeta(calibration="card", unit_check=False)


def lines(topic, **changes):
    return [line for line in map(str, findings(make_imu(**({"meta": META} | changes)))) if line.startswith(topic)]


def test_clean_and_uncalibrated_recordings_and_provenance():
    assert findings(make_imu(meta=META)) == ()
    assert lines("calibration: ", meta=ImuMeta()) != []
    kept = info("source.estimated", name="a", by="mekf"), warning("reading.starts", starts=2)
    assert lasting([kept[0], *findings(make_imu(meta=ImuMeta())), kept[1], kept[0]]) == kept
    # IGRF-13: total intensity from 22 µT (South Atlantic anomaly) to 67 µT (near the southern magnetic pole).
    assert EARTH_FIELD == (22.0, 67.0)


@pytest.mark.parametrize("size", [0.5, 21.0, 22.5, 49.0, 66.5, 68.0, 900.0, 1e300])
def test_magnetic_field_of_the_earth_or_beyond(size):
    told = lines("magnetic field: ", mag=np.tile([0.0, 0.0, size], (12, 1)))
    assert len(told) == (not 22.0 <= size <= 67.0)
    assert all(f"{size:.4g} µT" in line or "inf" in line for line in told)  # the square of 1e300 is no warning of NumPy


def test_clipped_and_invalid_samples_and_gaps_are_counted():
    gyr, t = np.zeros((12, 3)), np.arange(12) * 0.01
    gyr[[2, 5, 7], 1] = -10.0
    gyr[9, 0] = np.inf
    t[6:] += 0.5
    meta = ImuMeta(calibration="card", unit_check=False, gyr_range=10.0)
    assert tuple(map(str, findings(make_imu(t=t, gyr=gyr, meta=meta)))) == (
        "clipped: gyr is at the end of the range in 3 of 12 samples",
        "invalid: gyr is infinite or impossible in 1 of 12 samples",
        "gaps: samples are missing before 1 of 12; the longest step is 0.51 s",
    )


def still(rows=1000, **changes):
    """Noise at 100 Hz, ten seconds of it."""
    return make_imu(rows, t=np.arange(rows) * 0.01, meta=META, **changes)


def stuck(imu):
    return [line for line in map(str, findings(imu)) if line.startswith("stuck: ")]


def with_rows(name, *rows):
    """A recording of noise whose triad has other values in some rows."""
    values = getattr(still(), name).copy()
    for begin, end, value in rows:
        values[begin:end] = values[begin] if value is None else value
    return still(**{name: values})


FROZEN = [
    (with_rows("gyr", (499, 651, None)), "gyr does not change for 1.51 s from t = 4.99 s"),
    (with_rows("acc", (499, 651, None)), "acc does not change for 1.51 s from t = 4.99 s"),
    (with_rows("mag", (500, 651, [20.0, 1.0, -40.0])), "mag does not change for 1.5 s from t = 5 s"),
    (
        with_rows("gyr", (700, 1000, 0.0), (100, 250, 0.0)),
        "gyr is exactly zero for 2.99 s from t = 7 s, the longest of 2 such stretches",
    ),
    (with_rows("acc", (100, 195, None)), None),  # 0.94 s
    (with_rows("gyr", (0, 1000, 0.0)), None),  # it never changes, as in a simulation without noise
    (still(mag=np.repeat(still().mag[::3], 20, axis=0)[:1000]), None),  # a slow one that repeats its value
    (still(acc=np.vstack([[[0.0, 0.0, 9.8], [0.0, 0.0, 9.9]], np.full((998, 3), np.inf)])), None),
]


@pytest.mark.parametrize(("imu", "line"), FROZEN, ids=range(len(FROZEN)))
def test_a_sensor_that_froze_or_fell_silent(imu, line):
    assert stuck(imu) == ([f"stuck: {line}"] if line else [])
    assert len(imu) == 1000


@pytest.mark.parametrize("value", [0.0, -0.25])
def test_an_axis_that_never_changes_while_the_others_do_is_named(value):
    gyr = still().gyr.copy()
    gyr[:, 1] = value
    assert stuck(still(gyr=gyr)) == [f"stuck: gyr y is {value:g} in every sample, while the others change"]


def test_nothing_is_said_too_early_without_motion_or_sensors():
    slow = make_imu(100, t=np.arange(100) * 0.1, meta=META)
    acc = slow.acc.copy()
    acc[10:55] = acc[10]  # 4.4 s, but 45 samples
    assert stuck(make_imu(100, t=slow.t, meta=META, acc=acc)) == []
    rest = make_imu(3000, t=np.arange(3000) * 0.01, meta=META)
    assert not turning(rest).tells
    for changes in ({"acc": None}, {"gyr": None}, {"acc": np.zeros((3000, 3))}, {"gyr": np.zeros((3000, 3))}):
        assert not turning(make_imu(3000, t=rest.t, meta=META, **changes)).tells
    assert not turning(make_imu(1)).tells


def turned(imu, factor, **changes):
    return ImuData(**({"t": imu.t, "gyr": factor * imu.gyr, "acc": imu.acc, "meta": META} | changes))


def gyroscope(imu):
    return [line for line in map(str, findings(imu)) if line.startswith("gyroscope: ")]


@pytest.mark.parametrize("name", ["buoy", "rod", "fin"])
def test_rates_in_another_unit_or_against_the_accelerometer(name):
    settings = {} if name == "fin" else {"duration": 150.0}
    imu = simulate(name, frame=Frame.NED, sensors="mpu6000+hmc5983", unit="random", seed=1, **settings).imu
    assert gyroscope(turned(imu, 1.0)) == []
    assert "57 times slower" in gyroscope(turned(imu, 180.0 / np.pi))[0]
    assert "°/s declared as rad/s" in gyroscope(turned(imu, 180.0 / np.pi))[0]
    assert "57 times faster" in gyroscope(turned(imu, np.pi / 180.0))[0]
    assert "a sign or an axis is wrong" in gyroscope(turned(imu, -1.0))[0]
    assert gyroscope(turned(imu, 2.0)) == []  # a wrong scale is not told from accelerations


SENSORS = ("ideal", "mpu6000+hmc5983", "adis16355:density")
LONG = pytest.mark.long(reason="each simulation is looked at with one set of sensors before every commit")


@pytest.mark.parametrize(
    ("name", "sensors"),
    [
        pytest.param(name, sensors, marks=() if (i + k) % 3 == 0 else LONG)
        for i, name in enumerate(SCENARIOS)
        for k, sensors in enumerate(SENSORS)
    ],
)
def test_right_rates_of_every_simulation(name, sensors):
    module = "calibrated" if sensors == "ideal" else "random"
    imu = simulate(name, frame=Frame.NWU, sensors=sensors, unit=module, seed=2).imu
    assert (gyroscope(imu), doubts(imu[:10_000]), upside_down(imu, Frame.NWU)) == ([], (), ())


@needs("broad")
@pytest.mark.long(reason="fifteen recordings of minutes; before every commit simulations stand for them")
def test_right_rates_and_no_stuck_sensor_in_every_broad_trial():
    trials = [path for path in (DATA / "broad").iterdir() if path.suffix in {".mat", ".hdf5"}]
    assert len(trials) >= 15
    telling = 0
    for path in trials:
        imu = files.read(path).imu
        assert (gyroscope(imu), stuck(imu)) == ([], []), path
        assert (doubts(imu[:10_000]), upside_down(imu, Frame.ENU)) == ((), ()), path  # BROAD's frame
        telling += turning(imu).tells
    assert telling >= 8


@pytest.mark.parametrize("most", [50_000, 100])
def test_factor_of_a_slow_turn_with_bias_and_holes(monkeypatch, most):
    """The y axis nods: acc = R(−angle) g, by hand; k = 1 whatever the bias."""
    t = np.arange(6000) * 0.01
    angle = 0.3 * np.sin(1.3 * t)
    acc = 9.8 * np.column_stack((-np.sin(angle), np.zeros_like(t), np.cos(angle)))
    gyr = np.outer(0.39 * np.cos(1.3 * t), [0.0, 1.0, 0.0]) + [0.1, -0.2, 0.3]
    acc[::3] = np.nan
    gyr[2000:2500] = np.nan
    monkeypatch.setattr("plumbob.data.plausibility.MOST_PAIRS", most)
    found = turning(ImuData(t=t, gyr=gyr, acc=acc))
    assert found.tells
    assert found.factor == pytest.approx(1.0, abs=0.02)
    assert found.correlation == pytest.approx(1.0, abs=0.01)
    assert found.windows < (6000 // 20 - 25 if most > 300 else 100)
