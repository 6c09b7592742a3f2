"""A recorder that is started again goes on with the next part; all parts are read as one recording."""

import os
from pathlib import Path

import pytest

from plumbob.core.errors import ParameterError
from plumbob.files.mcap import Recorder, layout, open_log, repair, verify, writer
from plumbob.files.mcap.log import UNKNOWN_NS
from tests.helpers.io_samples import put, refused
from tests.helpers.record_samples import RAW, channels, fill, payload, recorder, rows_of

HOUR = 3600 * 10**9
UTC = 1_773_500_966_123_456_789  # date -u -d @1773500966 is 2026-03-14 15:09:26


@pytest.fixture
def boots(monkeypatch):
    """The machine is started anew; gives what does that."""

    def begin(word):
        monkeypatch.setattr(writer, "boot_id", lambda: word)

    begin("first")
    return begin


def start(path, begin, end, *, offset=HOUR, first_ns=0, session="s", crash=False):
    """Record the rows `begin` to `end` of 10 ms each, and perhaps die without an end; gives the recorder."""
    r = Recorder(path, epoch_offset_ns=offset, reserve=0, next_part=True)
    r.metadata |= {"session": session, "plumbob": f"version {begin}"}
    with r:
        number = r.channel(RAW, "application/octet-stream")
        for i in range(begin, end):
            r.write(number, first_ns + (i - begin) * 10_000_000, payload(i))
    if crash:  # whole chunks and no end, as a killed process leaves it
        raw = r.path.read_bytes()
        r.path.write_bytes(raw[: raw.index(b"\x07\x00\x00\x00plumbob", 200) - 9])
    return r


def data_of(path):
    rows = list(open_log(path))
    assert [row.sequence for row in rows] == list(range(len(rows)))
    return [row.data for row in rows]


def test_starts_are_one_recording(tmp_path, boots):
    path = tmp_path / "a.mcap"
    assert start(path, 0, 25, crash=True).follows is None
    before = path.read_bytes()
    second = start(path, 25, 60, first_ns=HOUR, crash=True)
    assert (second.path.name, second.follows, second.alone) == ("a.0002.mcap", path, False)
    start(path, 60, 80, first_ns=2 * HOUR)
    assert path.read_bytes() == before
    assert [p.name for p in layout.existing_parts(path)] == ["a.mcap", "a.0002.mcap", "a.0003.mcap"]
    assert data_of(path) == data_of(tmp_path) == [payload(i) for i in range(80)]
    assert open_log(path).starts == 3
    verdict = verify(path)
    assert (verdict.clean, verdict.lossy, verdict.rows) == (False, False, {RAW: 80})
    assert verdict.duration == pytest.approx(2 * 3600 + 0.19)  # the rows of the last start end .19 s after it


def test_a_rotated_recording_goes_on_behind_its_last_part(tmp_path, boots):
    path = tmp_path / "a.mcap"
    with recorder(path, rotate=0.2) as r:
        fill(r, channels(r), 60)
    count = len(layout.existing_parts(path))
    assert count == 3  # .6 s
    with recorder(path, rotate=0.2, next_part=True) as r:
        fill(r, channels(r), 60)
    assert len(layout.existing_parts(path)) == 2 * count
    log = open_log(path)
    assert [row[1] for row in rows_of(log) if row[0] == RAW] == list(range(120))
    assert (log.lost, log.damage, log.clean) == ({}, [], True)


def test_repair_makes_one_file_of_all_starts(tmp_path, boots):
    for begin, end in ((0, 25), (25, 60), (60, 80)):
        boots(f"boot {begin}")
        start(tmp_path / "a.mcap", begin, end, offset=HOUR + begin * 10**9, crash=True)
    rows = rows_of(open_log(tmp_path / "a.mcap"))
    repair(tmp_path / "a.mcap", tmp_path / "b.mcap")
    assert rows_of(open_log(tmp_path / "b.mcap")) == rows
    assert verify(tmp_path / "b.mcap").whole


@pytest.mark.parametrize(
    ("offset", "expected"),
    [
        (2 * HOUR, 2 * HOUR - HOUR),  # the monotonic clock of the second boot began an hour after that of the first
        (0, 24 * 10_000_000 + UNKNOWN_NS),  # wall clock not set at boot: behind the last row
    ],
)
def test_after_a_reboot_times_go_on_by_the_wall_clock(tmp_path, boots, offset, expected):
    start(tmp_path / "a.mcap", 0, 25)
    boots("second")
    start(tmp_path / "a.mcap", 25, 50, offset=offset)
    log = open_log(tmp_path / "a.mcap")
    times = [row.t_ns for row in log]
    assert times[:25] == [i * 10_000_000 for i in range(25)]
    assert times[25:] == [expected + i * 10_000_000 for i in range(25)]
    assert log.shift_ns == expected


def test_in_one_boot_a_step_of_the_wall_clock_moves_nothing(tmp_path, boots):
    start(tmp_path / "a.mcap", 0, 25, offset=0)  # in 1970
    start(tmp_path / "a.mcap", 25, 50, offset=UTC, first_ns=HOUR)
    assert [row.t_ns for row in open_log(tmp_path / "a.mcap")][25] == HOUR


