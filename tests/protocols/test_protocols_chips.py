"""Emulated chips: what a bus master sees, and the behaviours that are easy to forget, each as its source has it."""

import math

import numpy as np
import pytest

from plumbob.core import flags
from plumbob.core.errors import ShapeError
from plumbob.core.units import g, gauss
from plumbob.protocols import catalog
from plumbob.protocols.decode import decode
from tests.helpers.chips import (
    Adis16355,
    Adxrs290,
    Adxrs453,
    Hmc5983,
    Mpu3050,
    Mpu6000,
    words_adis16355,
    words_adxrs453,
)
from tests.helpers.chips.fifo import fifo_format
from tests.helpers.chips.words_adxrs453 import Fault, read_command, sensor_command

MS = 1_000_000
DEG = math.pi / 180


def decoded(form, data):
    """Columns of the only message."""
    ((_, frames),) = decode(data, form)[0].items()
    return frames.columns


# --- ADXRS453 ---


def running():
    """ADXRS453 long after its start, with an empty pipeline."""
    chip = Adxrs453()
    chip.sample({"gyr.z": 0.0, "temp_c": 25.0}, 1000 * MS)
    chip.transfer(sensor_command())
    return chip


def test_adxrs453_start_up_as_in_the_data_sheet():
    """DS-453, table of the start-up: CHK at 100 ms, then requests at 150 and 200 ms, the last one twice."""
    chip = Adxrs453()
    chip.sample({"gyr.z": 0.5}, 100 * MS)
    assert chip.transfer(bytes.fromhex("20000003")) == bytes.fromhex("00000001")
    chip.sample({"gyr.z": 0.5}, 150 * MS)
    chip.transfer(bytes.fromhex("20000000"))  # to be discarded
    chip.sample({"gyr.z": 0.5}, 200 * MS)
    for _ in range(2):
        reply = chip.transfer(bytes.fromhex("20000000"))
        found = decoded(chip.form, reply)
        assert (found["st"][0], found["faults"][0]) == (2, 127)
        assert reply[3] in (0xFE, 0xFF)
    chip.sample({"gyr.z": 0.5}, 250 * MS)
    chip.transfer(sensor_command())
    found = decoded(chip.form, chip.transfer(sensor_command()))
    assert (found["st"][0], found["faults"][0]) == (1, 0)
    assert found["gyr.z"][0] == pytest.approx(0.5, abs=DEG / 160)


def test_adxrs453_rate_is_not_valid_before_100_ms():
    chip = Adxrs453()
    chip.sample({"gyr.z": 0.0}, 99 * MS)
    chip.transfer(sensor_command())
    assert decoded(chip.form, chip.transfer(sensor_command()))["st"][0] == 0


def test_adxrs453_reply_is_one_frame_late_and_latched_with_its_command():
    chip = running()
    chip.sample({"gyr.z": 2 * DEG}, 1010 * MS)
    chip.transfer(sensor_command())
    chip.sample({"gyr.z": -2 * DEG}, 1020 * MS)
    assert chip.transfer(sensor_command()) == bytes.fromhex("14028001")
    assert chip.transfer(sensor_command()) == bytes.fromhex("17FD8001")


def test_adxrs453_repeats_the_sequence_number():
    chip = running()
    replies = [chip.transfer(sensor_command(sq)) for sq in (*range(8), 0)][1:]
    assert [decoded(chip.form, r)["sq"][0] for r in replies] == list(range(8))


def test_adxrs453_faults_stay_until_they_are_read():
    chip = running()
    chip.faults = Fault.CST
    chip.transfer(sensor_command())
    chip.faults = Fault(0)
    told = [int(decoded(chip.form, chip.transfer(sensor_command()))["faults"][0]) for _ in range(3)]
    assert told == [2, 2, 0]  # it held at the first request, and is told once more before it is forgotten


def test_adxrs453_a_pll_fault_makes_the_rate_invalid():
    chip = running()
    chip.faults = Fault.PLL | Fault.CST
    chip.transfer(sensor_command())
    assert chip.transfer(sensor_command()) == bytes.fromhex("10000084")


