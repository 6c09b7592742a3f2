"""A transport that sends a block of frames twice: taken once, whatever tells the time, and counted."""

import numpy as np
import pytest

from plumbob.core import flags
from tests.helpers import live_samples
from tests.helpers.live_samples import SESSION, reads, session, stream

FRAME, AT = 30, 900
SERIAL = '[source]\nkind = "serial"\nport = "/dev/null"\nbaud = 115200\ntime = "count"\n'


def through(data, text=SESSION):
    return live_samples.through(reads(data), session(text))


@pytest.fixture(scope="module", params=[SESSION, SESSION + SERIAL], ids=["by the host", "counted"])
def once(request):
    return request.param, through(stream(), request.param)[1]


def twice(count):
    data, block = stream(), slice(FRAME * AT, FRAME * (AT + count))
    return data[: block.stop] + data[block] + data[block.stop :]


@pytest.mark.parametrize("count", [2, 5, 50])
def test_a_block_that_comes_again_is_left_out(once, count):
    text, single = once
    line, found = through(twice(count), text)
    imu, clean = found.imu(calibrated=False), single.imu(calibrated=False)
    assert len(imu) == len(clean) == 2000
    np.testing.assert_array_equal(imu.gyr, clean.gyr)
    np.testing.assert_array_equal(np.diff(found.t_ns), np.diff(single.t_ns))
    assert not (imu.flags & np.uint32(flags.GAP | flags.TIME_FAULT)).any()
    np.testing.assert_array_equal(found.track().q_nb, single.track().q_nb)
    time = line.time_report()
    assert (time.frames, time.duplicates, time.late, time.resets) == (2000 + count, count, 0, 0)
    assert line.report()["not_usable"] == count


def test_a_device_that_begins_again_is_not_a_block_sent_twice():
    """The counter and the clock go back, and the values are others."""
    data = stream()
    line, found = through(data[FRAME * 1000 :] + data[: FRAME * 1000])
    assert line.time_report().resets == 1
    assert len(found.imu(calibrated=False)) > 1990
