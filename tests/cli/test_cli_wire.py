"""plumbob devices, decode and emulate, as processes: what they print, where losses are told, how they end."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from plumbob.cli import decode as cli_decode
from plumbob.files import read
from plumbob.protocols import catalog
from plumbob.protocols.decode import decode
from plumbob.protocols.encode import encode
from plumbob.protocols.find import find_format
from plumbob.protocols.rigs import load
from plumbob.session.emulated import _address
from plumbob.simulation.rigs.plan import PLANS
from plumbob.simulation.rigs.rig import make_rig
from tests.helpers.commandline import call

BARE = "note: calibration NONE: these sensor values are uncalibrated\n"

LONG = 60.0
STREAMS = ("stdin", "stdout", "stderr")
ROOT = Path(__file__).parents[2]


def start(*args, **more):
    words = [sys.executable, "-m", "plumbob", *map(str, args)]
    return subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, **more)


def plumbob(*args, data=b"", cwd=None):
    """Exit code, standard output and standard error."""
    done = call(*args, data=data, cwd=cwd)
    return done.returncode, done.stdout, done.stderr


def ok(*args, **more):
    code, out, err = plumbob(*args, **more)
    assert code == 0, err
    return out, err


@pytest.fixture(scope="module")
def buoy(tmp_path_factory):
    path = tmp_path_factory.mktemp("wire") / "buoy.bin"
    out, err = ok("emulate", "buoy", "--duration", "5s", "--seed", 1, "--write", path)
    assert (out, err) == ("", "note: 500 frames: 500 sent\n")
    return path


def test_the_emulator_writes_what_the_rig_says(buoy):
    assert buoy.read_bytes() == make_rig(PLANS["buoy"], load("buoy"), seed=1, duration=5.0).stream()


def test_options_of_a_rig_are_those_of_python(tmp_path):
    from plumbob.core.units import deg
    from plumbob.data.cards import NoiseCard, TriadNoise

    card = NoiseCard("unit 7", "told", gyr=TriadNoise(n_rpsd=[0.01] * 3, b=[0.0] * 3, k_rpsd=[0.0] * 3))
    card.save(tmp_path / "card.json")
    ok("emulate", "ring", "--duration", "2s", "--write", "a.bin", "--noise", "card.json", "--sensors", "ideal",
       "--temp", "30degC", "--warm-up", "15 K, 1 s", "--high-pass", "0.5Hz", "--mount-error", "1deg", "--seed", 4,
       "--reference", "ahrs500ga", cwd=tmp_path)  # fmt: skip
    plan = PLANS["ring"].with_sensors("ideal").with_reference("ahrs500ga")
    want = make_rig(plan, load("ring"), seed=4, duration=2.0, noise=card, temp_c=30.0, warm_up=(15.0, 1.0),
                    high_pass=0.5, mount_error=deg(1.0))  # fmt: skip
    assert (tmp_path / "a.bin").read_bytes() == want.stream()
    ok("emulate", "arm", "--duration", "2s", "--write", "b.bin", "--noise", "u2=card.json", cwd=tmp_path)
    want = make_rig(PLANS["arm"], load("arm"), seed=0, duration=2.0, noise={"u2": card})
    assert (tmp_path / "b.bin").read_bytes() == want.stream()


def test_a_table_has_units_in_its_header_and_nothing_but_rows(buoy):
    out, err = ok("decode", buoy, "--format", "buoy", "--rate", "100Hz")
    head, *rows = out.splitlines()
    assert head.startswith(
        "t [s],byte,counter,clock [us],mag_new,acc.x [m/s2],acc.y [m/s2],acc.z [m/s2],temp_c [degC],"
    )
    assert head.endswith("gyr.x [rad/s],gyr.y [rad/s],gyr.z [rad/s],mag.x [uT],mag.z [uT],mag.y [uT],flags")
    assert len(rows) == 500
    assert rows[1].startswith("0.01,31,1,10000,0,")
    assert rows[1].endswith(",,,,mag-absent")
    assert err == BARE


@pytest.mark.parametrize("suffix", ["csv", "json", "parquet"])
def test_every_kind_of_file_holds_the_same(buoy, tmp_path, suffix):
    out = tmp_path / f"x.{suffix}"
    assert ok("decode", buoy, "--format", "buoy", "--out", out)[0] == ""
    found, _ = decode(buoy.read_bytes(), load("buoy"))
    want = found["buoy"].columns["gyr.x"]
    if suffix == "json":
        told = json.loads(out.read_text())
        assert told["counts"]["frames"] == {"buoy": 500}
        got = told["columns"]["gyr.x [rad/s]"]
    elif suffix == "parquet":
        import pyarrow.parquet as pq

        got = pq.read_table(out)["gyr.x [rad/s]"].to_pylist()
    else:
        lines = [line.split(",") for line in out.read_text().splitlines()]
        got = [float(row[lines[0].index("gyr.x [rad/s]")]) for row in lines[1:]]
    assert np.abs(np.array(got) - want).max() < 1e-11  # twelve digits in CSV


def test_it_reads_a_pipe(buoy):
    out, _ = ok("decode", "-", "--format", "buoy", data=buoy.read_bytes())
    assert out == ok("decode", buoy, "--format", "buoy")[0]


def test_every_loss_is_told_on_standard_error(buoy):
    data = bytearray(buoy.read_bytes())
    data[100] ^= 1  # in the fourth frame
    out, err = ok("decode", "-", "--format", "buoy", data=bytes(data[:-10]))
    assert len(out.splitlines()) == 1 + 498
    assert err.splitlines() == [
        "note: 52 bytes of 15490 belong to no frame; candidates rejected: 1 for their checksum",
        "note: the frame counter skips 1: that many frames are missing, or it jumped",
        BARE.rstrip(),
    ]
    _, err = ok("decode", "-", "--format", "buoy", "--rate", "100Hz", data=bytes(data))
    assert "t [s] counts rows" in err


def test_frames_that_never_came_are_counted_across_the_counters_turn(buoy):
    frames = np.frombuffer(buoy.read_bytes(), dtype=np.uint8).reshape(500, 31)
    kept = np.delete(frames, [3, 4, *range(250, 260), 499], axis=0)  # the last leaves no gap that could be seen
    _, err = ok("decode", "-", "--format", "buoy", data=kept.tobytes())
    assert err == f"note: the frame counter skips 12: that many frames are missing, or it jumped\n{BARE}"


def test_the_wrong_format_gets_a_hint(buoy):
    code, out, err = plumbob("decode", buoy, "--format", "ahrs500ga")
    assert (code, out) == (1, "")
    assert err == (
        f"plumbob decode: {buoy}: none of its 15500 bytes is a frame of ahrs500ga. It looks like buoy (500 frames).\n"
    )


def test_a_stream_of_which_most_is_in_frames_gets_no_hint(buoy, monkeypatch):
    """500 frames of 31 bytes, and 29 of 30 bytes of another format's whole frames to each, which come first.

    The beginning alone would look like that other format.
    """
    monkeypatch.setattr(cli_decode, "_HINT", 14_000)
    form = find_format("ahrs500ga").bind({})
    message = form.message("")
    values = {f.name: np.zeros(700) for f in message.fields if f.physical}
    other = encode(form, values, message=message.name).tobytes()[:14_500]
    _, err = ok("decode", "-", "--format", "buoy", data=other + buoy.read_bytes())
    assert "belong to no frame" in err
    assert "may not be" not in err
    _, err = ok("decode", "-", "--format", "buoy", data=(other + other)[:16_000] + buoy.read_bytes())
    assert "this may not be buoy at all. It looks like ahrs500ga" in err


def test_bytes_of_a_bus_that_are_no_multiple_or_another_format_are_noticed(buoy):
    _, err = ok("decode", buoy, "--format", "mpu6000")
    assert (
        "15500 bytes are not a multiple of 14, the length of a transfer of mpu6000: 2 too many" in err
    )  # 1107 × 14 + 2
    assert "this may not be mpu6000 at all. It looks like buoy (500 frames)." in err


@pytest.mark.parametrize(
    ("args", "words"),
    [
        (("decode", os.devnull, "--format", "buoy"), "is empty"),
        (("decode", os.devnull, "--format", "bouy"), "'bouy' is not a known device"),
        (("decode", os.devnull, "--format", "buoy", "--message", "x"), "no message 'x'"),
        (("decode", os.devnull, "--format", "buoy", "--out", "x.xls"), ".csv, .txt, .parquet or .json"),
        (("decode", os.devnull, "--format", "mpu6000", "--option", "gyr_range"), "NAME=VALUE"),
        (("decode", os.devnull, "--format", "mpu6000", "--option", "gyr_range=300 deg/s"), "must be one of"),
        (("decode", "nowhere.bin", "--format", "buoy"), "nowhere.bin does not exist; check the path."),
        (("decode", os.curdir, "--format", "buoy"), ". is a folder; name a file."),
        (("emulate",), "needs a RIG"),
        (("emulate", "mpu6000"), "--scenario buoy"),
        (("emulate", "mpu6000", "--scenario", "buoy"), "give a rate"),
        (("emulate", "buoy", "--sensors", "mpu6000"), "mpu6000 has no mag"),
        (("emulate", "buoy", "--frame", "ENU"), "its own frame"),
        (("emulate", "buoy", "--reference", "ideal"), "has no reference"),
        (("emulate", "buoy", "--warm-up", "15 K"), "RISE, TIME"),
        (("emulate", "arm", "--noise", "u1=a.json", "--noise", "b.json"), "one card for all units"),
        (("emulate", "arm", "--noise", "u1=a.json"), "a.json"),
        (("emulate", "buoy", "--speed", "fast"), "or max"),
        (("emulate", "buoy", "--set", "height=1m"), "name it with --scenario"),
        (("emulate", "buoy", "--tcp", "4000"), "HOST:PORT"),
        (("emulate", "buoy", "--faults", "flip"), "name=value"),
        (("devices", "--c"), "name a device"),
        (("devices", "nothing"), "not a known device"),
    ],
)
def test_mistakes_get_one_line(args, words, tmp_path):
    code, out, err = plumbob(*args, cwd=tmp_path)
    assert code == 1, err
    assert words in err
    assert len(err.splitlines()) == 1
    assert out == "" or out.startswith("/dev/")


def test_a_port_without_a_host_is_heard_on_this_machine_alone():
    assert _address(":4000") == ("127.0.0.1", 4000)
    assert _address("0.0.0.0:4000") == ("0.0.0.0", 4000)


def test_an_option_changes_the_numbers():
    data = bytes.fromhex("0148 FF5C 3FDF F0B0 00C4 FF9E 332C")  # DS-6050: 196 counts are 1.5 °/s at ±250
    narrow, wide = (
        ok("decode", "-", "--format", "mpu6000", "--option", f"gyr_range={name} deg/s", data=data)[0].splitlines()[1]
        for name in ("250", "2000")
    )
    assert float(narrow.split(",")[5]) == pytest.approx(np.radians(196 / 131.0), rel=1e-9)
    assert float(wide.split(",")[5]) == pytest.approx(np.radians(196 / 16.4), rel=1e-9)


def test_the_emulator_prints_its_port_first_and_ends_on_a_signal(tmp_path):
    link = tmp_path / "line"
    process = start("emulate", "buoy", "--link", link)
    try:
        name = process.stdout.readline().decode().strip()
        assert str(link.readlink()) == name
        fd = os.open(name, os.O_RDWR | os.O_NOCTTY)
        end, data = time.monotonic() + LONG, b""
        while len(data) < 31 * 5 and time.monotonic() < end:
            data += os.read(fd, 4096)
        process.send_signal(signal.SIGTERM)
        os.close(fd)
        out, err = process.communicate(timeout=LONG)
    finally:
        process.kill()
    assert process.returncode == 0
    assert out == b""
    assert b"60000 frames: " in err
    assert not link.is_symlink()
    assert decode(data, load("buoy"))[1].frames["buoy"] >= 5


def test_truth_card_and_faults_lie_beside(tmp_path):
    ok("emulate", "arm", "--duration", "5s", "--write", "a.bin", "--truth", "t.parquet", "--faults", "flip=5%,skip=0.1",
       "--fault-log", "f.jsonl", "--seed", "2", cwd=tmp_path)  # fmt: skip
    from plumbob.data.cards import CalibrationCard

    recording = read(tmp_path / "t-u4.parquet")
    assert len(recording.imu) == len(recording.track) == 50
    assert CalibrationCard.load(tmp_path / "t-u4.card.json").device == recording.imu.meta.device
    faults = [json.loads(line) for line in (tmp_path / "f.jsonl").read_text().splitlines()]
    rig = make_rig(PLANS["arm"], load("arm"), seed=2, duration=5.0, faults={"flip": 0.05, "skip": 0.1})
    assert faults == [fault.told() for fault in rig.faults]
    assert {fault["kind"] for fault in faults} == {"flip", "skip"}
    assert (tmp_path / "a.bin").read_bytes() == rig.stream()


def test_a_pipe_from_emulator_to_decoder(tmp_path):
    emulator = start(
        "emulate", "mpu6000", "--scenario", "coning", "--rate", "200Hz", "--duration", "1s", "--write", "-"
    )
    data, _ = emulator.communicate(timeout=LONG)
    assert emulator.returncode == 0
    assert len(data) == 200 * 14
    out, _ = ok("decode", "-", "--format", "mpu6000", data=data)
    assert len(out.splitlines()) == 201


def test_lists_name_everything():
    out, _ = ok("devices")
    assert all(f"  {name} " in out for name in (*catalog.names(), *PLANS))
    out, _ = ok("emulate", "--list")
    assert all(name in out for name in (*PLANS, "unplug", "burst"))
    told = json.loads(ok("devices", "--json")[0])
    assert {row["name"] for row in told["devices"]} == set(catalog.names())


def test_one_device_is_told_with_units_marks_registers_and_sources():
    out, _ = ok("devices", "mpu6000")
    for words in ("count / gyr_range deg/s", "V DS-6050", "WHO_AM_I", "PS-MPU-6000A-00", "--sensors mpu6000"):
        assert words in out
    bound, _ = ok("devices", "mpu6000", "--option", "gyr_range=500 deg/s")
    assert "count / 65.5 deg/s" in bound
    assert json.loads(ok("devices", "rion", "--json")[0])["framing"]["sync"] == ["68", "77"]
    assert ok("devices", "mpu6000", "--markdown")[0].startswith("# mpu6000\n")


@pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler")
def test_the_printed_header_compiles(tmp_path):
    (tmp_path / "buoy.h").write_text(ok("devices", "buoy", "--c")[0])
    (tmp_path / "main.c").write_text('#include "buoy.h"\nint main(void) { plumbob_buoy f; plumbob_buoy_seal(&f); }\n')
    done = subprocess.run(
        ["cc", "-std=c11", "-Wall", "-Werror", "-Wno-unused-function", "-c", "main.c"],
        cwd=tmp_path, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr


def test_the_page_of_devices_is_up_to_date():
    """Otherwise: plumbob devices --markdown > docs/devices.md."""
    assert (ROOT / "docs" / "devices.md").read_text(encoding="utf-8") == ok("devices", "--markdown")[0]


def test_sim_warms_up_as_a_rig_does(tmp_path):
    from plumbob import read, read_array

    warm = ("--frame", "NED", "--duration", "3s", "--rate", "50Hz", "--warm-up", "15 K, 1 s")
    ok("sim", "static", *warm, "--set", "temp_c=20degC", "--out", "a.parquet", cwd=tmp_path)
    imu = read(tmp_path / "a.parquet").imu
    np.testing.assert_allclose(imu.temp_c, 20.0 + 15.0 * (1.0 - np.exp(-imu.t)), atol=1e-5)
    ok("sim", "teach", *warm, "--out", "b.parquet", cwd=tmp_path)
    for one in read_array(tmp_path / "b.parquet").units.values():
        np.testing.assert_allclose(one.temp_c, 25.0 + 15.0 * (1.0 - np.exp(-one.t)), atol=1e-5)
