"""Exports of MT Manager, written by hand in the form of OpenSim's example and of MT Manager 2022, and MTB logs.

Packets of MTB were recorded with MT Manager, or are written by hand from the protocol. The recorded ones and the values
beside them are those of 'XSens Golden Packets' (a public file of packets of an MTi-300 that MT Manager recorded and
decoded); fixed-point numbers are those of einride/xsens-go, fixedpoint_test.go.
"""

import struct

import numpy as np
import pytest

from plumbob import Frame, North, flags
from plumbob.core.errors import ClockError, DecodeError, ParameterError
from plumbob.files import read
from plumbob.rotations import quat_from_dcm
from tests.helpers.file_kinds import NEW, OLD, SENSORS, export, xbus_block, xbus_floats, xbus_message
from tests.helpers.io_samples import refused

# the row in opensim-core's testXsensDataReader.cpp, of sensor 00B421AF
VALUES = [3.030769, 5.254238, -7.714005, 0.005991, -0.032133, 0.022713, -0.045410, -0.266113, 0.897217]
MATRIX = [f"Mat[{row}][{column}]" for column in (1, 2, 3) for row in (1, 2, 3)]
TURN = [0.609684, 0.730843, 0.306845, 0.519480, -0.660808, 0.541732, 0.598686, -0.170885, -0.782543]


@pytest.mark.parametrize("separator", ["\t", ",", ";"])
def test_counter_and_declared_rate_with_a_wrap_and_a_lost_packet(tmp_path, separator):
    counts = [(65530 + i) % 65536 for i in range(20) if i != 12]
    rows = [[f"{count:05d}", "", *VALUES, *TURN] for count in counts]
    path = export(tmp_path / "a.txt", OLD, ["PacketCounter", "SampleTimeFine", *SENSORS, *MATRIX], rows, separator)
    recording = read(path)
    imu = recording.imu
    np.testing.assert_allclose(imu.t, [i / 100 for i in range(20) if i != 12], atol=1e-9)
    np.testing.assert_allclose(imu.acc[0], VALUES[:3])
    np.testing.assert_allclose(imu.gyr[0], VALUES[3:6])
    np.testing.assert_allclose(imu.mag[0], np.array(VALUES[6:9]) * 50.0)  # a.u., of a nominal field of 50 µT
    assert imu.meta.rate_nominal == 100.0
    assert recording.track is None  # the old head does not say the frame
    told = " ".join(map(str, recording.notes))
    assert "leaves out 1 packet" in told and "the file does not say its frame" in told and "arbitrary units" in told


def test_sample_time_fine_counts_tenths_of_milliseconds_and_wraps(tmp_path):
    ticks = [(2**32 - 500 + 100 * i) % 2**32 for i in range(20)]
    rows = [[i, tick, *VALUES, *TURN] for i, tick in enumerate(ticks)]
    columns = ["PacketCounter", "SampleTimeFine", *SENSORS, *MATRIX]
    recording = read(export(tmp_path / "a.txt", NEW, columns, rows))
    np.testing.assert_allclose(recording.imu.t, np.arange(20) / 100, atol=1e-9)
    assert recording.imu.meta.device == "MTW2-3A7G6 00B4D6D1"
    track = recording.track
    assert track.frame is Frame.ENU
    # columns of the file run down the columns of the matrix, which turns sensor to ENU
    dcm = np.array(TURN).reshape(3, 3).T
    np.testing.assert_allclose(track.q_nb[3], quat_from_dcm(dcm, tolerance=1e-4), atol=1e-9)
    up = dcm @ VALUES[:3]
    assert up[2] > 9.5  # the specific force of that row points up, as of a sensor nearly at rest


