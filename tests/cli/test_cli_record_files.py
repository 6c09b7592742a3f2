"""verify and repair as a user meets them: exit codes 0, 3 and 1, text and JSON."""

import pytest

from plumbob.files.mcap import Recorder
from tests.helpers.commandline import answer, typed


@pytest.fixture
def whole(tmp_path):
    path = tmp_path / "a.mcap"
    r = Recorder(path, epoch_offset_ns=0, reserve=0)
    number = r.channel("raw/imu", "application/octet-stream")
    with r:
        for i in range(50):
            r.write(number, i * 10_000_000, bytes([i]) * 20)
    return path


def damaged(whole):
    """One byte in the second chunk is wrong: ten rows are gone."""
    raw = bytearray(whole.read_bytes())
    second = raw.index(b"zstd", raw.index(b"zstd") + 4)
    raw[second + 30] ^= 1
    return bytes(raw)


def unfinished(whole):
    """As a crash leaves it: whole chunks and no end."""
    raw = whole.read_bytes()
    return raw[: raw.index(b"\x07\x00\x00\x00plumbob", 200) - 9]


def repaired(name, out, code, cwd):
    """Bytes of a repaired file, which is whole, and repairs to itself."""
    typed(f"verify {name} --repair {out}", cwd=cwd, code=code)
    assert answer(f"verify {out}", cwd=cwd)["whole"]
    typed(f"verify {out} --repair again.mcap --force", cwd=cwd)
    assert (cwd / "again.mcap").read_bytes() == (cwd / out).read_bytes()
    return (cwd / out).read_bytes()


def test_whole_and_unfinished(whole, tmp_path):
    done = typed("verify a.mcap", cwd=tmp_path)
    assert (done.stderr, done.stdout.splitlines()[0]) == ("", "a.mcap: 50 rows in 0.490 s")
    assert repaired("a.mcap", "b.mcap", 0, tmp_path) == whole.read_bytes()
    (tmp_path / "cut.mcap").write_bytes(unfinished(whole))
    done = typed("verify cut.mcap", cwd=tmp_path, code=3)
    assert "no row that had been written is missing" in done.stdout
    repaired("cut.mcap", "c.mcap", 0, tmp_path)


def test_damaged(whole, tmp_path):
    (tmp_path / "bad.mcap").write_bytes(damaged(whole))
    found = answer("verify bad.mcap", cwd=tmp_path, code=3)
    assert [found[key] for key in ("whole", "clean", "lost", "rows")] == [False, True, {"raw/imu": 10}, {"raw/imu": 40}]
    assert found["damage"][0]["lost"] == {"raw/imu": 10}
    assert "lost         raw/imu: 10 rows missing" in typed("verify bad.mcap", cwd=tmp_path, code=3).stdout
    repaired("bad.mcap", "b.mcap", 3, tmp_path)
    assert "dropped      raw/imu: 10 rows" in typed("verify b.mcap", cwd=tmp_path).stdout
    found = answer("verify bad.mcap --repair c.mcap", cwd=tmp_path, code=3)
    assert (found["lossy"], found["out"]) == (True, "c.mcap")


def test_an_empty_file_claims_nothing(tmp_path):
    (tmp_path / "a.mcap").touch()
    assert not answer("verify a.mcap", cwd=tmp_path, code=3)["whole"]
    done = typed("verify a.mcap", cwd=tmp_path, code=3)
    assert done.stdout.splitlines()[-1] == "verdict      not complete, and no row is in it"
