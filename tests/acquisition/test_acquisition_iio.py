"""IIO devices, as a tree of files and a pipe. Facts: Linux, Documentation/ABI/testing/sysfs-bus-iio."""

import errno
import os
import struct
import time
from pathlib import Path

import numpy as np
import pytest

from plumbob.acquisition import IioPollSource, IioSource
from plumbob.acquisition.iio import IioDevice, list_devices, refusal
from plumbob.acquisition.transport import Received
from plumbob.core.errors import LineError, ParameterError
from tests.helpers.iio_scans import taken_apart

SCALE = 87266e-9  # rad/s a count: Linux, drivers/iio/gyro/adxrs290.c


class Machine:
    """Folders for /sys and /dev."""

    def __init__(self, root):
        self.sys, self.dev = root / "sys", root / "dev"
        self.dev.mkdir()
        (self.sys / "bus" / "iio" / "devices").mkdir(parents=True)

    def add(self, number, name, attributes):
        folder = self.sys / "bus" / "iio" / "devices" / f"iio:device{number}"
        for attribute, text in {"name": name, **attributes}.items():
            file = folder / attribute
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(f"{text}\n")
        os.mkfifo(self.dev / folder.name)
        return folder

    def add_gyro(self, number=0, name="adxrs290", **more):
        attributes = {"in_anglvel_scale": SCALE, "in_temp_scale": 100.0, "sampling_frequency": 100.0}
        for i, (channel, kind) in enumerate(
            [("anglvel_x", "le:s16/16>>0"), ("anglvel_y", "le:s16/16>>0"), ("temp", "le:s12/16>>0"),
             ("timestamp", "le:s64/64>>0")]
        ):  # fmt: skip
            attributes |= {
                f"scan_elements/in_{channel}_en": 0,
                f"scan_elements/in_{channel}_index": i,
                f"scan_elements/in_{channel}_type": kind,
            }
        buffer = {"buffer/enable": 0, "buffer/length": 2, "buffer/watermark": 1, "current_timestamp_clock": "realtime"}
        raw = {"in_anglvel_x_raw": 1, "in_anglvel_y_raw": 2, "in_temp_raw": 3}
        return self.add(number, name, {**attributes, **buffer, **raw, **more})

    def source(self, which="adxrs290", **options):
        return IioSource(which, sys_root=self.sys, dev_root=self.dev, **options)

    def polled(self, which, clock, rate=1000.0, **options):
        return IioPollSource(which, rate, sys_root=self.sys, clock=clock, sleep=clock.sleep, **options)

    def writer(self, number=0):
        return os.open(self.dev / f"iio:device{number}", os.O_WRONLY | os.O_NONBLOCK)


def scan(i):
    return struct.pack("<3hxxq", i, -i, i % 100, 1000 * i)


def snapshot(folder):
    return {str(f.relative_to(folder)): f.read_text().strip() for f in folder.rglob("*") if f.is_file()}


@pytest.fixture
def machine(tmp_path):
    return Machine(tmp_path)


@pytest.fixture
def gyro(machine):
    return machine.add_gyro()


def test_scans_arrive_whole_and_say_what_they_mean(machine, gyro, collect):
    with machine.source(stall_periods=1e5) as source:
        got = collect(source, lambda got: got.kinds == ["opened"])
        assert "adxrs290" in got.events[0].text
        writer = machine.writer()
        sent = b"".join(scan(i) for i in range(1000))
        for at in range(0, len(sent), 1003):  # the pipe cuts where it likes
            os.write(writer, sent[at : at + 1003])
            got += source.read(0.1)
        got = collect(source, lambda got: len(got.data) == len(sent), got)
        os.close(writer)
    assert all(len(item.data) % 16 == 0 for item in got if isinstance(item, Received))
    t_ns, columns = taken_apart(source.layout, got.data)
    assert t_ns.tolist() == [1000 * i for i in range(1000)]
    assert np.allclose(columns["gyr_y"], -SCALE * np.arange(1000), rtol=1e-15)
    assert np.allclose(columns["temp_c"], 0.1 * (np.arange(1000) % 100))


