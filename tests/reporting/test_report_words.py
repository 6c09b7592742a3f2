"""Every label of every page has its Chinese word, and nothing else is changed."""

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

import plumbob
from plumbob.core import flags
from plumbob.core.units import Quantity
from plumbob.data.cards import CalibrationCard, Mount
from plumbob.filters import CommonParams, load
from plumbob.noise import ChannelComparison, compare
from plumbob.papers.fin_table import fin_report
from plumbob.papers.static_test import static_test
from plumbob.reporting.calibration import certificate
from plumbob.reporting.content import chinese_labels, said
from plumbob.reporting.evaluation import side_by_side
from plumbob.reporting.noise import NOISE, before_and_after
from tests.helpers.labels import labels

SIM = {"frame": "NED", "sensors": "mpu6000+hmc5983", "unit": "random", "seed": 1}
SYMBOLS = r"Gauss-Markov|\bPI\b|IEEE|BIC|Hz|RMS|rms|\[[^\]]*\]|\b[QNBKR] = \S+ .*"
"""What has no other word in Chinese: names, symbols, and values with their units."""


@pytest.fixture(scope="module")
def hand():
    """A simulated capture by hand, and what was found from it."""
    poses = plumbob.simulate("poses", **SIM)
    return poses, plumbob.calibrate(poses.imu, "hand")


def evaluations(_):
    sea = plumbob.simulate("buoy", duration=20.0, **(SIM | {"unit": "calibrated"}))
    track = plumbob.estimate(sea.imu, "mekf").track
    both = [plumbob.evaluate(track, sea.truth, align=align, settle=5.0) for align in ((), ("time", "heading"))]
    facts = [("files", ""), ("scenario", ""), ("sensors", ""), ("calibration", "")]
    return side_by_side(dict(zip("ab", both, strict=True)), facts=facts), both[0].report()


def certificates(hand):
    _, whole = hand
    gyr = {"bias_per_k": np.full((3, 3), 1e-5), "temp_span_c": (10.0, 40.0)}
    parts = {name: fit.calibration for name, fit in whole.fits.items()}
    warm = replace(parts["gyr"], **gyr)
    bare = replace(parts["acc"], matrix=np.eye(3), covariance=None, quality=None)
    card = CalibrationCard(
        "d", "2026-11-23", "m", gyr=warm, acc=bare, mag=parts["mag"], mount=Mount([1, 0, 0, 0], sd=np.ones(3))
    )
    fits = {**whole.fits, "gyr": replace(whole.fits["gyr"], calibration=warm)}
    return whole.report(recording="x"), certificate(card, fits)


def noise(_):
    still = plumbob.simulate("static", duration=60.0, **SIM).imu
    found = plumbob.allan(still, triads=("gyr", "acc"))
    raw = np.random.default_rng(0).standard_normal(5000)
    smooth = lfilter([0.1], [1.0, -0.9], raw)
    compared = before_and_after(
        [ChannelComparison("gyr x", Quantity.RATE, compare(raw, smooth, 0.1))], facts=[("before", "")]
    )
    alone = plumbob.allan(still.gyr[:, 0], rate=100, scale="1")
    return found.report(), fin_report(found.analyses), compared, alone.report()


def static(hand):
    poses, found = hand
    test = static_test(poses.imu, reference=poses.truth, calibration=found.card)
    return (test.report(facts=[("recording", ""), ("reference", "")]),)


@pytest.mark.parametrize("subject", [evaluations, certificates, noise, static])
def test_every_label_of_a_page_has_its_chinese_word(subject, hand):
    for report in subject(hand):
        names = ("a", "b", "values", "column", *load("mekf").Params._fields, *CommonParams._fields)
        left = {label: said(label, "zh") for label in labels(report, names=names)}
        assert not {k: v for k, v in left.items() if re.search("[A-Za-z]{2,}", re.sub(SYMBOLS, "", v))}


def test_so_have_flags_grades_and_kinds_of_noise():
    rare = {name for name, _ in flags.MEANING.values()} | {*NOISE.values()} | {"GOOD", "FAIR", "POOR", "NOT GRADED"}
    assert rare <= chinese_labels().keys()
    assert said("Directions covered: 17 / 18", "zh") == "覆盖方向: 17 / 18"
    assert said("deviation, 68.3 % interval", "zh") == "偏差, 68.3 % 置信区间"
    assert said("bias [°/s]", "zh") == "零偏 [°/s]"
    for text in ("unit 7: bias", "0.25 ± 0.01", "a sentence, with scale in it."):
        assert said(text, "zh") == text
    assert said("bias", "en") == "bias"
