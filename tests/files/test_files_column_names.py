"""What names of columns say, in the words of loggers that are in use."""

from email.utils import parsedate_to_datetime

import pytest

from plumbob.core.units import Quantity
from plumbob.files.column_names import canonical, taken_apart
from plumbob.files.columns import is_stamp, stamps_ns

SENSORS = [  # name, cell of a row of units, sensor, axis, unit by our name
    ("Low/Acceleration/X", "m/s^2", "acc", "x", "m/s2"),  # APDM
    ("Low/Angular Velocity/Y", "rad/s", "gyr", "y", "rad/s"), ("Low/Magnetic Field/Z", "uT", "mag", "z", "uT"),
    ("Dev_Accel_LN_X_CAL", "m/(s^2)", "acc", "x", "m/s2"),  # Shimmer
    ("Dev_Mag_X_CAL", "local_flux", "mag", "x", ""),
    ("y-axis (deg/s)", "", "gyr", "y", "deg/s"),  # MetaMotion: the unit alone says it
    ("x-axis (g)", "", "acc", "x", "g"), ("gx(dps)", "", "gyr", "x", "deg/s"), ("az", "", "acc", "z", ""),
    ("acc_x_mg", "", "acc", "x", "mg"), ("gyro_x_rad_s", "", "gyr", "x", "rad/s"),
    ("field.angular_velocity.x", "", "gyr", "x", ""),  # rostopic echo -p
    ("field.linear_acceleration.z", "", "acc", "z", ""), ("gyroADC[2] (deg/s)", "", "gyr", "2", "deg/s"),  # Betaflight
    ("accSmooth[1]", "", "acc", "1", ""), ("X Accel [x8004]", "", "acc", "x", ""),  # a code is no unit
    ("角速度X", "[°/s]", "gyr", "x", "deg/s"), ("加速度Z", "[g]", "acc", "z", "g"),
    ("w_RS_S_x [rad s^-1]", "", "", "x", ""), ("Roll Rate (deg/s)", "", "gyr", "x", "deg/s"),
    ("GyroX(d/s)", "", "gyr", "x", "deg/s"), ("Ax[mG]", "", "acc", "x", "mg"),  # Epson: no gauss
    ("xgyro", "", "gyr", "x", ""),  # MAVLink
    ("Vitesse angulaire Z (rad/s)", "", "gyr", "z", "rad/s"),
    ("Pelvis Accel Sensor X,mG", "", "acc", "x", "mg"),  # Noraxon
    ("gyro_x_milli_dps", "", "gyr", "x", "mdeg/s"),  # not deg/s
    ("ax_mps2", "", "acc", "x", "m/s2"), ("mx_uT", "", "mag", "x", "uT"),
    ("('gyr', 'x')", "", "gyr", "x", ""),  # pandas, of columns in two rows
    ("ω_y / °/s", "", "gyr", "y", "deg/s"),  # ISO 80000-1: a quantity divided by its unit
    ("gx_deg/s", "", "gyr", "x", "deg/s"), ("GYRO_X[mDPS]", "", "gyr", "x", "mdeg/s"),
    ("VerticalAcc", "g", "acc", "z", "g"),  # AiM
    ("AccML", "", "acc", "y", ""),  # mediolateral
    ("Acceleration Sensor(X axis)(g)", "", "acc", "x", "g"),  # Torque
    ("accelerationIncludingGravity.x", "", "acc", "x", ""),
    ("akm_akm09918.x", "", "mag", "x", ""), ("HMC5883L_y", "", "mag", "y", ""), ("LIS3MDL z", "", "mag", "z", ""),
    ("adxl345_x", "", "acc", "x", ""), ("L3G4200D_z", "", "gyr", "z", ""), ("lis3dh_x", "", "acc", "x", ""),
    ("lsm6ds3_x", "", "", "x", ""),  # parts with two sensors say nothing
    ("Accel X, g (LGR S/N: 10)", "", "acc", "x", "g"), ("Ускорение X, м/с²", "", "acc", "x", "m/s2"),
    ("in_anglvel_x", "", "gyr", "x", ""), ("Hoeksnelheid X (graden/s)", "", "gyr", "x", "deg/s"),
    ("I[0].pqr[1]", "", "gyr", "1", ""), ("gx_LSB", "", "gyr", "x", ""), ("ay_raw", "", "acc", "y", ""),
    ("rotationRate.alpha", "", "gyr", "z", ""),  # W3C Device Orientation, 5.3: about z
]  # fmt: skip
OTHERS = [
    ("Linear Acceleration x (m/s^2)", "linear"), ("lin_acc_x", "linear"), ("FreeAcc_X", "linear"),
    ("Absolute acceleration (m/s^2)", "other"), ("field.angular_velocity_covariance0", "other"), ("gyro_temp", "other"),
    ("Gyro X (m/s^2)", "other"), ("mag_x (mV)", "other"),  # a unit of another quantity
    ("Dev_Battery_CAL", ""), ("axisP[0]", ""), ("motor[0]", ""), ("pressure (hPa)", ""), ("roll", ""), ("qx", ""),
    ("Gyro X (deg/s2)", "other"), ("Latitude (deg)", ""), ("gravity.x", "other"),
]  # fmt: skip
TIMES = ["t", "Time (s)", "time_ms", "timestamp", "Time stamp", "micros", "SampleTimeFine", "GPS TOW", "epoch (ms)",
         "elapsed (s)", "field.header.stamp", "Zeit [s]", "时间", "Dev_Timestamp_Unix_CAL"]  # fmt: skip