def test_the_device_is_set_up_and_put_back(machine, gyro):
    before = snapshot(gyro)
    with machine.source(rate=50, length=128, watermark=4, channels=("anglvel_x", "timestamp")) as source:
        during = snapshot(gyro)
        assert source.layout.size == 16
    changed = {name: text for name, text in during.items() if text != before[name]}
    assert changed == {
        "sampling_frequency": "50", "buffer/length": "128", "buffer/watermark": "4", "buffer/enable": "1",
        "current_timestamp_clock": "monotonic",
        "scan_elements/in_anglvel_x_en": "1", "scan_elements/in_timestamp_en": "1",
    }  # fmt: skip
    assert snapshot(gyro) == before


def test_the_buffer_is_stopped_before_anything_is_put_back(machine, gyro, monkeypatch):
    """The kernel refuses to change channels while it runs."""
    written = []
    real = Path.write_text

    def write(path, text, **options):
        written.append((path.name, text))
        return real(path, text, **options)

    monkeypatch.setattr(Path, "write_text", write)
    with machine.source(channels=["anglvel_x"]):
        assert (written[0], written[-1]) == (("enable", "0"), ("enable", "1"))
        written.clear()
    assert written[0] == ("enable", "0")
    assert ("in_anglvel_x_en", "0") in written


def test_a_buffer_that_a_killed_program_left_running_is_stopped(machine, gyro):
    (gyro / "buffer" / "enable").write_text("1")
    (gyro / "scan_elements" / "in_temp_en").write_text("1")
    with machine.source(channels=["anglvel_x"]):
        assert snapshot(gyro)["scan_elements/in_temp_en"] == "0"
    assert snapshot(gyro)["buffer/enable"] == "0"


def test_a_trigger_is_set_and_taken_back(machine):
    folder = machine.add_gyro(**{"trigger/current_trigger": ""})
    with machine.source(trigger="adxrs290-dev0"):
        assert snapshot(folder)["trigger/current_trigger"] == "adxrs290-dev0"
    assert snapshot(folder)["trigger/current_trigger"] == ""
    with pytest.raises(LineError, match="has no trigger/current_trigger"):
        machine.add_gyro(1, "other")
        machine.source("other", trigger="x").open()


def test_a_refusal_half_way_puts_back_what_was_done(machine, gyro):
    before = snapshot(gyro)
    (gyro / "buffer" / "length").unlink()
    with pytest.raises(LineError, match="has no buffer/length"):
        machine.source().open()
    assert snapshot(gyro) == {name: text for name, text in before.items() if name != "buffer/length"}


def test_by_name_by_number_and_lists(machine, gyro):
    machine.add_gyro(1, "other")
    machine.add_gyro(10, "other")
    assert [device.name for device in list_devices(machine.sys, machine.dev)] == ["adxrs290", "other", "other"]
    for which in ("adxrs290", 0, "iio:device0"):
        assert machine.source(which).layout.device == "adxrs290"
    with pytest.raises(LineError, match=r"no IIO device mpu6050; .*: iio:device0 \(adxrs290\), iio:device1 \(other\)"):
        machine.source("mpu6050").open()
    with pytest.raises(LineError, match="is 2 devices"):
        machine.source("other").layout  # noqa: B018
    with pytest.raises(LineError, match="the devices of this machine: none"):
        IioSource("x", sys_root="/nowhere").open()


def test_a_device_is_waited_for(machine, collect):
    with machine.source(wait=True) as source:
        collect(source, lambda got: got.kinds == ["absent"])
        machine.add_gyro()
        collect(source, lambda got: got.kinds[-1:] == ["opened"])


def test_a_device_without_a_buffer_is_for_polling(machine):
    machine.add(0, "adxrs453", {"in_anglvel_z_raw": 1, "in_anglvel_z_scale": 218166e-9})
    with pytest.raises(LineError, match="has no buffer, so it can only be polled"):
        machine.source("adxrs453").open()