def test_adxrs453_registers_and_refusals():
    chip = running()
    chip.sample({"gyr.z": 500 * DEG, "temp_c": 85.0}, 1010 * MS)
    chip.supply = 0b0010
    asked = [0x00, 0x02, 0x0A, 0x0C, 0x0D, 0x12, 0x40]
    commands = b"".join(read_command(a) for a in asked) + sensor_command()
    replies = chip.transfer(commands)
    readings = words_adxrs453.register_readings(commands, replies).readings
    assert readings["RATE"].values[0] == pytest.approx(300 * DEG)
    assert readings["TEM"].values[0] == 85.0
    assert readings["FAULT"].values[0] == 0x0200
    assert readings["PID"].values[0] == 0x5201
    found = decode(replies, chip.form)[0]
    assert found["error"].columns["re"].tolist() == [1, 1]  # 12 is the ADXRS450's (K-450); 40 is none
    assert found["error"].start.tolist() == [24, 28]


def test_adxrs453_refuses_a_command_of_wrong_parity_or_of_no_kind():
    chip = running()
    chip.transfer(bytes.fromhex("20000001"))
    assert chip.transfer(bytes.fromhex("C0000001")) == bytes.fromhex("1E040000")
    assert chip.transfer(sensor_command()) == bytes.fromhex("1E020000")


def test_adxrs453_echoes_a_write():
    chip = running()
    chip.transfer(words_adxrs453.write_command(0x00, 0xBEEF))
    found = decode(chip.transfer(sensor_command()), chip.form)[0]
    assert found["write"].columns["data"][0] == 0xBEEF


def test_adxrs453_transfers_whole_frames():
    with pytest.raises(ShapeError, match="frames of 4 bytes, but 3 bytes came"):
        Adxrs453().transfer(b"\0\0\0")


# --- ADXRS290 ---


def measuring(filter_code=0):
    chip = Adxrs290()
    chip.transfer(bytes([0x10, 0b11]))
    chip.transfer(bytes([0x11, filter_code]))
    return chip


def test_adxrs290_starts_100_ms_after_it_is_told_to_measure():
    chip = Adxrs290()
    chip.sample({"gyr.x": 1.0, "gyr.y": 0.0}, 500 * MS)
    assert chip.transfer(bytes([0x88] + [0] * 6))[1:] == bytes(6)  # standby
    chip.transfer(bytes([0x10, 0b11]))
    chip.sample({"gyr.x": 1.0, "gyr.y": 0.0}, 599 * MS)
    assert chip.transfer(bytes([0x88] + [0] * 6))[1:] == bytes(6)
    chip.sample({"gyr.x": 1.0, "gyr.y": 0.0}, 600 * MS)
    assert decoded(chip.form, chip.transfer(bytes([0x88] + [0] * 6))[1:])["gyr.x"][0] == pytest.approx(1, abs=DEG / 400)


def test_adxrs290_burst_and_identity():
    chip = measuring()
    chip.sample({"gyr.x": 12.34 * DEG, "gyr.y": -99.995 * DEG, "temp_c": -12.5}, 100 * MS)
    assert chip.transfer(bytes([0x88] + [0] * 6)) == bytes.fromhex("00 A4 09 E1 B1 83 0F")
    assert chip.transfer(bytes([0x80, 0, 0, 0])) == bytes.fromhex("00 AD 1D 92")
    assert chip.transfer(bytes([0x8A, 0, 0])) == bytes.fromhex("00 E1 B1")


def test_adxrs290_temperature_needs_its_sensor_on():
    chip = measuring()
    chip.transfer(bytes([0x10, 0b10]))
    chip.sample({"gyr.x": 0.0, "gyr.y": 0.0, "temp_c": 31.7}, 100 * MS)
    assert chip.transfer(bytes([0x8C, 0, 0]))[1:] == bytes(2)


def test_adxrs290_read_only_registers_stay():
    chip = measuring()
    chip.transfer(bytes([0x00, 0x55]))
    assert chip.transfer(bytes([0x80, 0]))[1] == 0xAD


@pytest.mark.parametrize(("code", "corner"), [(0x50, 0.175), (0x90, 2.8)])
def test_adxrs290_high_pass_removes_a_constant_rate(code, corner):
    """First order: what is left of a step after t is exp(-2 π f t)."""
    chip = measuring(code)
    chip.sample({"gyr.x": 0.0, "gyr.y": 0.0}, 100 * MS)
    times = np.arange(101, 1101, 1)
    for t in times:
        chip.sample({"gyr.x": 1.0, "gyr.y": 0.0}, int(t) * MS)
    left = decoded(chip.form, chip.transfer(bytes([0x88] + [0] * 6))[1:])["gyr.x"][0]
    assert left == pytest.approx(math.exp(-2 * math.pi * corner * 1.0), abs=DEG / 400 + 1e-9)


