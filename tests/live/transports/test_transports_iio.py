"""IIO devices, as a tree of files and a pipe. Facts: Linux, Documentation/ABI/testing/sysfs-bus-iio."""

import errno
import os
import struct
import time
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from plumbob.core.errors import DecodeError, LineError, ParameterError, UnitError
from plumbob.live.transports.iio import IioDevice, IioPollSource, IioSource, list_devices, refusal
from plumbob.live.transports.iio_layout import IioChannel, IioLayout, IioType, parse_type
from plumbob.live.transports.transport import Received
from tests.helpers.iio_tree import Tree, decoded, taken_apart

SCALE = 87266e-9  # rad/s a count: Linux, drivers/iio/gyro/adxrs290.c


class Machine(Tree):
    def add_gyro(self, number=0, name="adxrs290", **more):
        rate = "le:s16/16>>0"
        kinds = {"anglvel_x": rate, "anglvel_y": rate, "temp": "le:s12/16>>0", "timestamp": "le:s64/64>>0"}
        raw = {"in_anglvel_x_raw": 1, "in_anglvel_y_raw": 2, "in_temp_raw": 3}
        scales = {"in_anglvel_scale": SCALE, "in_temp_scale": 100.0, "sampling_frequency": 100.0}
        return self.add_buffered(name, kinds, scales | raw | more, number)

    def source(self, which="adxrs290", **options):
        return IioSource(which, **({"sys_root": self.sys, "dev_root": self.dev} | options))

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


def test_the_device_is_set_up_and_put_back_after_a_refusal_half_way_too(machine, gyro):
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
    (gyro / "buffer" / "length").unlink()
    before = snapshot(gyro)
    with pytest.raises(LineError):
        machine.source().open()
    assert snapshot(gyro) == before


def test_the_buffer_is_stopped_before_anything_is_changed(machine, gyro, monkeypatch):
    (gyro / "buffer" / "enable").write_text("1")
    (gyro / "scan_elements" / "in_temp_en").write_text("1")
    with machine.source(channels=["anglvel_x"]):
        assert int(snapshot(gyro)["scan_elements/in_temp_en"]) == 0
    assert int(snapshot(gyro)["buffer/enable"]) == 0
    # the kernel refuses to change channels while it runs
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


@pytest.mark.parametrize(("more", "options", "attribute", "during"), [
    ({"trigger/current_trigger": ""}, {"trigger": "adxrs290-dev0"}, "trigger/current_trigger", "adxrs290-dev0"),
    ({}, {"rate": 50}, "sampling_frequency", "50"),
])  # fmt: skip
def test_what_is_set_is_taken_back(machine, more, options, attribute, during):
    folder = machine.add_gyro(**more)
    before = snapshot(folder)
    with machine.source(**options):
        assert snapshot(folder)[attribute] == during != before[attribute]
    assert snapshot(folder) == before


def test_which_device_and_what_its_layout_says(machine, gyro, collect):
    folder = machine.add_gyro(1, "other", **VOLTAGE)
    machine.add_gyro(10, "other")
    assert [device.name for device in list_devices(machine.sys, machine.dev)] == ["adxrs290", "other", "other"]
    layouts = [machine.source(which).layout for which in ("adxrs290", 0, "iio:device0", "iio:device1")]
    assert [layout.device for layout in layouts] == [*["adxrs290"] * 3, "other"]
    assert {len(layout.channels) for layout in layouts} == {4}  # channels of unknown units are left out
    clocks = [layouts[0].clock, machine.source(channels=["anglvel_x"]).layout.clock]
    (folder / "current_timestamp_clock").unlink()  # Linux before 4.5
    assert [*clocks, machine.source(1).layout.clock] == ["monotonic", "", "realtime"]
    with machine.source("later", wait=True) as source:
        collect(source, lambda got: got.kinds == ["absent"])
        machine.add_gyro(2, "later")
        collect(source, lambda got: got.kinds[-1:] == ["opened"])