@pytest.mark.parametrize(
    ("attribute", "text", "said"),
    [
        ("scan_elements/in_anglvel_x_type", "le:s12", "not the type of a scan element"),
        ("in_anglvel_scale", "many", "which is not a number"),
        ("in_mount_matrix", "1, 0; 0, 1", "not three rows of three"),
        ("in_anglvel_scale", None, "has no scale"),
        ("scan_elements/in_anglvel_x_index", None, "has no index"),
    ],
)
def test_a_device_that_does_not_say_what_its_numbers_mean(machine, gyro, attribute, text, said):
    if text is None:
        (gyro / attribute).unlink()
    else:
        (gyro / attribute).write_text(text)
    with pytest.raises(LineError, match=said):
        machine.source().open()


def test_channels_of_unknown_units_are_left_out_or_refused(machine):
    machine.add_gyro(**{
        "scan_elements/in_voltage0_en": 0, "scan_elements/in_voltage0_index": 7,
        "scan_elements/in_voltage0_type": "le:u16/16>>0", "in_voltage0_scale": 1.0,
    })  # fmt: skip
    assert [c.name for c in machine.source().layout.channels] == ["anglvel_x", "anglvel_y", "temp", "timestamp"]
    with pytest.raises(LineError, match="the unit of 'voltage0' is not known"):
        machine.source(channels=["voltage0"]).open()
    with pytest.raises(LineError, match="has no accel_x; its channels: anglvel_x"):
        machine.source(channels=["accel_x"]).open()


def test_the_clock_of_the_time_stamps_is_told(machine, gyro):
    assert machine.source().layout.clock == "monotonic"
    assert machine.source(channels=["anglvel_x"]).layout.clock == ""
    (gyro / "current_timestamp_clock").unlink()  # Linux before 4.5
    assert machine.source().layout.clock == "realtime"


@pytest.mark.parametrize("polled", [False, True])
def test_a_device_that_has_become_another_is_refused(machine, gyro, clock, polled):
    def make(layout):
        return machine.polled("adxrs290", clock, layout=layout) if polled else machine.source(layout=layout)

    layout = make(None).layout
    (gyro / "sampling_frequency").write_text("50")  # changes no meaning
    with make(layout) as source:
        assert source.read(0.1)[0].kind == "opened"
    (gyro / "in_anglvel_scale").write_text("0.5")
    with pytest.raises(LineError, match="not what they were"):
        make(layout).open()


@pytest.mark.parametrize("file", ["in_anglvel_mount_matrix", "in_mount_matrix", "mount_matrix"])
def test_the_mount_matrix_is_read(machine, file):
    machine.add_gyro(**{file: "0, 1, 0; -1, 0, 0; 0, 0, 1"})
    assert machine.source().layout.mounts == {"gyr": ((0, 1, 0), (-1, 0, 0), (0, 0, 1))}


def test_a_mount_matrix_that_turns_nothing_is_none(machine):
    machine.add_gyro(in_mount_matrix="1, 0, 0; 0, 1, 0; 0, 0, 1", in_accel_mount_matrix="0, 1, 0; 1, 0, 0; 0, 0, 1")
    assert machine.source().layout.mounts == {}


def test_a_device_that_says_nothing_is_stalled(machine, gyro, collect):
    """20 periods of 100 Hz."""
    with machine.source() as source:
        collect(source, lambda got: got.kinds == ["opened"])
        start = time.monotonic()
        collect(source, lambda got: got.kinds == ["stalled"])
        assert time.monotonic() - start > 0.15
        writer = machine.writer()
        os.write(writer, scan(1))
        got = collect(source, lambda got: len(got) == 2)
        os.close(writer)
    assert (got.kinds, got.data) == (["resumed"], scan(1))