def test_adxrs290_sync_is_high_until_the_data_are_read():
    chip = measuring()
    chip.transfer(bytes([0x12, 0x01]))
    assert not chip.sync
    chip.sample({"gyr.x": 0.0, "gyr.y": 0.0}, 100 * MS)
    assert chip.sync
    chip.transfer(bytes([0x80, 0]))
    assert chip.sync
    chip.transfer(bytes([0x88, 0]))
    assert not chip.sync


def test_adxrs290_standby_stops_it():
    chip = measuring()
    chip.transfer(bytes([0x10, 0x01]))
    chip.sample({"gyr.x": 1.0, "gyr.y": 0.0}, 500 * MS)
    assert chip.transfer(bytes([0x88] + [0] * 6))[1:] == bytes(6)


# --- MPU-6000 ---

FELT = {"acc.x": g(0.02), "acc.y": g(-0.01), "acc.z": g(0.998), "temp_c": 25.0} | {
    "gyr.x": 1.5 * DEG,
    "gyr.y": -0.75 * DEG,
    "gyr.z": 100 * DEG,
}
BURST = bytes.fromhex("01 48 FF 5C 3F DF F0 B0 00 C4 FF 9E 33 2C")


def awake(**options):
    chip = Mpu6000(**options)
    chip.write(0x6B, b"\0")
    return chip


def test_mpu6000_sleeps_until_it_is_woken():
    chip = Mpu6000()
    chip.sample(FELT, 0)
    assert chip.read(0x75) == b"\x68"
    assert chip.read(0x3B, 14) == bytes(14)
    chip.write(0x6B, b"\0")
    chip.sample(FELT, MS)
    assert chip.read(0x3B, 14) == BURST


def test_mpu6000_ranges_change_the_counts():
    chip = awake()
    chip.write(0x1B, bytes([3 << 3, 1 << 3]))
    chip.sample(FELT, 0)
    assert chip.form.chosen["gyr_range"] == "2000 deg/s"
    found = decoded(chip.form, chip.read(0x3B, 14))
    assert found["gyr.z"][0] == pytest.approx(100 * DEG, abs=DEG / 32.8)
    assert int.from_bytes(chip.read(0x47, 2), "big") == 1640  # 100 deg/s at 16.4 LSB
    assert int.from_bytes(chip.read(0x3F, 2), "big") == 8176  # 0.998 g at 8192 LSB


def test_mpu6000_early_silicon_has_half_the_counts():
    chip = awake(silicon="C4 or C5")
    chip.write(0x1C, b"\x08")
    chip.sample(FELT, 0)
    assert int.from_bytes(chip.read(0x3F, 2), "big") == 4088  # 0.998 g at 4096 LSB (ArduPilot)


def test_mpu6000_clips_at_the_end_of_its_word():
    chip = awake()
    chip.sample({**FELT, "acc.x": g(-3.0)}, 0)
    frames = decode(chip.read(0x3B, 14), chip.form)[0]["mpu6000"]
    assert frames.flags[""][0] == flags.ACC_CLIPPED


def test_mpu6000_data_ready_is_cleared_by_its_read():
    chip = awake()
    chip.sample(FELT, 0)
    assert [chip.read(0x3A)[0] for _ in range(2)] == [1, 0]


def count_of(chip, register):
    return int.from_bytes(chip.read(register, 2), "big")


def test_mpu6000_fifo_holds_what_is_on():
    chip = awake()
    chip.write(0x23, b"\x78")
    chip.write(0x6A, b"\x40")
    for i in range(3):
        chip.sample({**FELT, "gyr.x": i * 10 * DEG}, i * MS)
    assert count_of(chip, 0x72) == 36
    found = decoded(fifo_format(chip.form, 0x78), chip.read(0x74, 36))
    assert np.rint(found["gyr.x"] / DEG).tolist() == [0, 10, 20]
    assert count_of(chip, 0x72) == 0


