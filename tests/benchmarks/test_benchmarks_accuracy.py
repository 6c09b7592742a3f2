"""The page of accuracy: what is drawn, what is chosen, and how it is written."""

import re

import pytest

from benchmarks import accuracy
from plumbob.filters.smoother.model import Params


def test_drawn_parameters_are_all_there_are_times_a_half_to_two():
    usual = Params()
    found = list(accuracy.drawn(200))
    assert found == list(accuracy.drawn(200))
    assert set(found[0]) == {name for name in Params._fields if isinstance(getattr(usual, name), float)} - {"latency"}
    for name in found[0]:
        factors = [params[name] / getattr(usual, name) for params in found]
        assert min(factors) < 0.6  # of 200 draws, log-uniform: one of 10^25 tries fails
        assert max(factors) > 1.7
        assert all(0.5 <= factor <= 2.0 for factor in factors)


def test_what_is_best_on_one_half_is_judged_on_the_other():
    """The first set is best on the first recordings and worst on the second, the second the other way round."""
    usual, first, second = ({name: pair for name in accuracy.SETS} for pair in ([1.0, 1.0], [0.5, 2.0], [1.5, 0.8]))
    text = accuracy.choice_text({"sets": [usual, first, second]})
    assert re.findall(r"\| BROAD, (\w+) recordings \| 1.00 \| (.*) \|$", text, re.MULTILINE) == [
        ("even", "2.00 | 0.80 | +100%"),
        ("odd", "1.50 | 0.50 | +50%"),
    ]


@pytest.mark.parametrize("name", accuracy.SETS)
def test_each_set_has_its_recordings(name, broad_folder):
    """As many as the page says; a phone's recording is in one of its sets."""
    count = dict(zip(accuracy.SETS, (15, 8, 14, 20, 5, 5, 6, 2, 3, 1), strict=True))
    assert len(list(broad_folder.parent.glob(accuracy.SETS[name][0]))) == count[name]