def test_quaternions_first_and_start_in_utc(tmp_path):
    columns = ["PacketCounter", *SENSORS, "Quat_q0", "Quat_q1", "Quat_q2", "Quat_q3", "Roll", "Pitch", "Yaw"]
    rows = [[i, *VALUES, 0.5, -0.5, 0.5, 0.5, 1, 2, 3] for i in range(10)]
    track = read(export(tmp_path / "a.txt", OLD + "// Coordinate system: NED\n", columns, rows)).track
    assert track.frame is Frame.NED
    np.testing.assert_array_equal(track.q_nb, np.tile([0.5, -0.5, 0.5, 0.5], (10, 1)))
    utc = ["UTC_Nano", "UTC_Year", "UTC_Month", "UTC_Day", "UTC_Hour", "UTC_Minute", "UTC_Second", "UTC_Valid"]
    rows = [[i, 100 * i, 250_000_000, 2024, 5, 1, 12, 30, 5 + i, 7, *VALUES] for i in range(10)]
    imu = read(export(tmp_path / "a.txt", NEW, ["PacketCounter", "SampleTimeFine", *utc, *SENSORS], rows)).imu
    assert imu.meta.t0_ns == 1_714_566_605_250_000_000  # date -u -d '2024-05-01 12:30:05.25' +%s%N


def test_an_attitude_alone_is_a_track(tmp_path):
    """As OpenSense takes it; the file must say the frame."""
    table = [[i, *TURN] for i in range(10)]
    path = export(tmp_path / "a.txt", OLD + "// Coordinate system: ENU\n", ["PacketCounter", *MATRIX], table)
    recording = read(path)
    assert recording.imu is None
    assert recording.track.t == pytest.approx(np.arange(10) / 100.0)
    dcm = np.array(TURN).reshape(3, 3).T
    np.testing.assert_allclose(recording.track.q_nb[3], quat_from_dcm(dcm, tolerance=1e-4), atol=1e-9)
    refused(read, export(tmp_path / "b.txt", OLD, ["PacketCounter", *MATRIX], table), match="does not say its frame")


def test_increments_stand_for_rates_and_accelerations(tmp_path):
    """A turn of 0.02 rad about z in each sample of 10 ms, and gravity along z with 1 m/s² along x when it begins."""
    columns = [
        "PacketCounter",
        "SampleTimeFine",
        *(f"VelInc_{axis}" for axis in "XYZ"),
        *(f"OriInc_q{k}" for k in range(4)),
    ]
    row = [0.01, 0.0, 0.0981, np.cos(0.01), 0.0, 0.0, np.sin(0.01)]
    recording = read(export(tmp_path / "a.txt", NEW, columns, [[i, 100 * i, *row] for i in range(10)]))
    np.testing.assert_allclose(recording.imu.gyr, [[0.0, 0.0, 2.0]] * 10, atol=1e-12)
    # seen from axes that have turned left by 0.02 rad, what lay along x lies 0.02 rad to the right
    np.testing.assert_allclose(recording.imu.acc, [[np.cos(0.02), -np.sin(0.02), 9.81]] * 10, atol=1e-12)
    path = export(tmp_path / "b.txt", NEW, columns[:5], [[i, 100 * i, *row[:3]] for i in range(10)])
    recording = read(path)
    np.testing.assert_allclose(recording.imu.acc, [[1.0, 0.0, 9.81]] * 10, atol=1e-12)
    assert any("in the axes at its beginning, as no rate is known" in str(note) for note in recording.notes)
    with pytest.raises(ParameterError, match="holds one unit without a name"):
        read(path, unit="2")


COUNTED, TIMED = ["PacketCounter", *SENSORS], ["PacketCounter", "SampleTimeFine", *SENSORS]
REFUSED = [
    (NEW, COUNTED, [[1, *VALUES]] * 5, "add that line"),
    (OLD, TIMED, [[1, "x", *VALUES]] * 5, "line 6, column 'Sample"),
    (OLD, COUNTED, [[1.5, *VALUES]] * 5, "time: PacketCounter has cells that are not whole numbers below 65536"),
    (OLD, COUNTED, [["", *VALUES]] * 5, "neither SampleTimeFine nor"),
    (OLD, COUNTED, [[7, *VALUES]] * 5, "all 5 time stamps are 0", ClockError),
    # microseconds, as Xsens DOT has them
    (OLD, TIMED, [[i, 10_000 * i, *VALUES] for i in range(10)], "100 Hz", ClockError),
]


