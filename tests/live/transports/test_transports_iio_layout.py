"""Scans of IIO devices in bytes and numbers. Facts: Linux, Documentation/ABI/testing/sysfs-bus-iio."""

import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from plumbob.core.errors import DecodeError, ParameterError, UnitError
from plumbob.live.transports.iio_layout import IioChannel, IioLayout, IioType, parse_type
from tests.helpers.iio_tree import decoded

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
