"""plumbob list devices, decode and emulate: what they print, where losses are told, how they end."""

import json
import os
import shlex
import shutil
import signal
import subprocess
from pathlib import Path

import numpy as np
import pytest

from plumbob import decode, read, read_array
from plumbob.core.units import deg
from plumbob.data.cards import CalibrationCard, NoiseCard, TriadNoise
from plumbob.live.rigs.rig import PLANS, make_rig
from plumbob.protocols.encode import encode
from plumbob.protocols.format_toml import device_names, find_format
from tests.helpers.commandline import PLUMBOB, answer, call, typed

BARE = "note: calibration NONE: these sensor values are uncalibrated"
LONG = 60.0
ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def buoy(tmp_path_factory):
    path = tmp_path_factory.mktemp("wire") / "buoy.bin"
    done = typed(f"emulate buoy --duration 5s --seed 1 --write {path}")
    assert (done.stdout, done.stderr) == ("", "note: 500 frames: 500 sent\n")
    return path


def test_options_of_a_rig_are_those_of_python(tmp_path):
    card = NoiseCard("unit 7", "told", gyr=TriadNoise(n_rpsd=[0.01] * 3, b=[0.0] * 3, k_rpsd=[0.0] * 3))
    card.save(tmp_path / "card.json")
    words = "--noise card.json --sensors ideal --temp 30degC --warm-up '15 K, 1 s' --high-pass 0.5Hz --mount-error 1deg"
    typed(f"emulate ring --duration 2s --write a.bin {words} --seed 4 --reference ahrs500ga", cwd=tmp_path)
    plan = PLANS["ring"].with_sensors("ideal").with_reference("ahrs500ga")
    want = make_rig(plan, find_format("ring"), seed=4, duration=2.0, noise=card, temp_c=30.0, warm_up=(15.0, 1.0),
                    high_pass=0.5, mount_error=deg(1.0))  # fmt: skip
    assert (tmp_path / "a.bin").read_bytes() == want.stream()
    typed("emulate arm --duration 2s --write b.bin --noise u2=card.json", cwd=tmp_path)
    want = make_rig(PLANS["arm"], find_format("arm"), seed=0, duration=2.0, noise={"u2": card})
    assert (tmp_path / "b.bin").read_bytes() == want.stream()


def piped(data, form, *words):
    """Rows of the table of bytes that come through a pipe, and the notes but the one on calibration."""
    done = call("decode", "-", "--format", form, *words, data=bytes(data))
    *notes, bare = done.stderr.splitlines()
    assert (done.returncode, bare) == (0, BARE)
    return done.stdout.splitlines()[1:], [note.removeprefix("note: ") for note in notes]


def test_the_emulator_writes_what_the_rig_says_into_files_and_pipes(buoy):
    assert buoy.read_bytes() == make_rig(PLANS["buoy"], find_format("buoy"), seed=1, duration=5.0).stream()
    words = shlex.split("emulate mpu6000 --scenario coning --rate 200Hz --duration 1s --write -")
    data = subprocess.run([*PLUMBOB, *words], stdout=subprocess.PIPE, check=True, timeout=LONG).stdout
    assert len(data) == 200 * 14
    assert len(piped(data, "mpu6000")[0]) == 200


def test_every_loss_is_told_on_standard_error_and_an_option_changes_the_numbers(buoy):
    """A bit in the fourth frame, the end of the last; frames that never came, across the turn of the counter."""
    data = bytearray(buoy.read_bytes())
    rows, notes = piped(data, "buoy", "--rate", "100Hz")
    assert (len(rows), notes) == (500, [])
    assert rows[1].startswith("0.01,31,1,10000,0,") and rows[1].endswith(",,,,mag-absent")
    frames = np.frombuffer(data, dtype=np.uint8).reshape(500, 31)
    absent = np.delete(frames, [3, 4, *range(250, 260), 499], axis=0)  # the last leaves no gap that could be seen
    skipped = "the frame counter skips {}: that many frames are missing, or it jumped"
    assert piped(absent.tobytes(), "buoy")[1] == [skipped.format(12)]
    data[100] ^= 1
    rows, notes = piped(data[:-10], "buoy")
    lost = "52 bytes of 15490 belong to no frame; candidates rejected: 1 for their checksum"
    assert (len(rows), notes) == (498, [lost, skipped.format(1)])
    assert "t [s] counts rows" in piped(data, "buoy", "--rate", "100Hz")[1][-1]
    data = bytes.fromhex("0148 FF5C 3FDF F0B0 00C4 FF9E 332C")  # DS-6050: 196 counts are 1.5 °/s at ±250
    for name, counts in (("250", 131.0), ("2000", 16.4)):
        ((row, *_), _) = piped(data, "mpu6000", "--option", f"gyr_range={name} deg/s")
        assert float(row.split(",")[5]) == pytest.approx(np.radians(196 / counts), rel=1e-9)