@pytest.mark.parametrize("case", REFUSED, ids=range(len(REFUSED)))
def test_what_has_no_time_is_refused(tmp_path, case):
    head, columns, rows, match, error = (*case, DecodeError)[:5]
    refused(read, export(tmp_path / "a.txt", head, columns, rows), match=match, error=error, name="a.txt")


NO_MAG = (  # example 3: the shortest with all inertial blocks
    "10 20 02 8D 90 10 60 04 00 54 DB F1 20 10 10 3F 7F 89 11 BC 11 1D FA 3B A0 CE F0 BD 73 25 73 40 20 0C BD DC F9 D0 "
    "BE 3C 86 19 41 1D 0B 47 40 10 0C B9 8D B0 00 B9 F1 48 00 3C C9 04 30 40 30 0C BC B9 89 2E BB 09 8C 00 3C A7 08 00 "
    "80 20 0C BA 63 BC 01 BC 04 D6 3F BB 6D E3 FE 80 30 10 3F 80 00 01 B5 91 C0 00 B7 2A 08 00 B6 98 40 00 E0 20 04 00 "
    "40 00 03"
)
WARM = (  # example 4: temperature and magnetic field
    "10 20 02 91 8D 10 60 04 01 36 3F A6 20 10 10 3F 35 E0 42 3F 31 CD 15 BD 9F 49 DB BD A9 38 CF 40 20 0C BD 63 5A 90 "
    "41 1D 08 D4 3E 5F AA 50 40 10 0C B9 11 68 00 3C C9 01 00 3A 0F 7D 00 40 30 0C BC 3B 29 80 3C 35 FC 00 3C A4 6E 00 "
    "80 20 0C 3C AE A2 41 BB 56 D8 00 BA D5 AC 01 80 30 10 3F 80 00 00 37 DF 88 01 B6 89 80 00 B6 08 C0 00 C0 20 0C BE "
    "FB FB F2 3F 33 C4 85 BF A0 A2 C1 08 10 04 42 16 80 00 30 10 04 00 01 86 E1 E0 20 04 00 40 00 03"
)
SHAKEN = (  # example 5: a shake, whose status says which axes were at the end of their range
    "10 20 02 FB 85 10 60 04 01 A4 98 DE 20 10 10 3F 2A 14 63 BE D7 EF A7 3C DE E5 08 3F 1D CE C9 40 20 0C C1 F2 46 C3 "
    "C1 EC E0 76 C2 8F 85 3F 40 10 0C BD 93 2C CC BD 92 0A 16 BE 3A 6E EC 40 30 0C 42 51 94 64 C2 7B 5A 5A C1 CC C0 AE "
    "80 20 0C 40 85 4D 6D C1 25 55 9E C0 90 8E 1F 80 30 10 3F 7F F8 98 3B AA 9E E5 BC 53 9E C0 BB B9 06 0C C0 20 0C 3E "
    "DC 74 39 BE 75 2B 48 3F AF 9A 3F 30 10 04 00 01 86 DE E0 20 04 00 48 14 01"
)
CONFIGURATION = (  # of the same unit: 037003F8, 1152 / 115200 s, no OutputMode
    "03 70 03 F8 04 80 00 00" + " 00" * 88 + " 00 01 03 70 03 F8 00 00 00 00 00 00 00 01 00 27 01 08 02 49 05 01"
)


def packet(i, *blocks, step=100, bus=0xFF):
    head = xbus_block(0x1020, struct.pack(">H", i % 65536)) + xbus_block(
        0x1060, struct.pack(">I", (4 * 10**9 + step * i) % 2**32)
    )
    return xbus_message(0x36, head + b"".join(blocks), bus)