COUNTERS = ["PacketCounter", "loopIteration", "sample", "index", "frame_id", "seq", "Row"]


@pytest.mark.parametrize(("name", "unit", "sensor", "axis", "ours"), SENSORS)
def test_a_name_says_sensor_axis_and_unit(name, unit, sensor, axis, ours):
    column = taken_apart(name, unit)
    kind = {"gyr": Quantity.RATE, "acc": Quantity.ACCELERATION, "mag": Quantity.FIELD}.get(sensor)
    assert (column.sensor, column.axis, "" if kind is None else column.unit_as(kind)) == (sensor, axis, ours)
    assert not column.is_time
    assert not column.is_counter


@pytest.mark.parametrize(("name", "sensor"), OTHERS)
def test_what_is_no_triad_is_not_taken_for_one(name, sensor):
    assert taken_apart(name).sensor == sensor


@pytest.mark.parametrize("name", TIMES)
def test_time_is_known_by_its_name(name):
    assert taken_apart(name).is_time
    assert not taken_apart(name).is_counter


@pytest.mark.parametrize("name", COUNTERS)
def test_a_counter_is_no_time(name):
    assert taken_apart(name).is_counter
    assert not taken_apart(name).is_time


@pytest.mark.parametrize("letters", ["wxyz"])
@pytest.mark.parametrize("form", ["q{}", "Quat_{}", "orientation.{}", "quaternion[{}]", "field.orientation.{}"])
def test_components_of_a_quaternion(form, letters):
    assert "".join(taken_apart(form.format(letter)).quaternion for letter in letters) == letters


@pytest.mark.parametrize("text", ["rad s^-1", "rad*s^-1", "rad/s", "rad/sec", "radians/s", "rad.s^-1", "rad·s⁻¹"])
def test_powers_are_quotients(text):
    assert canonical(text, Quantity.RATE) == "rad/s"
    assert canonical("m s^-2", Quantity.ACCELERATION) == canonical("m/(s^2)", Quantity.ACCELERATION) == "m/s2"


def test_dates_in_words_are_the_moments_that_the_library_reads():
    """As C's asctime, Java's Date, ``date`` and e-mail write 1640207386 s since 1970, read by `email.utils` too."""
    moment = "Wed, 22 Dec 2021 21:09:46 +0000"
    forms = ["Wed Dec 22 21:09:46 2021", "Wed Dec 22 21:09:46 UTC 2021", "Thu Dec 23 00:09:46 GMT+03:00 2021", moment,
             "Wed, 22 Dec 2021 21:09:46 GMT", "Dec 22, 2021, 9:09:46 PM", "Dec 22 2021 21:09:46"]  # fmt: skip
    utc = 1_000_000_000 * int(parsedate_to_datetime(moment).timestamp())
    assert {stamps_ns([form], None)[0][0] for form in forms} == {utc}
    assert stamps_ns(["13. März 2024 12:30:45 CET", "14. März 2024 06:30:45 EST"], None) == (
        [1710329445 * 10**9, 1710415845 * 10**9],
        True,
    )
    assert stamps_ns(["5/13/2024 12:30:45", "5/12/2024 12:30:45"], 0)[0] == [1715603445 * 10**9, 1715517045 * 10**9]
    assert not any(map(is_stamp, ("Wed Foo 22 21:09:46 2021", "walking")))
