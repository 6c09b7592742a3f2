"""From a recording to an attitude: covariances over chunks, and noise cards to those filters that take one."""

import pytest

from plumbob import Filter, Frame, NoiseCard
from plumbob.core.errors import ParameterError
from plumbob.data import UNCALIBRATED
from plumbob.data.cards import TriadNoise
from plumbob.filters import filter_names, load, takes_noise
from plumbob.filters.offline import CHUNK, Stage, run_stage, with_noise
from tests.helpers.motion import noisy

CARD = NoiseCard("unit 7", "a test", gyr=TriadNoise([1e-4] * 3, [0.0] * 3, [2e-5] * 3))


def test_what_filters_offer_is_what_their_files_hold_and_cards_go_to_those_that_take_one():
    assert [name for name in filter_names() if hasattr(load(name), "COVARIANCE")] == ["ekf7", "mekf"]
    assert [name for name in filter_names() if takes_noise(name)] == ["ekf7", "mekf"]
    assert all(hasattr(load(name), "COVARIANCE") is hasattr(load(name), "covariance") for name in filter_names())
    stages = [Stage("mekf", {"mag": False}, "a"), Stage("mahony", {}, "b"), Stage("mekf", {}, "c")]
    given = with_noise(stages, CARD)
    assert [stage.noise for stage in given] == [CARD, None, CARD]
    assert [(stage.name, stage.params) for stage in given] == [(stage.name, stage.params) for stage in stages]
    assert run_stage(noisy(CHUNK + 100), given[1], frame=Frame.ENU).cov_b is None
    with pytest.raises(ParameterError, match="mahony has no parameter that a noise card could give"):
        run_stage(noisy(), with_noise([Stage("mahony", {})], CARD)[0], frame=Frame.ENU)


@pytest.mark.parametrize("name", ["ekf7", "mekf"])
def test_a_covariance_goes_on_over_chunks_and_a_card_sets_the_noise_but_parameters_have_the_last_word(name):
    data = noisy(CHUNK + 100)
    track = run_stage(data, Stage(name, {}), frame=Frame.ENU)
    whole = Filter(name, frame=Frame.ENU).process(data, covariance=True)
    assert track.cov_b.shape == (len(data), 3, 3)
    assert track.q_nb.tobytes() == whole.q_nb.tobytes()
    assert track.cov_b.tobytes() == whole.cov_b.tobytes()
    data, field = noisy(), {"ekf7": "gyro_noise", "mekf": "gyr_noise"}[name]
    given = {field: 3e-4}
    for params in ({}, given):
        track = run_stage(data, Stage(name, params, noise=CARD), frame=Frame.ENU)
        made = Filter(name, frame=Frame.ENU, params=params, noise=CARD)
        assert track.source == f"{made.describe()}; calibration {UNCALIBRATED}"
        assert getattr(made.params, field) == pytest.approx(params.get(field, 1e-4), rel=1e-15)