def plain(count=20, **how):
    return b"".join(
        packet(i, xbus_floats(0x8020, 0.1 * i, 0.2, 0.3), xbus_floats(0x4020, 1.0, 2.0, 9.0), **how)
        for i in range(count)
    )


def log(path, *parts):
    path.write_bytes(b"".join(parts))
    return path


def golden(hexes, ticks):
    """Copies of a recorded packet at other times, as one alone has no step."""
    data = bytearray.fromhex(hexes)
    packets = []
    for i in range(3):
        data[5:12] = b"\x10\x60\x04" + struct.pack(">I", ticks + 25 * i)
        data[3:5] = struct.pack(">H", i)
        packets.append(xbus_message(0x36, bytes(data)))
    return b"".join(packets)


def test_recorded_packets_have_the_values_that_mt_manager_gives(tmp_path):
    path = log(tmp_path / "a.mtb", xbus_message(0x0D, bytes.fromhex(CONFIGURATION)), golden(WARM, 20_332_454))
    recording = read(path)
    imu, track = recording.imu, recording.track
    np.testing.assert_allclose(imu.gyr[0], [0.02131760, -0.00327826, -0.00163019], atol=5e-9)
    np.testing.assert_allclose(imu.acc[0], [-0.05550629, 9.81465530, 0.21842313], atol=5e-9)
    np.testing.assert_allclose(imu.mag[0] / 50.0, [-0.49215657, 0.70221740, -1.25496686], atol=5e-9)
    assert imu.temp_c[0] == 37.625
    np.testing.assert_allclose(imu.t, [0.0, 0.0025, 0.005], atol=1e-12)  # the unit was set to 400 Hz
    np.testing.assert_allclose(track.q_nb[0], [0.71045315, 0.69453555, -0.07777759, -0.08262789], atol=5e-9)
    assert track.frame is Frame.ENU and track.north is North.MAGNETIC
    assert imu.meta.device == "Xsens 037003F8"
    said = " ".join(map(str, recording.notes))
    assert "left out: pressure (3010), velocity increments (4010), FreeAcceleration (4030)" in said
    assert "ticks of 0.1 ms" in said and "damage" not in said and "cut" not in said


def test_the_status_of_a_recorded_shake_says_which_sensors_were_out_of_range(tmp_path):
    imu = read(log(tmp_path / "a.mtb", golden(SHAKEN, 27_564_254))).imu
    np.testing.assert_allclose(imu.gyr[0], [4.16570139, -10.33340263, -4.51734877], atol=5e-9)
    # 00000000010010000001010000000001: z of the accelerometer (bit 10), y of the gyroscope (12), and any (19)
    assert imu.flags[0] & (flags.ACC_CLIPPED | flags.GYR_CLIPPED | flags.MAG_CLIPPED) == (
        flags.ACC_CLIPPED | flags.GYR_CLIPPED
    )


@pytest.mark.parametrize("hexes", [NO_MAG, WARM, SHAKEN])
def test_increments_alone_give_the_rates_that_the_unit_sent_beside_them(tmp_path, hexes):
    whole = bytes.fromhex(hexes)
    kept, rates = {0x1020: b"", 0x1060: b"", 0x8030: b"", 0x4010: b""}, {}
    at = 0
    while at < len(whole):
        identity, size = struct.unpack_from(">HB", whole, at)
        (kept if identity in kept else rates)[identity] = whole[at + 3 : at + 3 + size]
        at += 3 + size
    packets = [packet(i, *(xbus_block(k, kept[k]) for k in (0x8030, 0x4010)), step=25) for i in range(4) if i != 2]
    recording = read(log(tmp_path / "a.mtb", *packets))
    # float32 of a quaternion near (1, 0, 0, 0) leaves 3e-8 rad in 2.5 ms; the lost packet does not halve the rate
    np.testing.assert_allclose(recording.imu.gyr[0], struct.unpack(">3f", rates[0x8020]), rtol=2e-5, atol=3e-8 / 0.0025)
    np.testing.assert_allclose(recording.imu.acc, [struct.unpack(">3f", rates[0x4020])] * 3, rtol=1e-5, atol=5e-6)
    said = " ".join(map(str, recording.notes))
    assert "orientation increments (OriInc) over samples of 0.0025 s" in said
    assert "PacketCounter leaves out 1 packet" in said


