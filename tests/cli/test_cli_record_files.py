"""verify and repair as a user meets them: exit codes 0, 3 and 1, text and JSON."""

import json

import pytest

from plumbob.files.mcap import Recorder
from tests.helpers.commandline import plumbob


@pytest.fixture
def whole(tmp_path):
    path = tmp_path / "a.mcap"
    r = Recorder(path, epoch_offset_ns=0, reserve=0)
    number = r.channel("raw/imu", "application/octet-stream")
    with r:
        for i in range(50):
            r.write(number, i * 10_000_000, bytes([i]) * 20)
    return path


@pytest.fixture
def damaged(whole, tmp_path):
    """One byte in the second chunk is wrong: ten rows are gone."""
    raw = bytearray(whole.read_bytes())
    second = raw.index(b"zstd", raw.index(b"zstd") + 4)
    raw[second + 30] ^= 1
    path = tmp_path / "bad.mcap"
    path.write_bytes(raw)
    return path


@pytest.fixture
def unfinished(whole, tmp_path):
    """As a crash leaves it: whole chunks and no end."""
    raw = whole.read_bytes()
    path = tmp_path / "cut.mcap"
    path.write_bytes(raw[: raw.index(b"\x07\x00\x00\x00plumbob", 200) - 9])
    return path


def test_whole(whole, tmp_path):
    done = plumbob("verify", whole)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.splitlines() == [
        "a.mcap: 50 rows in 0.490 s",
        "rows         raw/imu: 50",
        "ended        properly",
        "verdict      whole",
    ]
    assert plumbob("repair", whole, "--out", tmp_path / "b.mcap").returncode == 0
    assert (tmp_path / "b.mcap").read_bytes() == whole.read_bytes()


def test_damaged(damaged, tmp_path):
    done = plumbob("verify", damaged)
    assert done.returncode == 3
    assert "lost         raw/imu: 10 rows missing" in done.stdout
    assert "note: 'plumbob repair'" in done.stderr
    done = plumbob("repair", damaged, "--out", tmp_path / "b.mcap")
    assert done.returncode == 3
    done = plumbob("verify", tmp_path / "b.mcap")
    assert done.returncode == 0
    assert "dropped      raw/imu: 10 rows" in done.stdout
    assert plumbob("repair", tmp_path / "b.mcap", "--out", tmp_path / "c.mcap").returncode == 0
    assert (tmp_path / "b.mcap").read_bytes() == (tmp_path / "c.mcap").read_bytes()


def test_unfinished(unfinished, tmp_path):
    done = plumbob("verify", unfinished)
    assert done.returncode == 3
    assert "ended        NOT properly" in done.stdout
    assert "no row that had been written is missing" in done.stdout
    assert plumbob("repair", unfinished, "--out", tmp_path / "b.mcap").returncode == 0
    assert plumbob("verify", tmp_path / "b.mcap").returncode == 0


def test_json(damaged, tmp_path):
    found = json.loads(plumbob("verify", damaged, "--json").stdout)
    assert (found["whole"], found["clean"], found["lost"], found["rows"]) == (
        False, True, {"raw/imu": 10}, {"raw/imu": 40},
    )  # fmt: skip
    assert found["damage"][0]["lost"] == {"raw/imu": 10}
    found = json.loads(plumbob("repair", damaged, "--out", tmp_path / "b.mcap", "--json").stdout)
    assert (found["lossy"], found["out"]) == (True, str(tmp_path / "b.mcap"))


def test_what_cannot_be_read_is_one_line_and_exit_1(whole, tmp_path):
    (tmp_path / "text.mcap").write_text("hello, world")
    for words, told in (
        (("verify", tmp_path / "text.mcap"), "is not an MCAP file"),
        (("verify", tmp_path / "none.mcap"), "no such file"),
        (("repair", whole, "--out", whole), "is an input"),
        (("repair", tmp_path / "none.mcap", "--out", tmp_path / "b.mcap"), "no such file"),
    ):
        done = plumbob(*words)
        assert done.returncode == 1
        assert done.stdout == ""
        assert len(done.stderr.splitlines()) == 1
        assert told in done.stderr


def test_help_says_what_3_means():
    assert "3 done, but a recording is damaged" in plumbob("--help").stdout
    assert "3 damaged" in plumbob("verify", "--help").stdout
    assert "3 repaired, but rows are lost" in plumbob("repair", "--help").stdout


def test_an_empty_file_claims_nothing(tmp_path):
    (tmp_path / "a.mcap").touch()
    done = plumbob("verify", tmp_path / "a.mcap")
    assert done.returncode == 3
    assert done.stdout.splitlines()[-1] == "verdict      not complete, and no row is in it"