ADXRS453 = {"in_anglvel_z_raw": -160, "in_anglvel_z_scale": 218166e-9}
VOLTAGE = {
    f"scan_elements/in_voltage0_{key}": text for key, text in (("en", 0), ("index", 7), ("type", "le:u16/16>>0"))
}
VOLTAGE["in_voltage0_scale"] = 1.0
REFUSED = {  # files of the device, how it is opened, what is said
    "type": ({"scan_elements/in_anglvel_x_type": "le:s12"}, {}, "not the type of a scan element"),
    "scale": ({"in_anglvel_scale": "many"}, {}, "which is not a number"),
    "matrix": ({"in_mount_matrix": "1, 0; 0, 1"}, {}, "not three rows of three"),
    "no scale": ({"in_anglvel_scale": None}, {}, "has no scale"),
    "no index": ({"scan_elements/in_anglvel_x_index": None}, {}, "has no index"),
    "no buffer": ({}, {"which": "adxrs453"}, "has no buffer, so it can only be polled"),
    "no trigger": ({}, {"trigger": "x"}, "has no trigger/current_trigger"),
    "no device": ({}, {"which": "mpu6050"}, r"no IIO device mpu6050; .*: iio:device0 \(adxrs290\), iio:device1 \(oth"),
    "two": ({}, {"which": "other"}, "2 devices match"),
    "no machine": ({}, {"sys_root": "/nowhere"}, "the devices of this machine: none"),
    "unit of a channel": (VOLTAGE, {"channels": ["voltage0"]}, "the unit of 'voltage0' is not known"),
    "no channel": ({}, {"channels": ["accel_x"]}, "has no accel_x; its channels: anglvel_x"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_refusals(machine, case):
    files, options, words = REFUSED[case]
    machine.add_gyro(**files)
    machine.add_gyro(1, "other")
    machine.add_gyro(10, "other")
    machine.add("adxrs453", ADXRS453, 2)
    machine.add("empty", {}, 3)
    with pytest.raises(LineError, match=words):
        machine.source(**options).open()


@pytest.mark.parametrize("polled", [False, True])
def test_a_device_that_has_become_another_is_refused(machine, gyro, clock, polled):
    def make(layout):
        return machine.polled("adxrs290", clock, layout=layout) if polled else machine.source(layout=layout)

    layout = make(None).layout
    (gyro / "sampling_frequency").write_text("50")  # changes no meaning
    with make(layout) as source:
        assert source.read(0.1)[0].kind == "opened"
    (gyro / "in_anglvel_scale").write_text("0.5")
    with pytest.raises(LineError, match="have changed since"):
        make(layout).open()


@pytest.mark.parametrize("file", ["in_anglvel_mount_matrix", "in_mount_matrix", "mount_matrix"])
def test_the_mount_matrix_is_read(tmp_path, file):
    for name, text, mounts in (
        ("turned", "0, 1, 0; -1, 0, 0; 0, 0, 1", {"gyr": ((0, 1, 0), (-1, 0, 0), (0, 0, 1))}),
        ("turns nothing", "1, 0, 0; 0, 1, 0; 0, 0, 1", {}),
    ):
        (tmp_path / name).mkdir()
        machine = Machine(tmp_path / name)
        machine.add_gyro(in_accel_mount_matrix="0, 1, 0; 1, 0, 0; 0, 0, 1", **{file: text})
        assert machine.source().layout.mounts == mounts


def test_a_device_that_says_nothing_is_stalled_and_one_that_goes_is_lost_and_found_again(machine, gyro, collect):
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


def test_what_can_never_be_right_and_what_the_kernel_refuses(machine):
    for options in ({"watermark": 0}, {"watermark": 9, "length": 8}, {"rate": 0}, {"stall_periods": 0}):
        with pytest.raises(ParameterError):
            machine.source(**options)
    device = IioDevice("adxrs290", Path("/sys/bus/iio/devices/iio:device0"), Path("/dev/iio:device0"))
    words = {errno.EACCES: "udev", errno.EBUSY: "iiod", errno.ENODEV: "No such device", errno.EINVAL: "trigger="}
    for number, advice in words.items():
        what = "buffer/enable cannot be set to 1" if number == errno.EINVAL else "x"
        assert advice in refusal(device, what, OSError(number, os.strerror(number))).text


def test_polling_reads_each_channel_at_the_rate(machine, clock):
    """ADXRS453: 218166 nrad/s a count; temperature (raw + 225) × 200 m°C (Linux, drivers/iio/gyro/adxrs450.c)."""
    temperature = {"in_temp0_raw": -100, "in_temp0_scale": 200, "in_temp0_offset": 225}
    quadrature = {"in_anglvel_z_quadrature_correction_raw": 5}
    folder = machine.add("adxrs453", ADXRS453 | quadrature | temperature)
    with machine.polled("adxrs453", clock, 250.0, channels=("anglvel_z", "temp0")) as source:
        opened, start = source.read(1)[0], clock()
        first = source.read(1)[0]
        (folder / "in_anglvel_z_raw").write_text("160\n")
        second = source.read(1)[0]
    assert (opened.kind, first.t_ns - start, second.t_ns - start) == ("opened", 0, 4_000_000)
    t_ns, columns = taken_apart(source.layout, first.data + second.data)
    assert t_ns is None
    assert np.rad2deg(columns["gyr_z"]) == pytest.approx([-2.0, 2.0], rel=1e-4)
    assert columns["temp_c0"] == pytest.approx([25.0, 25.0])
    machine.add("empty", {}, 1)
    for which, words in (("x", "no IIO device"), ("empty", "channel of a known unit")):
        with pytest.raises(LineError, match=words):
            machine.polled(which, clock).open()


def test_a_sign_that_the_kernel_forgot_is_given_back_and_a_value_that_is_none_is_a_loss(machine, gyro, clock, collect):
    """Kernels before commit fde272e78e showed the ADXRS290's rates unsigned: −19999 as 45537."""
    (gyro / "in_anglvel_x_raw").write_text("45537\n")
    with machine.polled("adxrs290", clock, channels=["anglvel_x"]) as source:
        source.read(1)
        _, columns = taken_apart(source.layout, source.read(1)[0].data)
    assert columns["gyr_x"] == pytest.approx([-19999 * SCALE])
    with machine.polled("adxrs290", clock) as source:
        collect(source, lambda got: got.kinds == ["opened"])
        (gyro / "in_temp_raw").write_text("garbage\n")
        got = collect(source, lambda got: got.events)
        assert (got.kinds, "not a 32-bit number" in got.events[0].text) == (["lost"], True)
        (gyro / "in_temp_raw").write_text("7\n")
        collect(source, lambda got: got.kinds == ["reopened"] and got.data)


S16 = parse_type("le:s16/16>>0")
TIME = IioChannel("timestamp", 9, parse_type("le:s64/64>>0"))
SWAP = ((0.0, 1.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 0.0, 1.0))


def layout(*types, names=("anglvel_x", "anglvel_y", "anglvel_z", "accel_x", "accel_y"), mounts=None):
    channels = [IioChannel(name, i, parse_type(kind)) for i, (name, kind) in enumerate(zip(names, types, strict=False))]
    return IioLayout("test", tuple(channels), mounts or {})


@pytest.mark.parametrize(("text", "kind"), [
    ("le:s16/16>>0", IioType("<", True, 16, 16)),
    ("be:s12/16>>4\n", IioType(">", True, 12, 16, 1, 4)),
    ("le:u24/32>>8", IioType("<", False, 24, 32, 1, 8)),
    ("be:s12/16X2>>4", IioType(">", True, 12, 16, 2, 4)),
    ("le:s64/64", IioType("<", True, 64, 64)),
])  # fmt: skip
def test_types(text, kind):
    assert parse_type(text) == kind
    assert parse_type(str(kind)) == kind


@pytest.mark.parametrize(("types", "size"), [
    (["le:s16/16>>0"], 2),
    (["le:s16/16>>0"] * 3, 6),
    (["le:s8/8>>0", "le:s32/32>>0"], 8),  # 3 bytes before the second
    (["le:s32/32>>0", "le:s8/8>>0"], 8),  # 3 bytes after the last: iio_compute_scan_bytes, from Linux 5.5
    (["le:s8/8>>0", "le:s64/64>>0", "le:s16/16>>0"], 24),
    (["le:s16/16>>0", "le:s32/32X4>>0"], 32),  # four repeats are aligned as one
])  # fmt: skip
def test_elements_lie_at_multiples_of_their_size(types, size):
    assert layout(*types).size == size


def test_three_rates_a_temperature_and_the_time_in_the_units_of_iio():
    """ADXRS290: 87266 nrad/s and 0.1 °C a count (Linux, drivers/iio/gyro/adxrs290.c); the scan is padded to 16 bytes.
    2468, −19999 and 317 counts are 12.34 °/s, −99.995 °/s and 31.7 °C."""
    rates = [IioChannel(f"anglvel_{axis}", i, S16, scale=87266e-9) for i, axis in enumerate("xy")]
    adxrs290 = IioLayout("adxrs290", (*rates, IioChannel("temp", 2, S16, scale=100.0), TIME))
    scan = bytes.fromhex("A409 E1B1 3D01 0000") + struct.pack("<q", 1_700_000_000_123_456_789)
    columns = decoded(adxrs290, scan * 2)
    assert columns["t_ns"].tolist() == [1_700_000_000_123_456_789] * 2
    assert {"gyr_x", "gyr_y", "temp_c"} <= columns.keys()
    assert np.rad2deg(columns["gyr_x"]) == pytest.approx(12.34, rel=1e-5)  # 87266 nrad/s is 0.0049999 °/s
    assert np.rad2deg(columns["gyr_y"]) == pytest.approx(-99.995, rel=1e-5)
    assert columns["temp_c"] == pytest.approx(31.7)
    # rad/s, m/s², gauss (1 G = 100 µT), thousandths of °C; (raw + offset) × scale.
    names = ("anglvel_x", "accel_x", "magn_x", "temp")
    channels = tuple(IioChannel(name, i, S16, scale=0.5, offset=-2.0) for i, name in enumerate(names))
    columns = decoded(IioLayout("all", channels), struct.pack("<4h", 6, 6, 6, 6))
    for name, value in {"gyr_x": 2.0, "acc_x": 2.0, "mag_x": 200.0, "temp_c": 0.002}.items():
        assert columns[name].tolist() == [pytest.approx(value)]


@given(order=st.sampled_from("<>"), signed=st.booleans(), storage=st.sampled_from([8, 16, 32, 64]), data=st.data())
def test_every_number_comes_back(order, signed, storage, data):
    """Whatever the bits around it are."""
    bits = data.draw(st.integers(1, min(storage, 52)))  # more would not fit into a float
    shift = data.draw(st.integers(0, storage - bits))
    low, high = (-(1 << bits - 1), (1 << bits - 1) - 1) if signed else (0, (1 << bits) - 1)
    values = data.draw(st.lists(st.integers(low, high), min_size=1, max_size=5))
    junk = data.draw(st.integers(0, 2**storage - 1)) & ~(((1 << bits) - 1) << shift)
    words = [((value & ((1 << bits) - 1)) << shift) | junk for value in values]
    raw = struct.pack(f"{order}{len(words)}{'BHIQ'[(8, 16, 32, 64).index(storage)]}", *words)
    kind = parse_type(f"{'le' if order == '<' else 'be'}:{'s' if signed else 'u'}{bits}/{storage}>>{shift}")
    columns = decoded(IioLayout("x", (IioChannel("accel_x", 0, kind),)), raw)
    assert columns["acc_x"].tolist() == values


def test_a_mount_matrix_turns_the_chips_axes_into_the_boards():
    """v_board = M v_chip: here the board's x is the chip's y, and its y the chip's −x."""
    columns = decoded(layout(*["le:s16/16>>0"] * 4, mounts={"gyr": SWAP}), struct.pack("<4h", 1, 2, 3, 4))
    assert [columns[name].item() for name in ("gyr_x", "gyr_y", "gyr_z", "acc_x")] == [2.0, -1.0, 3.0, 4.0]
    columns = decoded(layout(*["le:s16/16>>0"] * 2, mounts={"gyr": SWAP, "mag": SWAP}), struct.pack("<2h", 1, 2))
    assert [columns[name].item() for name in ("gyr_x", "gyr_y")] == [2.0, -1.0]
    with pytest.raises(ParameterError, match="mixes axes that are not all enabled"):
        layout("le:s16/16>>0", mounts={"gyr": ((0.8, 0.6, 0.0), (-0.6, 0.8, 0.0), (0.0, 0.0, 1.0))})


def test_what_can_be_no_type_and_no_layout():
    for text in ("", "le:s16", "xe:s16/16>>0", "le:f32/32>>0", "le:s12/12>>0", "le:s14/16>>4", "le:s0/8"):
        with pytest.raises(ParameterError):
            parse_type(text)
    with pytest.raises(ParameterError):
        IioLayout("x", ())
    with pytest.raises(UnitError, match="voltage0"):
        IioLayout("x", (IioChannel("voltage0", 0, S16),))


def test_a_layout_goes_into_a_recording_and_comes_back():
    first = layout("be:s12/16>>4", "le:s32/32X4>>0", "le:s16/16>>0", mounts={"gyr": SWAP})
    assert IioLayout.from_json(first.to_json()) == first
    assert "\n" not in first.to_json()
    for text in ("", "[]", "{}", '{"device": "x", "channels": [{"name": "accel_x"}], "mounts": {}}', "null"):
        with pytest.raises(DecodeError):
            IioLayout.from_json(text)


@pytest.mark.parametrize(
    ("good", "bad"),
    [
        ('"scale": 1.0', '"scale": "x"'), ('"scale": 1.0', f'"scale": {"9" * 400}'), ('"scale": 1.0', '"scale": NaN'),
        ('"index": 0', '"index": "0"'), ('"clock": ""', '"clock": 5'), ('"device": "x"', '"device": 5'),
        ('"mounts": {}', '"mounts": {"gyr": [["a"]]}'), ('"mounts": {}', '"mounts": {"gyr": [[1, 0], [0, 1]]}'),
        ('"mounts": {}', '"mounts": {"gyr": ' + "[" * 200_000),
    ],
)  # fmt: skip
def test_a_layout_with_something_else_in_it_is_told(good, bad):
    text = IioLayout("x", (IioChannel("temp", 0, S16),)).to_json()
    assert good in text
    with pytest.raises(DecodeError, match="layout of IIO scans"):
        IioLayout.from_json(text.replace(good, bad))