def test_a_device_that_goes_is_lost_and_found_again(machine, gyro, collect):
    with machine.source(stall_periods=1e5) as source:
        collect(source, lambda got: got.kinds == ["opened"])
        writer = machine.writer()
        os.write(writer, scan(1) + scan(2)[:7])
        assert collect(source, lambda got: got.data).data == scan(1)
        os.close(writer)
        got = collect(source, lambda got: "reopened" in got.kinds)
        assert got.kinds[0] == "lost"
        writer = machine.writer()
        os.write(writer, scan(3))
        assert collect(source, lambda got: got.data).data == scan(3)  # and nothing of the second
        os.close(writer)


@pytest.mark.parametrize(
    ("number", "what", "said"),
    [
        (errno.EACCES, "x", "udev"),
        (errno.EBUSY, "x", "iiod"),
        (errno.ENODEV, "x", "No such device"),
        (errno.EINVAL, "buffer/enable cannot be set to 1", "trigger="),
    ],
)
def test_refusals_of_the_kernel_say_what_to_do(number, what, said):
    device = IioDevice("adxrs290", Path("/sys/bus/iio/devices/iio:device0"), Path("/dev/iio:device0"))
    assert said in refusal(device, what, OSError(number, os.strerror(number))).text


@pytest.mark.parametrize(
    "options", [{"watermark": 0}, {"watermark": 9, "length": 8}, {"rate": 0}, {"stall_periods": 0}]
)
def test_what_can_never_be_right(machine, options):
    with pytest.raises(ParameterError):
        machine.source(**options)


def test_polling_reads_each_channel_at_the_rate(machine, clock):
    """ADXRS453: 218166 nrad/s a count; temperature (raw + 225) × 200 m°C (Linux, drivers/iio/gyro/adxrs450.c)."""
    folder = machine.add(0, "adxrs453", {
        "in_anglvel_z_raw": -160, "in_anglvel_z_scale": 218166e-9, "in_anglvel_z_quadrature_correction_raw": 5,
        "in_temp0_raw": -100, "in_temp0_scale": 200, "in_temp0_offset": 225,
    })  # fmt: skip
    channels = ("anglvel_z", "temp0")
    with machine.polled("adxrs453", clock, 250.0, channels=channels) as source:
        opened, start = source.read(1)[0], clock()
        first = source.read(1)[0]
        (folder / "in_anglvel_z_raw").write_text("160\n")
        second = source.read(1)[0]
    assert (opened.kind, first.t_ns - start, second.t_ns - start) == ("opened", 0, 4_000_000)
    t_ns, columns = taken_apart(source.layout, first.data + second.data)
    assert t_ns is None
    assert np.rad2deg(columns["gyr_z"]) == pytest.approx([-2.0, 2.0], rel=1e-4)
    assert columns["temp_c0"] == pytest.approx([25.0, 25.0])


def test_a_sign_that_the_kernel_forgot_is_given_back(machine, gyro, clock):
    """Kernels before commit fde272e78e showed the ADXRS290's rates unsigned: −19999 as 45537."""
    (gyro / "in_anglvel_x_raw").write_text("45537\n")
    with machine.polled("adxrs290", clock, channels=["anglvel_x"]) as source:
        source.read(1)
        _, columns = taken_apart(source.layout, source.read(1)[0].data)
    assert columns["gyr_x"] == pytest.approx([-19999 * SCALE])


def test_a_value_that_is_none_is_a_loss_and_no_exception(machine, gyro, collect, clock):
    with machine.polled("adxrs290", clock) as source:
        collect(source, lambda got: got.kinds == ["opened"])
        (gyro / "in_temp_raw").write_text("garbage\n")
        got = collect(source, lambda got: got.events)
        assert (got.kinds, "not a 32-bit number" in got.events[0].text) == (["lost"], True)
        (gyro / "in_temp_raw").write_text("7\n")
        collect(source, lambda got: got.kinds == ["reopened"] and got.data)


def test_polling_what_is_not_there(machine, clock):
    with pytest.raises(LineError, match="no IIO device"):
        machine.polled("x", clock).open()
    with pytest.raises(LineError, match="no IIO device"):
        machine.polled("x", clock).layout  # noqa: B018
    machine.add(0, "empty", {})
    with pytest.raises(LineError, match="channel of a known unit"):
        machine.polled("empty", clock).open()