def precise(precision, values):
    if precision == 1:
        return struct.pack(">3i", *(round(value * 2**20) for value in values))
    if precision == 2:
        whole = [round(value * 2**32) for value in values]
        return b"".join(struct.pack(">Ih", value & 0xFFFFFFFF, value >> 32) for value in whole)
    return struct.pack(">3d" if precision == 3 else ">3f", *values)


@pytest.mark.parametrize("precision", [0, 1, 2, 3])
def test_every_precision(tmp_path, precision):
    gyr, acc = (0.25, -1.5, 3.125), (-0.0078125, 9.75, -20.5)
    blocks = [
        xbus_block(identity | precision, precise(precision, one)) for identity, one in ((0x8020, gyr), (0x4020, acc))
    ]
    imu = read(log(tmp_path / "a.mtb", *(packet(i, *blocks) for i in range(5)))).imu
    np.testing.assert_allclose(imu.gyr, [gyr] * 5, atol=1e-9)
    np.testing.assert_allclose(imu.acc, [acc] * 5, atol=1e-9)


def test_fixed_point_numbers_of_another_program(tmp_path):
    part = bytes.fromhex("ADF052980039 E1F589E9000B F63FCAF0FFFF".replace(" ", ""))
    field = bytes.fromhex("039ADF03 00BE1F81 00000000".replace(" ", ""))
    packets = [
        packet(i, xbus_block(0x4022, part), xbus_floats(0x8020, 0, 0, 0), xbus_block(0xC021, field)) for i in range(3)
    ]
    imu = read(log(tmp_path / "a.mtb", *packets)).imu
    np.testing.assert_allclose(
        imu.acc[0], [57.67944828234613, 11.882652873406187, -0.038089100271463394], rtol=0, atol=1e-15
    )
    np.testing.assert_allclose(imu.mag[0], np.multiply([57.67944622039795, 11.882691383361816, 0.0], 50.0), rtol=1e-15)


@pytest.mark.parametrize(("digit", "frame"), [(0x0, Frame.ENU), (0x4, Frame.NED), (0x8, Frame.NWU)])
def test_attitudes_of_every_kind_and_frame(tmp_path, digit, frame):
    """A yaw of 90°, a pitch of 0, a roll of 90°: x to y, y to z, z to x, so q = (1, 1, 1, 1) / 2."""
    rate = xbus_floats(0x8020, 0, 0, 0)
    kinds = {
        0x2010: (0.5, 0.5, 0.5, 0.5),
        0x2020: (0, 1, 0, 0, 0, 1, 1, 0, 0),  # column by column: the images of x, y and z
        0x2030: (90, 0, 90),  # roll, pitch, yaw
    }
    for identity, values in kinds.items():
        packets = (packet(i, rate, xbus_floats(identity | digit, *values)) for i in range(3))
        track = read(log(tmp_path / "a.mtb", *packets)).track
        assert track.frame is frame
        np.testing.assert_allclose(track.q_nb, [[0.5] * 4] * 3, atol=1e-6)


