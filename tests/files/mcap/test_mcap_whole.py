"""A recording of rows that are there already: one complete file, whatever its length, for every reader."""

import pytest

from plumbob.core.errors import ParameterError
from plumbob.files.mcap import verify
from plumbob.files.mcap.verdict import CHUNK_NS, write_rows
from tests.helpers.record_samples import DECODED, OFFSET, RAW, SCHEMA, library_rows, payload, read

TOPICS = {RAW: ("application/octet-stream", None), DECODED: ("json", SCHEMA)}


def rows(count, step_ns):
    return [(i * step_ns, topic, payload(i)) for i in range(count) for topic in TOPICS]


@pytest.mark.parametrize(("count", "step_ns"), [(0, 1), (1, 1), (500, CHUNK_NS // 100), (50, 3 * CHUNK_NS)])
def test_what_goes_in_comes_out_by_both_readers(tmp_path, count, step_ns):
    given = rows(count, step_ns)
    write_rows(tmp_path / "a.mcap", TOPICS, given, epoch_offset_ns=OFFSET, metadata={"owner": "x"})
    log, got = read(tmp_path / "a.mcap")
    assert [(topic, t_ns, data) for topic, _, t_ns, data in got] == [(topic, t_ns, data) for t_ns, topic, data in given]
    assert got == library_rows(tmp_path / "a.mcap")
    assert verify(tmp_path / "a.mcap").whole
    assert log.metadata == {"owner": "x"}
    assert [path.name for path in tmp_path.iterdir()] == ["a.mcap"]


def test_a_time_that_mcap_cannot_hold_is_refused_and_nothing_is_left(tmp_path):
    with pytest.raises(ParameterError, match=r"a time of -1 s cannot be stored in MCAP"):
        write_rows(tmp_path / "a.mcap", TOPICS, [(-(10**9), RAW, b"")], epoch_offset_ns=0, metadata={})
    assert list(tmp_path.iterdir()) == []