def test_mpu6000_fifo_loses_its_place_when_it_overflows():
    """1024 bytes are no whole number of 14: the oldest go, nothing marks it, and a plain reader gets nonsense."""
    chip = awake()
    chip.write(0x23, b"\xf8")
    chip.write(0x6A, b"\x40")
    for i in range(73):
        chip.sample(FELT, i * MS)
    assert not chip.read(0x3A)[0] & 0x10
    chip.sample(FELT, 73 * MS)
    assert chip.read(0x3A)[0] & 0x10
    assert count_of(chip, 0x72) == 1024
    lost = 74 * 14 - 1024
    data = chip.read(0x74, 1024)
    assert data[:14] == (BURST * 2)[lost : lost + 14]
    assert data[:14] != BURST
    chip.write(0x6A, b"\x44")  # FIFO_RESET, which clears itself
    assert count_of(chip, 0x72) == 0
    assert chip.read(0x6A) == b"\x40"
    chip.sample(FELT, 74 * MS)
    assert chip.read(0x74, 14) == BURST


def test_mpu6000_empty_fifo_repeats_the_last_byte():
    chip = awake()
    chip.write(0x23, b"\xf8")
    chip.write(0x6A, b"\x40")
    chip.sample(FELT, 0)
    assert chip.read(0x74, 17) == BURST + BURST[-1:] * 3


def test_mpu6000_reset_puts_it_to_sleep_again():
    chip = awake()
    chip.write(0x1B, b"\x18")
    chip.write(0x6B, b"\x80")
    assert (chip.read(0x6B), chip.read(0x1B), chip.form.chosen["gyr_range"]) == (b"\x40", b"\0", "250 deg/s")


# --- MPU-3050 ---

SAMPLE = bytes.fromhex("C1 80 00 C4 FF 9E 33 2C")
RATES = {name: FELT[name] for name in ("temp_c", "gyr.x", "gyr.y", "gyr.z")}


def test_mpu3050_measures_100_ms_after_power():
    chip = Mpu3050()
    chip.sample(RATES, 99 * MS)
    assert chip.read(0x1B, 8) == bytes(8)
    chip.sample(RATES, 100 * MS)
    assert chip.read(0x1B, 8) == SAMPLE
    assert chip.read(0x1A)[0] & 1


def test_mpu3050_settles_50_ms_after_a_change_of_range():
    chip = Mpu3050()
    chip.sample(RATES, 200 * MS)
    chip.write(0x16, b"\x18")
    chip.sample(RATES, 249 * MS)
    assert chip.read(0x1B, 8) == SAMPLE
    chip.sample(RATES, 250 * MS)
    assert int.from_bytes(chip.read(0x21, 2), "big") == 1640


def test_mpu3050_fifo_with_its_footer_is_read_with_8_then_with_10_bytes():
    chip = Mpu3050()
    chip.write(0x12, b"\xf1")
    chip.write(0x3D, b"\x40")
    chip.sample(RATES, 100 * MS)
    assert count_of(chip, 0x3A) == 10
    first = chip.read(0x3C, 8)
    assert first == SAMPLE
    later = fifo_format(chip.form, 0xF1, later=True)
    for i in range(1, 4):
        chip.sample({**RATES, "gyr.z": i * 10 * DEG}, (100 + i) * MS)
        assert count_of(chip, 0x3A) == 12
        found = decoded(later, chip.read(0x3C, 10))
        assert found["gyr.z"][0] == pytest.approx(i * 10 * DEG)
        assert found["temp_c"][0] == 25.0
    assert count_of(chip, 0x3A) == 2  # the last footer stays


def test_mpu3050_fifo_without_footer():
    chip = Mpu3050()
    chip.write(0x12, b"\x70")
    chip.write(0x3D, b"\x40")
    for i in range(2):
        chip.sample(RATES, (100 + i) * MS)
    assert chip.read(0x3C, 12) == SAMPLE[2:] * 2


def test_mpu3050_overflow_is_a_count_of_512_and_a_reset_ends_it():
    chip = Mpu3050()
    chip.write(0x12, b"\xf1")
    chip.write(0x3D, b"\x40")
    for i in range(52):
        chip.sample(RATES, (100 + i) * MS)
    assert count_of(chip, 0x3A) == 512
    assert chip.read(0x1A)[0] & 0x80
    chip.write(0x3D, b"\x42")
    assert count_of(chip, 0x3A) == 0
    assert chip.read(0x3D) == b"\x40"


