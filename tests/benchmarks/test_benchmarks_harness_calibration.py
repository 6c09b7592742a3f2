"""Benchmarks of calibrations: what they simulate is what they say, and their bars are kept and can be missed."""

import json
import math

import numpy as np
import pytest

from benchmarks.harness import calibration_mag, calibration_world
from benchmarks.harness.bar import Bar, bar_lines
from benchmarks.harness.calibration import PARTS, measure_calibration
from benchmarks.harness.calibration_temperature import SOAKS, measure_temperature
from benchmarks.harness.calibration_world import STRENGTH, field_n, in_body
from benchmarks.harness.section import Section
from plumbob.calibration.predicted import filled
from plumbob.core.errors import ShapeError
from plumbob.core.units import deg
from plumbob.simulation import TriadErrors


@pytest.fixture(scope="module")
def result():
    return measure_calibration(range(1))


@pytest.mark.parametrize("dip", [60.0, -35.0])
def test_the_field_is_along_every_face_and_edge_once(dip):
    q_nb = calibration_world.faced_by_the_field(deg(dip))(np.random.default_rng(3))
    seen = in_body(q_nb, field_n(deg(dip)))
    np.testing.assert_array_equal(filled(seen), 1)
    np.testing.assert_allclose(np.linalg.norm(seen, axis=1), STRENGTH, rtol=1e-12)


def test_a_turned_calibration_errs_by_its_turn_and_z_scores_count_what_was_said_to_be_zero():
    turn = deg(1.0)
    about_z = np.array([[math.cos(turn), -math.sin(turn), 0.0], [math.sin(turn), math.cos(turn), 0.0], [0.0, 0.0, 1.0]])
    level = calibration_world.heading_error(np.eye(3), np.zeros(3), TriadErrors(), deg(60.0))
    turned = calibration_world.heading_error(about_z, np.zeros(3), TriadErrors(), 0.0)
    assert level < 1e-12
    # a turn about the body's z axis turns a level field by that axis's vertical part, cos(pitch) cos(roll); the mean of
    # cos² over ±45° is 1/2 + 1/π, and two of them under a root are that again; 400 attitudes tell it to 1 %
    assert turned == pytest.approx(turn * (0.5 + 1.0 / math.pi), rel=0.03)  # 3 sd
    case = calibration_mag.CASES[0]
    errors = calibration_mag.unit(case, np.random.default_rng(1))
    perfect = errors.card("uT")
    off = {"matrix": perfect.matrix, "bias": perfect.bias + [0.1, 0.0, 0.0], "unit_in": "uT", "unit_out": "uT"}
    told, silent = (calibration_mag.TriadCalibration(**off, covariance=sd * np.eye(12)) for sd in (1.0, 0.0))
    assert calibration_mag.scores(told, errors)[:3] == pytest.approx([0.1, 0.0, 0.0], abs=1e-9)
    assert calibration_mag.scores(silent, errors).max() > 1e6


def test_every_section_tells_its_rows_and_bars(result):
    told = json.loads(json.dumps(result.summary(), allow_nan=False))
    assert tuple(result.sections) == tuple(PARTS)
    for name, section in result.sections.items():
        assert len(section.rows) == PARTS[name].steps
        assert all(len(row) == len(section.columns) for row in section.rows.values())
        assert section.bars
        assert [row["name"] for row in told[name]["rows"]] == list(section.rows)
        assert [bar["met"] for bar in told[name]["bars"]] == [bar.met for bar in section.bars]
    assert result.text().count("MISSED") == sum(not bar.met for bar in result.bars)


def test_one_section_alone_an_unknown_one_and_a_figure_that_misses_its_bar():
    steps = []
    one = measure_calibration(range(1), ["temperature"], steps.append)
    assert list(one.sections) == ["temperature"]
    assert sum(steps) == PARTS["temperature"].steps
    with pytest.raises(ShapeError, match="section must be one of"):
        measure_calibration(range(1), ["gyro"])
    bar = Bar("heading", math.inf, 0.0, 1.0)
    section = Section("t", ("heading, °", "wrong"), {"a": (math.inf, "none")}, (bar,))
    assert section.summary()["rows"] == [{"name": "a", "heading, °": None, "wrong": "none"}]
    assert "MISSED" in list(bar_lines([bar]))[1] and bar.summary()["value"] is None


def test_a_polynomial_of_the_unit_keeps_its_bar_and_the_papers_figure_does_not():
    result = measure_temperature(range(6))
    (_, white, paper, raw), (_, wandering, _, _) = (result.rows[name] for name, *_ in SOAKS)
    assert white < 0.005 < wandering < 0.05  # 36 °/h wander by 0.664 × 0.01 °/s at any time scale
    assert min(paper, raw) > 1.0
    assert [(bar.value, bar.met) for bar in result.bars] == [(white, True), (paper, True)]
    told = json.loads(json.dumps(result.summary(), allow_nan=False))
    assert [bar["high"] for bar in told["bars"]] == [0.005, None]
