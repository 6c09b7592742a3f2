"""A real motion, and makers of the files of others: by hand from their descriptions, or by the format's own library."""

import io
import struct
import zipfile
from typing import NamedTuple

import numpy as np

from plumbob.core.constants import G0
from plumbob.core.units import from_si
from plumbob.rotations import Frame, change_frame, euler_zyx_from_quat, quat_multiply
from tests.helpers import beside, log_samples
from tests.helpers.log_samples import G
from tests.helpers.real_data import DATA


class Motion(NamedTuple):
    """Samples (ns; rad/s, m/s², µT; °C) and attitude, in forward-left-up and ENU, or in forward-right-down and NED."""

    t_ns: np.ndarray
    gyr: np.ndarray
    acc: np.ndarray
    mag: np.ndarray
    temp_c: np.ndarray
    q_nb: np.ndarray

    def frd(self):
        """The same in forward-right-down axes and NED."""
        c = np.array([1.0, -1.0, -1.0])
        q = quat_multiply(change_frame(self.q_nb, to=Frame.NED, from_=Frame.ENU), [0.0, 1.0, 0.0, 0.0])
        return self._replace(gyr=self.gyr * c, acc=self.acc * c, mag=self.mag * c, q_nb=q)

    def every(self, step):
        """One row of so many."""
        return Motion(*(one[::step] for one in self))