def test_mpu3050_sleeps_and_resets():
    chip = Mpu3050()
    chip.write(0x3E, b"\x40")
    chip.sample(RATES, 200 * MS)
    assert chip.read(0x1B, 8) == bytes(8)
    chip.write(0x3E, b"\x80")
    chip.sample(RATES, 299 * MS)
    assert chip.read(0x1B, 8) == bytes(8)
    chip.sample(RATES, 300 * MS)
    assert chip.read(0x1B, 8) == SAMPLE
    assert chip.read(0x00)[0] & 0x7E == 0x68


# --- HMC5983 ---

FIELD = {"mag.x": gauss(0.215), "mag.y": gauss(-0.042), "mag.z": gauss(0.391), "temp_c": 31.5}


def continuous():
    chip = Hmc5983()
    chip.write(0x02, b"\0")
    return chip


def test_hmc5983_sends_x_z_y():
    chip = continuous()
    chip.sample(FIELD, 0)
    assert chip.read(0x03, 6) == bytes.fromhex("00 EA 01 AA FF D2")
    assert chip.read(0x0A, 3) == b"H43"
    assert chip.read(0x31, 2) == bytes.fromhex("03 40")


def test_hmc5983_gain_changes_one_sample_late():
    chip = continuous()
    chip.sample(FIELD, 0)
    chip.write(0x01, bytes([5 << 5]))
    told = []
    for _ in range(2):
        chip.sample(FIELD, 0)
        told.append(int.from_bytes(chip.read(0x03, 6)[:2], "big"))
    assert told == [234, round(0.215 * 390)]


def test_hmc5983_overflows_channel_by_channel():
    chip = continuous()
    chip.sample({**FIELD, "mag.y": gauss(2.0)}, 0)  # 2180 LSB at 1090
    assert chip.read(0x03, 6) == bytes.fromhex("00 EA 01 AA F0 00")
    chip.sample(FIELD, 0)
    assert chip.read(0x03, 6) == bytes.fromhex("00 EA 01 AA FF D2")


def test_hmc5983_self_test_as_in_the_data_sheet():
    """DS-5983p: CRA 71, CRB A0, MODE 00 give about +452 in x and y, +421 in z."""
    chip = Hmc5983()
    chip.write(0x00, bytes.fromhex("71 A0 00"))
    for _ in range(2):
        chip.sample(FIELD, 0)
    assert chip.read(0x03, 6) == bytes.fromhex("01 C4 01 A5 01 C4")
    chip.write(0x00, b"\x72")
    chip.sample(FIELD, 0)
    assert int.from_bytes(chip.read(0x03, 2), "big", signed=True) == -452


def test_hmc5983_locks_until_all_six_bytes_are_read():
    chip = continuous()
    chip.sample(FIELD, 0)
    assert chip.read(0x09)[0] == 1
    begin = chip.read(0x03, 2)
    assert chip.read(0x09)[0] == 3
    chip.sample({"mag.x": gauss(-0.5), "mag.y": gauss(0.1), "mag.z": gauss(-0.1)}, 0)
    assert begin + chip.read(0x05, 4) == bytes.fromhex("00 EA 01 AA FF D2")
    assert chip.read(0x09)[0] == 0
    chip.sample({**FIELD, "mag.x": gauss(-0.5)}, 0)
    assert int.from_bytes(chip.read(0x03, 6)[:2], "big", signed=True) == -545


def test_hmc5983_writing_the_mode_unlocks():
    chip = continuous()
    chip.sample(FIELD, 0)
    chip.read(0x03, 2)
    chip.write(0x02, b"\0")
    assert not chip.read(0x09)[0] & 2
    chip.sample({**FIELD, "mag.x": gauss(-0.5)}, 0)
    assert int.from_bytes(chip.read(0x03, 6)[:2], "big", signed=True) == -545


def test_hmc5983_single_measurement_then_idle():
    chip = Hmc5983()
    chip.sample(FIELD, 0)
    assert chip.read(0x02)[0] & 3 >= 2
    chip.sample({**FIELD, "mag.x": 0.0}, 0)
    assert chip.read(0x03, 6) == bytes.fromhex("00 EA 01 AA FF D2")


# --- ADIS16355 ---

MOTION = {"gyr.x": 40 * DEG, "gyr.y": -40 * DEG, "gyr.z": -0.07326 * DEG, "acc.x": 0.0, "acc.y": g(-1.0)} | {
    "acc.z": g(1.0),
    "temp_c": 31.0,
    "temp_y_c": -5.0,
    "aux_v": 1.25,
}
POLL = bytes.fromhex("8222 BDDE BFFF 8000 BE73 818D 8029 8F32 8AAA 8800")