def test_blocks_of_several_rates_keep_their_own_times(tmp_path):
    slow = xbus_floats(0x4020, 0, 0, 9.8)
    packets = [
        packet(i, *([xbus_floats(0x8040, 0.01 * i, 0, 0)] if i % 2 else [slow, xbus_floats(0xC020, i, 0, 0)]), step=10)
        for i in range(40)
    ]
    imu = read(log(tmp_path / "a.mtb", *packets)).imu
    assert len(imu) == 20
    np.testing.assert_allclose(imu.gyr[:, 0], 0.01 * np.arange(1, 40, 2), atol=1e-7)
    np.testing.assert_allclose(imu.t, np.arange(20) * 0.002, atol=1e-12)
    # at 1, 3, … ms lies the mean of the fields at 0, 2, 4, … ms; the last has no neighbour behind it
    np.testing.assert_allclose(imu.mag[:-1, 0], 50.0 * np.arange(1, 39, 2), rtol=1e-6)


def test_a_slow_magnetometer_in_the_same_packets_is_not_interpolated(tmp_path):
    rate, mag = xbus_floats(0x8020, 0, 0, 0), [xbus_floats(0xC020, i, 0, 0) for i in range(20)]
    packets = [packet(i, rate, *([] if i % 2 else [mag[i]])) for i in range(20)]
    found = read(log(tmp_path / "a.mtb", *packets)).imu.mag
    np.testing.assert_allclose(found[::2, 0], 50.0 * np.arange(0, 20, 2))
    assert np.isnan(found[1::2]).all()


def test_utc_counts_where_it_is_valid(tmp_path):
    def utc(second, valid):
        return xbus_block(0x1010, struct.pack(">IH6B", 250_000_000, 2024, 5, 1, 12, 30, second, valid))

    rate = xbus_floats(0x8020, 0, 0, 0)
    packets = [packet(i, utc(5 + i, 7 if i else 3), rate, step=10_000) for i in range(3)]
    assert read(log(tmp_path / "a.mtb", *packets)).imu.meta.t0_ns == 1_714_566_605_250_000_000
    recording = read(log(tmp_path / "a.mtb", *(packet(i, utc(i, 0), rate) for i in range(3))))
    assert recording.imu.meta.t0_ns == 0 and any("UTC: not known" in str(note) for note in recording.notes)