def real_motion(rows=3000):
    """A part of a trial of BROAD in which the unit is turned; a simulated one, swayed, where that is not at hand."""
    path = DATA / "broad" / "03_undisturbed_slow_rotation_C.hdf5"
    if path.is_file():
        import h5py

        with h5py.File(path) as trial:
            start = int(np.argmax(trial["movement"][:])) - 600
            names = ("imu_gyr", "imu_acc", "imu_mag", "opt_quat")
            gyr, acc, mag, q_nb = (trial[name][start : start + rows] for name in names)
    else:
        from plumbob import simulate

        rates = {"duration": rows / 285.0, "rate": 285.0, "mag_rate": 285.0}
        made = simulate("sway", frame="ENU", sensors="ideal", unit="calibrated", seed=4, **rates)
        gyr, acc, mag, q_nb = made.imu.gyr, made.imu.acc, made.imu.mag, made.truth.q_nb
    count = len(gyr)
    t_ns = np.round(np.arange(count) * (7e9 / 2000.0)).astype(np.int64)
    return Motion(t_ns, gyr, acc, mag, 20.0 + 0.25 * (np.arange(count) // 100), q_nb)


def _csv(row):
    return ",".join(map(repr, map(float, row)))


IMU_HEAD = (
    "#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1],"
    "a_RS_S_x [m s^-2],a_RS_S_y [m s^-2],a_RS_S_z [m s^-2]\n"
)
TRUTH_HEAD = "#timestamp, p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], q_RS_y [], q_RS_z []\n"
START = 1403636579758555392
IDENTITY = (
    "[1.0, 0.0, 0.0, 0.0,\n         0.0, 1.0, 0.0, 0.0,\n         0.0, 0.0, 1.0, 0.0,\n         0.0, 0.0, 0.0, 1.0]"
)
QUARTER = "[0, -1, 0, 0.1,\n 1, 0, 0, 0.2, # about z\n 0, 0, 1, 0.3,\n 0, 0, 0, 1]"


def yaml(data):
    return f"# Default\nsensor_type: imu\nT_BS:\n  cols: 4\n  rows: 4\n  data: {data}\nrate_hz: 200 # Hz\n"


def asl(folder, truth="state_groundtruth_estimate0", imu_turn=IDENTITY, truth_turn=IDENTITY, moving=None):
    """A sequence; without a motion at rest, x of the IMU up as on EuRoC's helicopter, and the truth of the middle."""
    half = np.sqrt(0.5)  # a quarter turn about y takes x to −z, so minus a quarter turn takes x to z, up
    if moving is None:
        stamps = START + 5_000_000 * np.arange(100)
        samples, attitudes = [[0.1, -0.2, 0.3, G, 0, 0]] * 100, [[half, 0, -half, 0]] * 100
    else:
        stamps, attitudes = START + moving.t_ns, moving.q_nb.tolist()
        samples = np.column_stack([moving.gyr, moving.acc]).tolist()
    table = folder / "mav0" / "imu0" / "data.csv"
    table.parent.mkdir(parents=True)
    table.write_text(IMU_HEAD + "".join(f"{t},{_csv(row)}\n" for t, row in zip(stamps, samples, strict=True)))
    table.with_name("sensor.yaml").write_text(yaml(imu_turn))
    other = folder / "mav0" / truth / "data.csv"
    other.parent.mkdir()
    rows = list(zip(stamps, attitudes, strict=True))[10:-10]
    other.write_text(TRUTH_HEAD + "".join(f"{t},1,2,3,{_csv(row)},9,9,9\n" for t, row in rows))
    other.with_name("sensor.yaml").write_text(yaml(truth_turn))
    return folder


def drive(folder, count=50, yaw=0.3, pitch=0.1, roll=-0.2, moving=None):
    """A drive: lat lon alt roll pitch yaw, velocities, ax ay az …, wx wy wz … (`dataformat.txt`); or one at rest."""
    data = folder / "oxts" / "data"
    data.mkdir(parents=True)
    if moving is None:
        # specific force of a body at rest, turned by yaw, pitch, roll about z, y, x of FLU against ENU: closed form
        f = G * np.array([-np.sin(pitch), np.sin(roll) * np.cos(pitch), np.cos(roll) * np.cos(pitch)])
        rows = [[roll, pitch, yaw, *f, 0.01, 0.02, 0.03]] * count
        seconds = [i * 0.1 for i in range(count)]
    else:
        angles = euler_zyx_from_quat(moving.q_nb)[:, ::-1]
        rows, seconds = np.column_stack([angles, moving.acc, moving.gyr]).tolist(), (moving.t_ns / 1e9).tolist()
    for i, row in enumerate(rows):
        numbers = [49.0, 8.4, 116.0, *row[:3], 0, 0, 0, 0, 0, *row[3:6], 1, 2, 3, *row[6:], 4, 5, 6, 0.1, 0.1]
        (data / f"{i:010d}.txt").write_text(" ".join(f"{value:.12g}" for value in numbers) + " 4 9 6 6 6\n")
    stamps = [f"2011-09-26 13:02:{25 + s:012.9f}" for s in seconds]
    (folder / "oxts" / "timestamps.txt").write_text("\n".join(stamps) + "\n")
    return folder


HEAD = "Time (s);Vicon Orientation;;;;IMU Acceleration;;;IMU Gyroscope;;;IMU Magnetometer;;;\n"
HEAD += ";W;X;Y;Z;X;Y;Z;X;Y;Z;X;Y;Z;\n"


T0 = 1_759_650_000_000_000_000  # 2025-10-05, the stamp of phyphox-docs, "Saved states"
REST = (0.1, -0.2, 9.8)
RATE = (0.01, 0.02, -0.03)
FIELD = (18.0, -2.0, -42.0)


def zipped(path, files):
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, text in files.items():
            archive.writestr(name, text)
    return path


def foldered(path, files):
    for name, text in files.items():
        (path / name).parent.mkdir(parents=True, exist_ok=True)
        (path / name).write_text(text.rstrip("\n") + "\n", encoding="utf-8")
    return path


PAUSED = (
    '"event","experiment time","system time","system time text"\n'
    '"START",0.000000000E0,1759650000.000,"2025-10-05 10:20:00.000 UTC+02:00"\n'
    '"PAUSE",1.000000000E0,1759650001.000,"2025-10-05 10:20:01.000 UTC+02:00"\n'
    '"START",1.000000000E0,1759650005.500,"2025-10-05 10:20:05.500 UTC+02:00"\n'
)
DEVICE = '"property","value"\n"version","1.2.0"\n"deviceBrand","google"\n"deviceModel","Pixel 6a"\n'


def phyphox_table(what, unit, values, *, rows=200, rate=100.0, separator=",", decimal="."):
    names = [f"{what}{axis}" for axis in ("x", "y", "z")] if what else ["X", "Y", "Z"]
    head = separator.join(f'"{cell}"' for cell in ["Time (s)", *(f"{name} ({unit})" for name in names)])
    values = np.broadcast_to(values, (rows, 3)).tolist() if np.ndim(values) == 1 else values.tolist()
    table = [(i / rate, *row) for i, row in enumerate(values)]
    lines = [separator.join(f"{v:.9E}" for v in row).replace(".", decimal) for row in table]
    return "\n".join([head, *lines, ""])


def phyphox_files(**layout):
    return {
        "Accelerometer.csv": phyphox_table("Acceleration ", "m/s^2", REST, **layout),
        "Linear Accelerometer.csv": phyphox_table("Linear Acceleration ", "m/s^2", (0.0, 0.0, 0.0), **layout),
        "Gyroscope.csv": phyphox_table("Gyroscope ", "rad/s", RATE, **layout),
        "Magnetometer.csv": phyphox_table("Magnetic field ", "µT", FIELD, rate=50.0, **layout),
        "meta/time.csv": PAUSED.replace(",", layout.get("separator", ",")),
        "meta/device.csv": DEVICE.replace(",", layout.get("separator", ",")),
    }


LOGGER_META = (
    "version,device name,recording epoch time,recording time,recording timezone,platform,appVersion,device id,sensors,"
    "sampleRateMs,standardisation,platform version\n"
    "3,My phone,1759650000000,2025-10-05_08-20-00,Europe/Berlin,{},1.44,id,Accelerometer|Gravity,10|10,{},17\n"
)


def logger_table(values, rows=100, late_ns=0):
    table = enumerate(np.broadcast_to(values, (rows, 3)).tolist() if np.ndim(values) == 1 else values.tolist())
    lines = [f"{T0 + i * 10_000_000 + late_ns},{i / 100},{z},{y},{x}" for i, (x, y, z) in table]
    return "\n".join(["time,seconds_elapsed,z,y,x", *lines])  # the app ends its last line without a line end


def binary(letter, us, *values):
    """A message as Connection/DataMessages of x-IMU3-Software writes it, by its description."""
    body = struct.pack(f"<Q{len(values)}f", us, *values)
    escaped = body.replace(b"\xdb", b"\xdb\xdd").replace(b"\n", b"\xdb\xdc")
    return bytes([ord(letter) | 0x80]) + escaped + b"\n"


OLD = "// Start Time: Unknown\n// Update Rate: 100.0Hz\n// Filter Profile: human (46.1)\n// Firmware Version: 4.0.2\n"
NEW = (
    "// General information:\n//  MT Manager version: 2022.2.0\n// Device information:\n//  DeviceId: 00B4D6D1\n"
    "//  ProductCode: MTW2-3A7G6\n// Device settings:\n//  Filter Profile: human(46.1)\n// Coordinate system: ENU\n"
)
SENSORS = ["Acc_X", "Acc_Y", "Acc_Z", "Gyr_X", "Gyr_Y", "Gyr_Z", "Mag_X", "Mag_Y", "Mag_Z"]


def export(path, head, columns, rows, separator="\t"):
    lines = [separator.join(columns), *(separator.join(map(str, row)) for row in rows)]
    path.write_text(head + "\n".join(lines) + "\n", encoding="utf-8")
    return path


def telemetry(send):
    """Packets by pymavlink, each after the receiver's stamp."""
    from pymavlink.dialects.v20 import ardupilotmega as mavlink

    out = io.BytesIO()

    class Wire:
        us = 0

        def write(self, data):
            out.write(struct.pack(">Q", self.us) + bytes(data))

    wire = Wire()
    sender = mavlink.MAVLink(wire, srcSystem=1, srcComponent=1)
    send(sender, wire, mavlink)
    return out.getvalue()


def hdf5(path, found, turned=False):
    """Named arrays by h5py; turned as MATLAB's version 7.3 keeps them."""
    import h5py

    with h5py.File(path, "w", userblock_size=512 if turned else 0) as file:
        for name, value in found.items():
            group = value if isinstance(value, dict) else {"": value}
            for key, array in group.items():
                table = np.atleast_2d(array) if turned else array  # MATLAB keeps a table of one column as 1×N there
                table = table.T if turned and array.ndim == 2 else table
                file.create_dataset(f"{name}/{key}".strip("/"), data=table, compression="gzip")
    if turned:
        raw = bytearray(path.read_bytes())
        raw[:10] = b"MATLAB 7.3"
        path.write_bytes(raw)


# Kinds of a motion


def ros_rows(m):
    """Messages of a driver: samples, orientation, a slow magnetometer, a thermometer; xyzw, tesla."""
    from tests.helpers import ros_bags

    slow = {"mag": from_si(m.mag, "T"), "temp_c": m.temp_c}
    return ros_bags.all_rows({"t_ns": m.t_ns, "gyr": m.gyr, "acc": m.acc, "xyzw": m.q_nb[:, [1, 2, 3, 0]]} | slow)


def px4_of(m):
    return log_samples.px4(moving=_flown(m))


def dataflash_text_of(m):
    t_us, gyr, acc, mag, q_nb = _flown(m)
    return log_samples.dataflash_text(t_us, gyr, acc, q_nb, mag)


def _flown(m):
    m = m.frd()
    return (1_000_000 + m.t_ns // 1000).astype(np.uint64), m.gyr, m.acc, m.mag, m.q_nb


def tlog_of(m):
    """HIGHRES_IMU and ATTITUDE_QUATERNION by pymavlink: gauss, float32."""
    t_us, gyr, acc, mag, q_nb = _flown(m)

    def send(sender, wire, mavlink):
        for i, t in enumerate(t_us.tolist()):
            wire.us = 1_700_000_000_000_000 + t + 3000 + (i % 7) * 1000
            field = from_si(mag[i], "gauss")
            sender.highres_imu_send(t, *acc[i], *gyr[i], *field, 1000.0, 0.0, 0.0, 25.0, 0x1FF)
            if i % 10 == 0:
                sender.attitude_quaternion_send(t // 1000, *q_nb[i], *gyr[i])

    return telemetry(send)


def repoimu_of(m):
    """Vicon's quaternion, m/s², rad/s, and fields in units of the local one."""
    table = np.column_stack([m.t_ns / 1e9, m.q_nb, m.acc, m.gyr, m.mag / 50.0])
    return HEAD + "\n".join(";".join(f"{value:.17g}" for value in row) + ";" for row in table) + "\n"


def phyphox_of(m, **layout):
    """An export of phyphox of a constant rate."""
    started = PAUSED.splitlines(keepends=True)[:2]
    return {
        "Accelerometer.csv": phyphox_table("Acceleration ", "m/s^2", m.acc, rate=2000.0 / 7.0, **layout),
        "Gyroscope.csv": phyphox_table("Gyroscope ", "rad/s", m.gyr, rate=2000.0 / 7.0, **layout),
        "Magnetometer.csv": phyphox_table("Magnetic field ", "µT", m.mag[::3], rate=2000.0 / 21.0, **layout),
        "meta/time.csv": "".join(started),
        "meta/device.csv": DEVICE,
    }


def sensor_logger_of(m):
    """What Sensor Logger writes on Android."""
    return {
        "TotalAcceleration.csv": logger_table(m.acc, late_ns=3_000_000), "Gyroscope.csv": logger_table(m.gyr),
        "Magnetometer.csv": logger_table(m.mag), "Metadata.csv": LOGGER_META.format("android", "false"),
    }  # fmt: skip


def sensorlog_of(m):
    """One row of all sensors with CoreMotion's sign and g."""
    names = ["loggingTime(txt)", "motionTimestamp_sinceReboot(s)"]
    names += [*(f"accelerometerAcceleration{a}(G)" for a in "XYZ"), "accelerometerTimestamp_sinceReboot(s)"]
    names += [form.format(a) for form in ("motionRotationRate{}(rad/s)", "motionMagneticField{}(µT)") for a in "XYZ"]
    lines = [",".join(names)]
    for t_ns, gyr, acc, mag in zip(m.t_ns.tolist(), m.gyr, m.acc, m.mag, strict=True):
        t = f"{5000 + t_ns / 1e9:.6f}"
        stamp = f"2025-10-05 10:20:{t_ns / 1e9:06.3f} +0200"
        lines.append(f"{stamp},{t},{_csv(-acc / G0)},{t},{_csv(gyr)},{_csv(mag)}")
    return "\n".join([*lines, ""])


def xsens_of(path, m):
    """An export of MT Manager in ENU: SampleTimeFine of 0.1 ms, fields in units of the local one, quaternions."""
    columns = ["PacketCounter", "SampleTimeFine", *SENSORS, "Quat_q0", "Quat_q1", "Quat_q2", "Quat_q3"]
    numbers = np.column_stack([m.acc, m.gyr, m.mag / 50.0, m.q_nb])
    ticks = (m.t_ns + 50_000) // 100_000
    rows = [[i, tick, *(f"{v:.6f}" for v in row)] for i, (tick, row) in enumerate(zip(ticks, numbers, strict=True))]
    return export(path, NEW, columns, rows)


def xbus_message(kind, data, bus=0xFF):
    """A message of Xbus: the bytes after the first add up to 0."""
    length = bytes([len(data)]) if len(data) < 255 else b"\xff" + struct.pack(">H", len(data))
    body = bytes([bus, kind]) + length + data
    return b"\xfa" + body + bytes([-sum(body) & 0xFF])


def xbus_block(identity, data):
    return struct.pack(">HB", identity, len(data)) + data


def xbus_floats(identity, *values):
    return xbus_block(identity, struct.pack(f">{len(values)}f", *values))


def mtb_of(m):
    """MTData2 in ENU: SampleTimeFine of 0.1 ms, fields in units of the local one, quaternions."""
    raw = b""
    for i, tick in enumerate(((m.t_ns + 50_000) // 100_000).tolist()):
        data = xbus_block(0x1020, struct.pack(">H", i)) + xbus_block(0x1060, struct.pack(">I", tick % 2**32))
        data += xbus_floats(0x0810, m.temp_c[i]) + xbus_floats(0x2010, *m.q_nb[i]) + xbus_floats(0x4020, *m.acc[i])
        raw += xbus_message(0x36, data + xbus_floats(0x8020, *m.gyr[i]) + xbus_floats(0xC020, *(m.mag[i] / 50.0)))
    return raw


def ximu3_of(m):
    """Messages of °/s and g, fields in units of the local one, temperatures, quaternions in NWU."""
    q_nb = change_frame(m.q_nb, to=Frame.NWU, from_=Frame.ENU)
    raw = b""
    for i, t_ns in enumerate(m.t_ns.tolist()):
        us = 1_000_000 + t_ns // 1000
        raw += binary("I", us, *from_si(m.gyr[i], "deg/s"), *(m.acc[i] / G0))
        raw += binary("Q", us, *q_nb[i])
        if i % 10 == 0:
            raw += binary("M", us, *(m.mag[i] / 50.0)) + binary("T", us, m.temp_c[i])
    return raw


def ximu3_folder(folder, m):
    """The tables that the GUI makes of a log, with six digits."""
    folder.mkdir()
    us = 1_000_000 + m.t_ns // 1000
    rates = np.column_stack([from_si(m.gyr, "deg/s"), m.acc / G0])
    axes = [form.format(axis) for form in ("Gyroscope {} (deg/s)", "Accelerometer {} (g)") for axis in "XYZ"]
    tables = {
        "Inertial.csv": ("Timestamp (us)," + ",".join(axes), rates),
        "Magnetometer.csv": ("Timestamp (us),X (a.u.),Y (a.u.),Z (a.u.)", m.mag / 50.0),
        "Quaternion.csv": ("Timestamp (us),W,X,Y,Z", change_frame(m.q_nb, to=Frame.NWU, from_=Frame.ENU)),
    }
    for name, (head, table) in tables.items():
        rows = [f"{t}," + ",".join(f"{v:.6f}" for v in row) for t, row in zip(us, table, strict=True)]
        (folder / name).write_text("\n".join([head, *rows, ""]))
    return folder


PROFILE = beside(__file__, "unit.profile.toml")
"""Profile of `arrays_of`, or of the same as columns of a text."""


def arrays_of(m):
    return {
        "t": m.t_ns / 1e9, "imu": {"gyr": from_si(m.gyr, "deg/s"), "acc": m.acc / G0, "mag": m.mag}, "temp": m.temp_c,
        "quat": m.q_nb[:, [1, 2, 3, 0]],
    }  # fmt: skip


def profile_of_arrays(inside="imu/"):
    of = {name: f'"{inside}{name}"' for name in ("gyr", "acc", "mag")}
    return PROFILE.format(form="arrays = true", more="", quat='"quat"', **of)


def text_of(m):
    """A table with comma, its heads being names; its profile."""
    found = arrays_of(m)
    groups = {name: [f"{name}_{axis}" for axis in axes] for name, axes in
              (("gyr", "xyz"), ("acc", "xyz"), ("mag", "xyz"), ("quat", "xyzw"))}  # fmt: skip
    table = np.column_stack([found["t"], *found["imu"].values(), found["temp"], found["quat"]]).tolist()
    names = ["t", *groups["gyr"], *groups["acc"], *groups["mag"], "temp", *groups["quat"]]
    listed = {name: "[" + ", ".join(f'"{one}"' for one in names) + "]" for name, names in groups.items()}
    profile = PROFILE.format(form='separator = ","', more="[header]\nnames = true", **listed)
    return "\n".join([",".join(names), *map(_csv, table), ""]), profile
