"""An IIO device as a tree of files and a pipe. Facts: Linux, Documentation/ABI/testing/sysfs-bus-iio."""

import os
import struct

import numpy as np

from plumbob.core.units import unit
from plumbob.live.transports.iio_layout import TIMESTAMP, iio_format
from plumbob.protocols.decode import decode

GYRO = 0.5 * 2.0**-11 / np.pi  # rad/s a count, no round number
ACCEL = 0.004785  # m/s² a count, ±16 g: Linux, drivers/iio/imu/inv_mpu6050/inv_mpu_core.c, accel_scale


class Tree:
    def __init__(self, root):
        self.sys, self.dev = root / "sys", root / "dev"
        self.dev.mkdir()
        (self.sys / "bus" / "iio" / "devices").mkdir(parents=True)

    def add(self, name, attributes, number=0):
        """A device with these files; one whose text is None is not there."""
        folder = self.sys / "bus" / "iio" / "devices" / f"iio:device{number}"
        for attribute, text in {"name": name, **attributes}.items():
            if text is not None:
                file = folder / attribute
                file.parent.mkdir(parents=True, exist_ok=True)
                file.write_text(f"{text}\n")
        os.mkfifo(self.dev / folder.name)
        return folder

    def add_buffered(self, name, kinds, attributes, number=0):
        """A device with a buffer, whose channels have these types in the scan, in their order."""
        buffer = {"sampling_frequency": 100, "buffer/enable": 0, "buffer/length": 2, "buffer/watermark": 1}
        scan = {}
        for i, (channel, kind) in enumerate(kinds.items()):
            scan |= {f"in_{channel}_en": 0, f"in_{channel}_index": i, f"in_{channel}_type": kind}
        scan = {f"scan_elements/{key}": text for key, text in scan.items()}
        return self.add(name, buffer | {"current_timestamp_clock": "realtime"} | scan | attributes, number)

    def add_imu(self, name="imu", **more):
        """Six axes: 12 bits of gyroscope in the upper bits of 16, big-endian acceleration, temperature, time."""
        kinds = {f"anglvel_{a}": "le:s12/16>>4" for a in "xyz"}
        kinds |= {f"accel_{a}": "be:s16/16>>0" for a in "xyz"} | {"temp": "le:s16/16>>0", "timestamp": "le:s64/64>>0"}
        scales = {"in_anglvel_scale": repr(GYRO), "in_accel_scale": repr(ACCEL), "in_temp_scale": 2.941176}
        return self.add_buffered(name, kinds, scales | {"in_temp_offset": 12420} | more)

    def session(self, source="", rest="", kind="iio", device="imu"):
        roots = f'sys_root = "{self.sys}"\n' + (f'dev_root = "{self.dev}"\n' if kind == "iio" else "")
        return (
            f'kind = "plumbob session"\nversion = 1\n[source]\nkind = "{kind}"\ndevice = "{device}"\n'
            f'{roots}{source}\n[imu]\nframe = "NED"\n{rest}'
        )

    def hold(self, number=0):
        """Open end of the pipe, in which bytes stay until somebody reads them."""
        return os.open(self.dev / f"iio:device{number}", os.O_RDWR | os.O_NONBLOCK)


def scans(gyr, acc, temp, t_ns):
    """Bytes of scans of `Tree.add_imu`, from counts; the lower four bits beside the 12 are not zero."""
    rows = zip(gyr, acc, temp, t_ns, strict=True)
    return b"".join(
        struct.pack("<3H", *((int(w) << 4 | 5) & 0xFFFF for w in g))
        + struct.pack(">3h", *map(int, a))
        + struct.pack("<hxxq", int(c), int(t))
        for g, a, c, t in rows
    )


def motion(count, seed=0, start_ns=5_000_000_000, period_ns=10_000_000):
    """Counts of a device that lies still, with noise, and times with the jitter of interrupts."""
    rng = np.random.default_rng(seed)
    gyr = rng.integers(-60, 61, (count, 3))
    acc = np.array([40, -90, -2047]) + rng.integers(-5, 6, (count, 3))
    t_ns = start_ns + period_ns * np.arange(count) + rng.integers(0, 200_000, count)
    return gyr, acc, rng.integers(-900, 900, count), t_ns


AXES = "xyz"


def decoded(layout, data):
    """Columns by our names, as a line decodes whole scans."""
    frames, counts = decode(data, iio_format(layout))
    assert counts.junk == 0
    return {name.replace(".", "_"): column for name, column in frames[layout.device].columns.items()}


def taken_apart(layout, data):
    """Time stamps, None where there are none, and columns by our names, in the axes of the board."""
    table = np.frombuffer(data, np.uint8).reshape(-1, layout.size)
    t_ns, columns = None, {}
    for channel, at in zip(layout.channels, layout.places, strict=True):
        raw = numbers(channel.type, table[:, at : at + channel.type.size])
        if channel.name == TIMESTAMP:
            t_ns = raw
        else:
            u = unit(channel.unit_name)
            columns[channel.column] = (raw.astype(np.float64) + channel.offset) * channel.scale * u.factor + u.offset
    for triad, matrix in layout.mounts.items():
        chip = {j: columns.pop(f"{triad}_{axis}") for j, axis in enumerate(AXES) if f"{triad}_{axis}" in columns}
        for row, axis in zip(matrix, AXES, strict=True):
            if chip and not any(row[j] for j in range(3) if j not in chip):
                columns[f"{triad}_{axis}"] = sum(row[j] * values for j, values in chip.items())
    return t_ns, columns


def numbers(kind, table):
    """Numbers (N,) as the driver counts them."""
    words = np.ascontiguousarray(table).view(f"{kind.order}u{kind.storage // 8}").astype(np.uint64)[:, 0]
    counts = ((words >> np.uint64(kind.shift)) & np.uint64(2**kind.bits - 1)).view(np.int64)
    sign = np.int64(1 << kind.bits - 1) if kind.signed and kind.bits < 64 else np.int64(0)
    return (counts ^ sign) - sign
