"""A card on single samples: the bits of a calibrated recording, in `correct`, in a filter and in the smoother live."""

import json

import numpy as np
import pytest

import plumbob
from plumbob.core.errors import CalibrationError
from plumbob.data import ImuData, ImuMeta
from plumbob.data.calibrated import apply_card
from plumbob.data.cards import CalibrationCard, TriadCalibration
from plumbob.data.cards.calibration import Mount
from plumbob.data.sample import ImuSample

N = 600
RNG = np.random.default_rng(5)


def triad(unit, **terms):
    matrix = np.eye(3) + 0.02 * RNG.normal(size=(3, 3))
    return TriadCalibration(matrix=matrix, bias=0.01 * RNG.normal(size=3), unit_in=unit, unit_out=unit, **terms)


WARM = {"bias_per_k": 1e-3 * RNG.normal(size=(2, 3)), "temp_ref_c": 25.0, "temp_span_c": (10.0, 30.0)}
SENSITIVE = {"g_sensitivity": 1e-3 * RNG.normal(size=(3, 3))}
PARTS = {
    "all": {"gyr": triad("rad/s"), "acc": triad("m/s2"), "mag": triad("uT")},
    "gyroscope alone": {"gyr": triad("rad/s")},
    "temperature": {"gyr": triad("rad/s", **WARM), "acc": triad("m/s2", **WARM)},
    "g-sensitivity": {"gyr": triad("rad/s", **SENSITIVE), "acc": triad("m/s2")},
    "of the raw force": {"gyr": triad("rad/s", **SENSITIVE, **WARM)},
    "mounted": {"acc": triad("m/s2"), "mount": Mount(q_bs=np.array([0.5, 0.5, -0.5, 0.5]))},
}


def card(name):
    return CalibrationCard(device="unit 1", date="2026-01-01", method="test", **PARTS[name])


def measured(**more):
    t = np.arange(N) * 0.01
    acc = np.column_stack([0.3 * np.sin(t), 0.2 * np.cos(t), 9.8 + 0.01 * RNG.normal(size=N)])
    mag = np.column_stack([20.0 + RNG.normal(size=N), RNG.normal(size=N), np.full(N, -42.0)])
    mag[::2] = np.nan  # a slower magnetometer
    given = {"gyr": RNG.normal(0, 0.2, (N, 3)), "acc": acc, "mag": mag, "temp_c": 20.0 + 20.0 * np.sin(t)}
    return ImuData(t=t, meta=ImuMeta(device="unit 1"), **given | more)


@pytest.mark.parametrize("name", PARTS)
def test_single_samples_are_corrected_to_the_bits_of_a_recording(name):
    data, by = measured(), card(name)
    whole = apply_card(by, data)
    single = [by.correct(sample) for sample in data.samples()]
    values = np.array([sample.values for sample in single])
    np.testing.assert_array_equal(values, np.column_stack([whole.gyr, whole.acc, whole.mag]))
    np.testing.assert_array_equal([sample.t_ns for sample in single], data.t_ns)
    np.testing.assert_array_equal(by.correct(data).gyr, whole.gyr)


@pytest.mark.parametrize("name", PARTS)
def test_filter_with_a_card_takes_raw_samples_as_a_filter_without_one_takes_calibrated_ones(name):
    data, by = measured(), card(name)
    whole = apply_card(by, data)
    raw, plain = plumbob.Filter("mekf", frame="ENU", calibration=by), plumbob.Filter("mekf", frame="ENU")
    for sample in data.samples():
        raw.update(sample)
    track = plain.process(whole, look=False)
    np.testing.assert_array_equal(raw.q_nb, track.q_nb[-1])
    np.testing.assert_array_equal(raw.cov_b, plain.cov_b)
    raw.reset()
    np.testing.assert_array_equal(raw.process(data, look=False).q_nb, track.q_nb)


def test_filter_with_a_card_goes_on_where_it_was_saved():
    data = measured()
    samples = list(data.samples())
    through = plumbob.Filter("mekf", frame="ENU", calibration=card("temperature"))
    for sample in samples[:300]:
        through.update(sample)
    again = plumbob.Filter.restore(json.loads(json.dumps(through.save())))
    for sample in samples[300:]:
        assert through.update(sample) == again.update(sample)
    np.testing.assert_array_equal(through.q_nb, again.q_nb)


def test_smoother_live_with_a_card_is_that_of_calibrated_samples():
    data, by = measured(), card("all")
    whole = apply_card(by, data)
    raw = plumbob.FixedLag(frame="ENU", calibration=by)
    plain = plumbob.FixedLag(frame="ENU", meta=whole.meta)
    for sample, corrected in zip(data.samples(), whole.samples(), strict=True):
        assert raw.update(sample) == plain.update(corrected)
    np.testing.assert_array_equal(raw.q_nb, plain.q_nb)
    parts = plumbob.FixedLag(frame="ENU", calibration=by), plumbob.FixedLag(frame="ENU")
    np.testing.assert_array_equal(parts[0].take(data).q_nb, parts[1].take(whole).q_nb)


def test_a_sample_without_the_force_or_the_temperature_that_the_card_needs():
    sample = ImuSample(0, gyr=[0.1, 0.2, 0.3], acc=[np.nan] * 3)
    assert np.isnan(card("g-sensitivity").correct(sample).gyr).all()
    assert np.isfinite(card("all").correct(sample).gyr).all()
    with pytest.raises(CalibrationError, match="corrects for temperature, but the sample has no temp_c"):
        card("temperature").correct(ImuSample(0, gyr=[0.1, 0.2, 0.3], acc=[0.0, 0.0, 9.8]))