def test_starts_of_one_later_boot_keep_their_distance_when_its_clock_is_set(tmp_path, boots):
    """A board without a clock: after the reboot in 1970, at the next start in the present."""
    start(tmp_path / "a.mcap", 0, 25, offset=UTC)
    boots("second")
    start(tmp_path / "a.mcap", 25, 50, offset=0)
    start(tmp_path / "a.mcap", 50, 75, offset=2 * UTC, first_ns=HOUR)
    times = [row.t_ns for row in open_log(tmp_path / "a.mcap")]
    assert times[25] == times[24] + UNKNOWN_NS
    assert times[50] - times[25] == HOUR


@pytest.mark.parametrize("left", [b"", b"\x89MCAP0\r\n", b"no recording at all", None])
def test_a_damaged_part_is_left_as_it_is(tmp_path, boots, left):
    """Also one that a power cut left empty, or of which the beginning is gone."""
    path = tmp_path / "a.mcap"
    start(path, 0, 25)
    start(path, 25, 50)
    broken = tmp_path / "a.0002.mcap"
    raw = bytearray(broken.read_bytes())
    raw[:200] = bytes(200)
    broken.write_bytes(raw if left is None else left)
    before = broken.read_bytes()
    assert start(path, 50, 75).path.name == "a.0003.mcap"
    assert broken.read_bytes() == before
    log = open_log(path)
    found = [row.data for row in log]
    kept = range(75) if left is None else [*range(25), *range(50, 75)]
    assert found == [payload(i) for i in kept]
    assert log.damage  # of it, or behind it that nothing is left of it


def test_an_empty_first_part_is_followed(tmp_path, boots):
    start(put(tmp_path / "a.mcap", b""), 0, 25)
    assert data_of(tmp_path / "a.mcap") == [payload(i) for i in range(25)]


def test_another_session_is_recorded_but_not_read_together(tmp_path, boots):
    """A buoy goes on recording after its session was changed; nobody decodes both with one of them."""
    path = tmp_path / "a.mcap"
    start(path, 0, 25)
    other = start(path, 25, 50, session="another")
    assert other.alone
    again = start(path, 50, 75, session="another")
    assert not again.alone
    refused(open_log, path, match=r"a\.0002\.mcap does not go on from the part before it")
    assert data_of([other.path, again.path]) == [payload(i) for i in range(25, 75)]


def test_a_next_part_is_refused_as_the_first_is(tmp_path, boots):
    path = tmp_path / "a.mcap"
    start(path, 0, 25)
    refused(recorder(path).start, match=r"exists already.*ask for the next part", error=ParameterError)
    r = recorder(path, next_part=True, reserve=1 << 60).start()  # it waits for room
    assert r.state == "stopped"
    r.close()
    assert "has stopped" in r.take_events()[0].text
    assert layout.existing_parts(path) == [path]
    with recorder(tmp_path / "b.mcap"):
        second = recorder(tmp_path / "b.mcap", next_part=True)
        refused(second.start, match="is being recorded", error=ParameterError)


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_the_next_part_needs_permission_as_the_first_does(tmp_path, boots):
    start(tmp_path / "a.mcap", 0, 25)
    tmp_path.chmod(0o500)
    refused(recorder(tmp_path / "a.mcap", next_part=True).start, match="Permission denied")
    tmp_path.chmod(0o700)
    assert layout.existing_parts(tmp_path / "a.mcap") == [tmp_path / "a.mcap"]


def test_parts_of_others_and_parts_that_are_not_there(tmp_path, boots):
    """Two recordings of several starts in one folder are not one."""
    for name in ("a.mcap", "b.mcap"):
        start(tmp_path / name, 0, 10)
        start(tmp_path / name, 10, 20)
    refused(open_log, tmp_path, match="several recordings")
    assert data_of(tmp_path / "a.mcap") == [payload(i) for i in range(20)]
    for begin in (0, 25, 50):
        start(tmp_path / "a.mcap", begin, begin + 25)
    (tmp_path / "a.0002.mcap").unlink()
    verdict = verify(tmp_path / "a.mcap")
    assert verdict.lossy
    assert "parts 2 to 2 of the recording are not here, or are empty" in verdict.damage[0].what


def test_names_of_parts_and_starts(tmp_path):
    assert layout.dated("logs/buoy-{utc}.mcap", UTC) == "logs/buoy-20260314T150926Z.mcap"
    assert layout.dated("{utc}.mcap", 0) == "19700101T000000Z.mcap"
    assert layout.dated("a.mcap", UTC) == "a.mcap"
    made = [layout.dated("{utc}", UTC + k * 10**9) for k in (0, 1, 40, 86400, 400 * 86400)]
    assert made == sorted(made)
    refused(layout.dated, "{time}.mcap", UTC, match=r"but not \{time\}", error=ParameterError)
    path = Path(tmp_path / "a.txt")
    assert layout.next_path(path) == path
    path.touch()
    assert layout.next_path(path).name == "a.0002.txt"
    (tmp_path / "a.0009.txt").touch()
    assert layout.next_path(path).name == "a.0010.txt"