def test_time_wraps_or_is_counted_by_the_declared_rate(tmp_path):
    start = 2**32 - 4 * 10**9  # ticks until the count begins again
    packets = [packet(start // 100 - 5 + i, xbus_floats(0x8020, 0, 0, 0)) for i in range(12)]
    np.testing.assert_allclose(read(log(tmp_path / "a.mtb", *packets)).imu.t, np.arange(12) / 100, atol=1e-9)
    settings = xbus_message(0xC1, bytes.fromhex("1020FFFF 80200032 C0200019".replace(" ", "")))
    imu = read(log(tmp_path / "a.mtb", settings, *(counted(i) for i in (65534, 65535, 0, 2)))).imu
    np.testing.assert_allclose(imu.t, [0, 0.02, 0.04, 0.08], atol=1e-9)


def counted(i):
    return xbus_message(0x36, xbus_block(0x1020, struct.pack(">H", i)) + xbus_floats(0x8020, 0, 0, 0))


def several(count=3):
    devices = b"".join(bytes.fromhex(f"00B4210{k}") + bytes(16) for k in range(count))
    return xbus_message(0x0D, bytes.fromhex("00200457") + bytes(92) + struct.pack(">H", count) + devices)


def test_of_several_units_one_is_chosen(tmp_path):
    packets = [packet(i, xbus_floats(0x8020, bus, 0, 0), bus=bus) for i in range(5) for bus in (1, 2, 3)]
    path = log(tmp_path / "awinda.mtb", several(), *packets)
    recording = read(path)
    assert recording.imu.meta.device == "Xsens 00B42100" and recording.imu.gyr[0, 0] == 1.0
    assert any("not taken: 00B42101 (5), 00B42102 (5); --unit 00B42101" in str(note) for note in recording.notes)
    assert read(path, unit="00b42102").imu.gyr[0, 0] == 3.0
    assert read(path, unit="2").imu.gyr[0, 0] == 2.0
    refused(read, path, unit="4", match=r"there are 00B42100 \(1\), 00B42101 \(2\)", error=ParameterError)


def test_what_a_unit_says_of_itself(tmp_path):
    said = xbus_message(0x01, bytes.fromhex("037003F8")) + xbus_message(0x1D, b"MTi-300-2A5G4      ")
    path = log(tmp_path / "a.mtb", said, plain())
    assert read(path).imu.meta.device == "MTi-300-2A5G4 037003F8"
    assert read(path, unit="037003f8").imu is not None
    configuration = bytearray.fromhex(CONFIGURATION)
    configuration[32:46] = b"MTi-300-2A5G4 "
    path = log(tmp_path / "a.mtb", xbus_message(0x0D, configuration), plain())
    assert read(path).imu.meta.device == "MTi-300-2A5G4 037003F8"
    said = xbus_message(0x01, bytes.fromhex("0000008000ABCDEF"))  # 64 bits of the fifth generation
    assert read(log(tmp_path / "a.mtb", said, plain())).imu.meta.device == "Xsens 8000ABCDEF"
    assert read(log(tmp_path / "a.mtb", plain())).imu.meta.device == "Xsens"


OLDER = [xbus_message(0x32, bytes(38))] * 3


@pytest.mark.parametrize(
    ("parts", "match"),
    [
        ([packet(i, xbus_block(0xC810, bytes(20))) for i in range(3)], r"Awinda snapshots \(C810\); only Xsens"),
        ([b"PacketCounter;Acc_X\n" * 20], "no message of the Xbus"),
        ([several()], r"1 message, but no data.*: 0D\."),
        (OLDER, "Configuration gives, but that is not in the log"),
        ([several(), *OLDER], "lists 3 units"),
        ([several(1), *OLDER], "make 0"),
        ([counted(i) for i in range(5)], "its time is not known"),
    ],
)
def test_what_only_xsens_takes_apart_is_refused_with_a_word(tmp_path, parts, match):
    refused(read, log(tmp_path / "a.mtb", *parts), match=match, name="a.mtb")


SENSED = (1, 2, 9, 0.1, 0.2, 0.3)
MODES = [
    # OutputMode, OutputSettings, data of a packet besides the counter: the order is that of MT0101P, MTData
    (0x0002, 0x0000_0001, struct.pack(">9f", *SENSED, 0.4, 0.5, 0.6)),
    (0x0807, 0x0000_0001, struct.pack(">14fB", 21, *SENSED, 0.4, 0.5, 0.6, *[0.5] * 4, 1)),
    (0x0006, 0x8000_0045, struct.pack(">9f", *SENSED, 90, 0, 90)),
    (0x0006, 0x0000_0309, struct.pack(">18d", *SENSED, 0.4, 0.5, 0.6, 0, 1, 0, 0, 0, 1, 1, 0, 0)),
    (0x102E, 0x0000_0401, bytes(44) + struct.pack(">13f", *SENSED, 0, 0, 0, *[0.5] * 4) + bytes(14)),
]


@pytest.mark.parametrize(("mode", "settings", "body"), MODES)
def test_packets_of_older_units_by_their_settings(tmp_path, mode, settings, body):
    device = struct.pack(">IHHI8x", 0x00300123, len(body) + 2, mode, settings)
    configuration = bytes.fromhex("00300123 0480 0001".replace(" ", "")) + bytes(88) + b"\0\1" + device
    packets = [xbus_message(0x32, body + struct.pack(">H", i)) for i in range(5)]
    recording = read(log(tmp_path / "mti.mtb", xbus_message(0x0D, configuration), *packets, xbus_message(0x32, b"odd")))
    imu, track = recording.imu, recording.track
    np.testing.assert_allclose(imu.acc, [[1, 2, 9]] * 5)
    np.testing.assert_allclose(imu.gyr, [[0.1, 0.2, 0.3]] * 5, rtol=1e-6)
    np.testing.assert_allclose(imu.t, np.arange(5) * 0.02, atol=1e-9)  # 1152 / 115200 s, one of two is sent
    assert imu.meta.rate_nominal == 50.0
    if mode & 4:
        assert track.frame is (Frame.NED if settings & 0x8000_0000 else Frame.NWU)
        np.testing.assert_allclose(track.q_nb, [[0.5] * 4] * 5, atol=1e-6)
    assert any("1 packet left out, not of the" in str(note) for note in recording.notes)


def test_older_units_may_leave_a_sensor_out(tmp_path):
    for settings, held in ((0x11, "gyr mag"), (0x21, "acc mag"), (0x41, "gyr acc"), (0x51, "gyr")):
        values = {"acc": (1, 2, 9), "gyr": (0.25, 0.5, 1.0), "mag": (0.5, 0.5, 0.5)}
        body = b"".join(struct.pack(">3f", *values[kind]) for kind in ("acc", "gyr", "mag") if kind in held)
        device = struct.pack(">IHHI8x", 0x00300123, len(body) + 2, 2, settings)
        configuration = bytes.fromhex("00300123 0480 0000".replace(" ", "")) + bytes(88) + b"\0\1" + device
        packets = [xbus_message(0x32, body + struct.pack(">H", i)) for i in range(3)]
        imu = read(log(tmp_path / "mti.mtb", xbus_message(0x0D, configuration), *packets)).imu
        assert {*imu.triads} == {*held.split()}
        if "gyr" in held:
            np.testing.assert_allclose(imu.gyr, [values["gyr"]] * 3)
        if "mag" in held:
            np.testing.assert_allclose(imu.mag, [[25.0] * 3] * 3)


def test_junk_bad_checksums_and_cut_ends_are_counted(tmp_path):
    raw, one = plain(), len(packet(0, xbus_floats(0x8020, 0, 0, 0), xbus_floats(0x4020, 0, 0, 0)))
    damaged = bytearray(raw)
    damaged[3 * one + 20] ^= 0x40
    # in damage, no message follows one that fits by chance
    chance = b"\0" + packet(99, xbus_floats(0x8020, 9, 9, 9)) + b"\0"
    path = log(
        tmp_path / "a.mtb", b"\xfajunk", damaged[: 7 * one], b"\xfa\xff\x36\xff" * 5, chance, damaged[7 * one : -4]
    )
    recording = read(path)
    assert len(recording.imu) == 18
    said = " ".join(map(str, recording.notes))
    assert f"damage: {5 + one + 20 + len(chance)} bytes skipped" in said
    assert f"cut: the file ends within a message, {one - 4} bytes left out" in said
    assert "PacketCounter leaves out 1 packet" in said


def test_long_messages_and_blocks_that_lie(tmp_path):
    blocks = [xbus_block(0x7020, bytes(200)), xbus_block(0x7010, bytes(94)), xbus_floats(0x8020, 1, 2, 3)]
    imu = read(log(tmp_path / "a.mtb", *(packet(i, *blocks) for i in range(3)))).imu
    np.testing.assert_allclose(imu.gyr, [[1, 2, 3]] * 3)
    lie = xbus_message(0x36, struct.pack(">HB", 0x8020, 200) + bytes(12))
    recording = read(log(tmp_path / "a.mtb", plain(), lie, packet(20, xbus_floats(0x8020, 1, 2))))
    assert len(recording.imu) == 20
    said = " ".join(map(str, recording.notes))
    assert "damage: 1 packet left out, whose blocks do not fill them" in said
    assert "damage: blocks left out that have a wrong size: rate of turn (8020)" in said
    rng = np.random.default_rng(5)
    packets = [packet(i, *(xbus_block(int(k), b"") for k in rng.integers(1, 2**16, 8))) for i in range(2000)]
    recording = read(log(tmp_path / "a.mtb", plain(5), *packets))
    assert len(recording.imu) == 5
    assert any(f"{2000 - 63} packets left out" in str(note) for note in recording.notes)  # with the five, 64 layouts
