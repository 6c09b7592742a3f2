"""A repair keeps every whole row, says what is missing, and its output opens everywhere."""

import random

import pytest
from mcap.writer import Writer

from plumbob.core.errors import ParameterError
from plumbob.files.mcap import layout, open_log, repair, verify
from tests.helpers import record_samples as made
from tests.helpers.io_samples import put, refused


def check(path, out, rows):
    """Repair, and repair that once more; returns the verdict and the rows that are left."""
    verdict = repair(path, out)
    log, got = made.read(out)
    assert got == made.library_rows(out)
    assert set(got) <= set(rows)
    assert verify(out).whole
    assert log.missing == {topic: count for topic, count in verify(out).dropped.items() if count}
    again = out.with_name("again.mcap")
    again.unlink(missing_ok=True)
    assert not repair(out, again).lossy
    assert again.read_bytes() == out.read_bytes()
    out.unlink()
    return verdict, got


def test_a_whole_recording_stays_as_it_is(tmp_path):
    rows = made.record(tmp_path / "a.mcap")
    verdict = repair(tmp_path / "a.mcap", tmp_path / "b.mcap")
    assert verdict.whole
    assert (tmp_path / "b.mcap").read_bytes() == (tmp_path / "a.mcap").read_bytes()
    assert made.rows_of(open_log(tmp_path / "b.mcap")) == rows


def cuts(raw, rng):
    return (raw[:size] for size in [0, 4, 8, 20, *rng.sample(range(len(raw)), 20)])


def flips(raw, rng):
    return (made.flipped(raw, rng.randrange(len(raw)), 1 << rng.randrange(8)) for _ in range(25))


def zeroed(raw, rng):
    """From a byte to most of the file, as a disk that lost its cache leaves them."""
    for _ in range(25):
        at = rng.randrange(len(raw))
        size = min(len(raw) - at, int(len(raw) ** rng.random()))
        yield raw[:at] + bytes(size) + raw[at + size :]


@pytest.mark.parametrize("damaged", [cuts, flips, zeroed])
def test_a_damaged_recording(tmp_path, damaged):
    rows = made.record(tmp_path / "a.mcap", count=40)
    bad = tmp_path / "c" / "a.mcap"
    bad.parent.mkdir()
    for raw in damaged((tmp_path / "a.mcap").read_bytes(), random.Random(2)):
        verdict, got = check(put(bad, raw), tmp_path / "out.mcap", rows)
        assert verdict.lossy >= (len(got) < len(rows)) or damaged is cuts
        if damaged is cuts:
            assert got == rows[: len(got)]
            assert not verdict.whole
        elif damaged is flips:
            assert verdict.lossy == (len(got) < len(rows)) or any(not d.certain for d in verdict.damage)
            assert sum(verdict.lost.values()) == len(rows) - len(got)


def test_a_crash_between_chunks_loses_nothing(tmp_path):
    """Cut after the last index: no end, but no torn row either."""
    rows = made.record(tmp_path / "a.mcap", count=40)
    raw = (tmp_path / "a.mcap").read_bytes()
    end = [at for opcode, at, _ in made.records_of(raw) if opcode == layout.Opcode.METADATA][1]
    verdict, got = check(put(tmp_path / "c.mcap", raw[:end]), tmp_path / "out.mcap", rows)
    assert got == rows
    assert (verdict.clean, verdict.lossy, verdict.damage) == (False, False, [])


def test_parts_become_one_file(tmp_path):
    rows = made.record(tmp_path / "a.mcap", count=100, rotate=0.25)
    assert repair(tmp_path / "a.mcap", tmp_path / "out.mcap").whole
    assert made.read(tmp_path / "out.mcap")[1] == rows
    (tmp_path / "a.0002.mcap").unlink()
    verdict, got = check(tmp_path / "a.mcap", tmp_path / "b.mcap", rows)
    assert verdict.lossy
    assert len(got) == len(rows) - 60


def test_a_later_part_alone_is_repaired_alone(tmp_path):
    rows = made.record(tmp_path / "a.mcap", count=100, rotate=0.25)
    verdict, got = check(tmp_path / "a.0003.mcap", tmp_path / "b.mcap", rows)
    assert verdict.whole
    assert got == [row for row in rows if 60 <= row[1] < 90]


def test_a_part_whose_name_is_lost_has_one_of_as_many_digits_again(tmp_path):
    assert open_log(put(tmp_path / "a.mcap", layout.MAGIC)).recording == ""
    repair(tmp_path / "a.mcap", tmp_path / "b.mcap")
    assert len(open_log(tmp_path / "b.mcap").recording) == 32


def test_refusals(tmp_path):
    whole, out = tmp_path / "a.mcap", tmp_path / "b.mcap"
    made.record(whole)
    refused(repair, whole, whole, match=r"a\.mcap exists already", error=ParameterError)
    refused(repair, whole, tmp_path / "no" / "b.mcap", match="cannot be written")
    with (tmp_path / "f.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start(library="another")
        writer.finish()
    refused(repair, tmp_path / "f.mcap", out, match="written by another program", error=ParameterError)
    with made.recorder(tmp_path / "r.mcap") as r:
        made.fill(r, made.channels(r), 20)
        refused(repair, tmp_path / "r.mcap", out, match="still being recorded", error=ParameterError)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.mcap", "f.mcap", "r.mcap"]


def test_a_verdict_names_rows_time_and_losses(tmp_path):
    made.record(tmp_path / "a.mcap", count=40)
    raw = (tmp_path / "a.mcap").read_bytes()
    verdict = verify(put(tmp_path / "a.mcap", made.flipped(raw, made.chunks_of(raw)[1][0] + 60)))
    assert verdict.lost == {made.RAW: 10, made.DECODED: 10}
    assert verdict.rows == {made.RAW: 30, made.DECODED: 30}
    assert verdict.duration == pytest.approx(0.39)
    assert (verdict.whole, verdict.lossy, verdict.clean) == (False, True, True)
    assert verdict.summary()["damage"][0]["lost"] == {made.RAW: 10, made.DECODED: 10}