def poll(chip):
    """Ten words as the catalogue's frame has them."""
    return chip.transfer(words_adis16355.poll_commands())[2:]


def test_adis16355_poll_is_the_frame_of_the_catalogue():
    chip = Adis16355()
    chip.sample(MOTION, 150 * MS)
    assert poll(chip) == POLL


def test_adis16355_says_nothing_new_before_150_ms():
    chip = Adis16355()
    chip.sample(MOTION, 149 * MS)
    frames = decode(poll(chip), chip.form)[0]["adis16355"]
    assert frames.flags[""][0] == flags.GYR_ABSENT | flags.ACC_ABSENT


def test_adis16355_reading_clears_nd_of_the_register():
    chip = Adis16355()
    chip.sample(MOTION, 150 * MS)
    words = chip.transfer(bytes.fromhex("0400 0400 0600 0000"))
    assert words[2:] == bytes.fromhex("8222 0222 BDDE")


def test_adis16355_or_of_all_for_the_sheet_does_not_say():
    chip = Adis16355(clears="all")
    chip.sample(MOTION, 150 * MS)
    words = chip.transfer(bytes.fromhex("0400 0600 0000"))
    assert words[2:] == bytes.fromhex("8222 3DDE")


def test_adis16355_ea_follows_status():
    chip = Adis16355()
    chip.sample(MOTION, 150 * MS)
    chip.alarms = 0x0400
    words = chip.transfer(words_adis16355.read_command(0x04) + words_adis16355.read_command(0x3C) + b"\0\0")
    assert words[2:] == bytes.fromhex("C222 0400")


@pytest.mark.parametrize(("code", "choice"), [(2, "150 deg/s"), (1, "75 deg/s")])
def test_adis16355_range_changes_the_size_of_a_count(code, choice):
    chip = Adis16355()
    chip.transfer(words_adis16355.write_command(0x39, code))
    chip.sample(MOTION, 150 * MS)
    found = decoded(catalog.load("adis16355").bind({"gyr_range": choice}), poll(chip))
    assert found["gyr.x"][0] == pytest.approx(40 * DEG, abs=0.04 * DEG)
    assert chip.transfer(words_adis16355.read_command(0x38) + b"\0\0")[2:] == bytes([code, 0x02])


def test_adis16355_registers_after_power_up():
    """DS-1635x: MSC_CTRL 0000, SMPL_PRD 0001, SENS/AVG 0402."""
    chip = Adis16355()
    assert chip.transfer(bytes.fromhex("3400 3600 3800 0000"))[2:] == bytes.fromhex("0000 0001 0402")


def test_adis16355_reset_and_sleep():
    chip = Adis16355()
    chip.transfer(words_adis16355.write_command(0x39, 1))
    chip.sample(MOTION, 150 * MS)
    chip.transfer(words_adis16355.write_command(0x3E, 0x80))
    chip.sample(MOTION, 299 * MS)
    assert chip.transfer(bytes.fromhex("0400 0000"))[2:] == bytes(2)
    chip.sample(MOTION, 300 * MS)
    assert poll(chip) == POLL
    chip.transfer(words_adis16355.write_command(0x3A, 2))  # 1 s
    chip.sample(MOTION, 1299 * MS)
    assert not poll(chip)[0] & 0x80
    chip.sample(MOTION, 1300 * MS)
    assert poll(chip)[0] & 0x80


def test_adis16355_outputs_cannot_be_written():
    chip = Adis16355()
    chip.sample(MOTION, 150 * MS)
    chip.transfer(words_adis16355.write_command(0x04, 0xFF) + words_adis16355.write_command(0x3C, 0xFF))
    assert poll(chip) == POLL


def test_adis16355_transfers_whole_frames():
    with pytest.raises(ShapeError, match="frames of 2 bytes, but 1 bytes came"):
        Adis16355().transfer(b"\0")


# --- all ---


def test_a_value_that_is_missing_repeats_the_one_before():
    chip = awake()
    chip.sample(FELT, 0)
    chip.sample({"gyr.x": math.nan, "gyr.y": 0.0}, MS)
    data = chip.read(0x3B, 14)
    assert data == BURST[:10] + bytes(2) + BURST[12:]
