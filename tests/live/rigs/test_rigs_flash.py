"""The log in Flash loses, wears and comes back as its sizes say."""

import numpy as np
import pytest

from plumbob import decode, find_format
from plumbob.live.rigs.flash import YEAR_S, FlashLog
from plumbob.protocols.encode import encode
from plumbob.protocols.ring import read_ring

FORM = find_format("buoy_attitude")
SECTOR = 4096 // 32  # records of 32 bytes in a sector of 4096


def records(count, first=0):
    numbers = first + np.arange(count)
    return encode(FORM, {"counter": numbers, "roll": np.linspace(-1.0, 1.0, count)})


def counters(stream):
    return decode(stream, FORM).frames[FORM.name].columns["counter"].astype(int)


def test_what_was_written_is_read_in_its_order():
    log = FlashLog(size=4 * 4096)
    log.write(records(200))
    found = read_ring(log.image, FORM)
    assert (found.records, found.missing, found.torn) == (200, 0, 0)
    assert found.stream == records(200).tobytes()
    assert found.blank == 4 * 4096 - 200 * 32
    assert (log.written, log.lost, log.waiting) == (200, 0, 0)
    assert log.erases.sum() == 1  # the sector behind the full one


@pytest.mark.parametrize("sectors", [2, 5])
@pytest.mark.parametrize("count", [10_000, 7 * SECTOR, 7 * SECTOR + 9])
def test_a_ring_loses_whole_sectors_and_keeps_the_newest(sectors, count):
    """After each full sector one is erased: of k full ones, k − (sectors − 1) are gone, or none."""
    log = FlashLog(size=sectors * 4096)
    log.write(records(count))
    written = count // 8 * 8  # a page holds 8
    full = written // SECTOR
    assert log.waiting == count - written
    assert log.lost == SECTOR * max(full - (sectors - 1), 0)
    assert log.written == written
    found = read_ring(log.image, FORM)
    assert found.records == written - log.lost
    assert found.missing == 0
    assert counters(found.stream).tolist() == list(range(log.lost, written))
    assert log.erases.tolist() == [(full - (i or sectors)) // sectors + 1 for i in range(sectors)]


def test_the_way_in_which_it_is_written_does_not_matter():
    whole, parts = FlashLog(size=3 * 4096), FlashLog(size=3 * 4096)
    rows = records(1000)
    whole.write(rows)
    for i in range(0, 1000, 7):
        parts.write(rows[i : i + 7].tobytes())
    assert whole.image == parts.image
    assert whole.erases.tolist() == parts.erases.tolist()


def test_wear_of_days_is_even_and_the_life_is_its_inverse():
    """Three days at 20 Hz into 1 MiB: 5 184 000 records, 40 500 sectors of 256, 158 rounds and a part."""
    log = FlashLog()
    rows = records(20 * 3600)
    for _ in range(72):
        log.write(rows)
    assert log.written == 5_184_000
    assert (log.erases.min(), log.erases.max()) == (40_500 // 256, 40_500 // 256 + 1)
    assert log.erases.sum() == 40_500
    days = 100_000 / (40_500 / 256 / 3.0)
    assert log.life_years(20.0) == pytest.approx(days * 86400.0 / YEAR_S, rel=1e-12)
    assert log.life_years(20.0) == pytest.approx(5.19, abs=0.01)


@pytest.mark.parametrize("programmed", [0, 1, 31, 32, 100, 5 * 32])
def test_power_loss_costs_the_page_in_hand_alone(programmed):
    """16 records lie in two pages, 5 wait; of these the first whole ones are there, and a torn one fails its check."""
    log = FlashLog(size=2 * 4096)
    log.write(records(21))
    log.cut(programmed)
    log.write(records(8, first=21))
    found = read_ring(log.image, FORM)
    kept = programmed // 32
    assert counters(found.stream).tolist() == [*range(16 + kept), *range(21, 29)]
    assert found.missing == 5 - kept
    assert (found.torn > 0) == (programmed % 32 > 0)
    assert found.torn <= programmed % 32  # a byte that is FF cannot be told from a blank one


def test_the_seam_is_found_where_the_counter_wraps():
    log = FlashLog(size=2 * 4096)
    log.write(records(24, first=(1 << 32) - 10))
    seam = counters(read_ring(log.image, FORM).stream)[[0, 9, 10, -1]]
    assert seam.tolist() == [(1 << 32) - 10, (1 << 32) - 1, 0, 13]