def test_the_wrong_format_gets_a_hint_and_the_right_one_none(buoy):
    """9000 frames of 31 bytes, and before them, as far as is looked, frames of another format: less of it, or more."""
    none = typed(f"decode {buoy} --format ahrs500ga", code=1).stderr
    assert "none of its 15500 bytes is a frame of ahrs500ga. It looks like buoy (500 frames).\n" in none
    transfers = piped(buoy.read_bytes(), "mpu6000")[1]  # 1107 × 14 + 2
    assert "15500 bytes are not a multiple of 14, the length of a transfer of mpu6000: 2 too many" in str(transfers)
    assert "this may not be mpu6000 at all. It looks like buoy (500 frames)." in transfers[-1]
    form = find_format("ahrs500ga").bind({})
    message = form.message("")
    values = {f.name: np.zeros(11_000) for f in message.fields if f.physical}
    other = encode(form, values, message=message.name).tobytes()
    few, many = (piped(other[:size] + 18 * buoy.read_bytes(), "buoy")[1] for size in (270_400, 286_000))
    assert not [note for note in few if "may not be" in note]
    assert [note for note in many if "this may not be buoy at all. It looks like ahrs500ga" in note]


def test_the_emulator_prints_its_port_first_and_ends_on_a_signal(tmp_path):
    link = tmp_path / "line"
    words = [*PLUMBOB, "emulate", "buoy", "--link", str(link)]
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        try:
            name = process.stdout.readline().decode().strip()
            assert str(link.readlink()) == name
            fd, data = os.open(name, os.O_RDWR | os.O_NOCTTY), b""
            while len(data) < 31 * 7:
                data += os.read(fd, 4096)
            process.send_signal(signal.SIGTERM)
            os.close(fd)
            out, err = process.communicate(timeout=LONG)
        finally:
            process.kill()
    assert (process.returncode, out, link.is_symlink()) == (0, b"", False)
    assert b"60000 frames: " in err
    assert decode(data, find_format("buoy"))[1].frames["buoy"] >= 5


def test_truth_card_and_faults_lie_beside_and_sim_warms_up_as_a_rig_does(tmp_path):
    files = "--write a.bin --truth t.parquet --faults flip=5%,skip=0.1 --fault-log f.jsonl"
    typed(f"emulate arm --duration 5s --seed 2 {files}", cwd=tmp_path)
    recording = read(tmp_path / "t-u4.parquet")
    assert len(recording.imu) == len(recording.track) == 50
    assert CalibrationCard.load(tmp_path / "t-u4.card.json").device == recording.imu.meta.device
    faults = [json.loads(line) for line in (tmp_path / "f.jsonl").read_text().splitlines()]
    rig = make_rig(PLANS["arm"], find_format("arm"), seed=2, duration=5.0, faults={"flip": 0.05, "skip": 0.1})
    assert faults == [fault.summary() for fault in rig.faults]
    assert {fault["kind"] for fault in faults} == {"flip", "skip"}
    assert (tmp_path / "a.bin").read_bytes() == rig.stream()
    warm = "--frame NED --duration 3s --rate 50Hz --warm-up '15 K, 1 s'"
    typed(f"sim static {warm} --set temp_c=20degC --out a.parquet", cwd=tmp_path)
    imu = read(tmp_path / "a.parquet").imu
    np.testing.assert_allclose(imu.temp_c, 20.0 + 15.0 * (1.0 - np.exp(-imu.t)), atol=1e-5)
    typed(f"sim teach {warm} --out b.parquet", cwd=tmp_path)
    for unit in read_array(tmp_path / "b.parquet").units.values():
        np.testing.assert_allclose(unit.temp_c, 25.0 + 15.0 * (1.0 - np.exp(-unit.t)), atol=1e-5)


def test_lists_name_every_device_with_its_values_and_the_page_is_up_to_date():
    listed = typed("list devices").stdout
    assert all(f"  {name} " in listed for name in (*device_names(), *PLANS))
    assert all(name in typed("list rigs").stdout for name in (*PLANS, "unplug", "burst"))
    assert {row["name"] for row in answer("list devices")["devices"]} == set(device_names())
    assert answer("list devices rion")["framing"]["sync"] == ["68", "77"]
    assert "count / gyr_range deg/s" in typed("list devices mpu6000").stdout
    assert "count / 65.5 deg/s" in typed("list devices mpu6000 --option 'gyr_range=500 deg/s'").stdout
    # otherwise: plumbob list devices --markdown > docs/devices.md
    assert (ROOT / "docs" / "devices.md").read_text(encoding="utf-8") == typed("list devices --markdown").stdout


@pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler")
def test_the_printed_header_compiles(tmp_path):
    (tmp_path / "buoy.h").write_text(typed("list devices buoy --c").stdout)
    (tmp_path / "main.c").write_text('#include "buoy.h"\nint main(void) { plumbob_buoy f; plumbob_buoy_seal(&f); }\n')
    words = shlex.split("cc -std=c11 -Wall -Werror -Wno-unused-function -c main.c")
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
