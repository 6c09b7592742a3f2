"""Before and after: table, dictionary, page and picture."""

import json

import numpy as np
import pytest
from scipy.signal import lfilter

from plumbob.core.units import Quantity, dps
from plumbob.noise import Compared, compare
from plumbob.noise.report import comparison, comparison_numbers
from tests.helpers.page_battery import HOSTILE, PageBattery


@pytest.fixture(scope="module")
def found():
    """White noise of 0.1 °/s at 10 Hz before and after a filter of first order of 1 s."""
    raw = dps(0.1 * np.random.default_rng(0).standard_normal(20_000))
    keep = np.exp(-0.1)
    smooth = lfilter([1.0 - keep], [1.0, -keep], raw)
    return [Compared("gyr x", Quantity.RATE, compare(raw, smooth, 0.1))]


@pytest.fixture(scope="module")
def text(found):
    return comparison([found[0]._replace(name=HOSTILE)], facts=[(HOSTILE, HOSTILE)]).page()


class TestComparisonPage(PageBattery):
    pass


def test_the_table_has_both_deviations_and_their_ratio(found):
    lines = comparison(found).text().splitlines()
    assert lines[2:5] == ["gyr x", "", "oadev [°/h], ratio with its 68.3 % interval"]
    row = next(line.split() for line in lines if line.startswith("0.100"))
    before, after, ratio = map(float, row[1:4])
    assert before == pytest.approx(360.0, rel=0.02)
    assert ratio == pytest.approx(after / before, rel=0.01)
    assert "- between the two lies a filter of first order with a time constant of" in " ".join(lines)
    assert max(map(len, lines)) <= 80


def test_the_dictionary_is_strict_json(found):
    one = comparison_numbers(found)["gyr x"]
    assert json.loads(json.dumps(one, allow_nan=False)) == one
    assert one["time_constant_s"] == pytest.approx(1.0, rel=0.05)
    assert one["bent_below_s"] == pytest.approx(10.0 * one["time_constant_s"])
    assert len(one["ratio"]) == len(one["before"]["n"]) == len(one["after"]["n"])


def test_the_picture(found, tmp_path):
    picture = comparison(found).plot(tmp_path / "x.png")
    assert picture.read_bytes()[:4] == b"\x89PNG"
