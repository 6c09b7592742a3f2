"""Benchmarks of calibrations: what they simulate is what they say, and their bars are kept and can be missed."""

import json
import math

import numpy as np
import pytest

from benchmarks.harness import calibration_mag, calibration_world
from benchmarks.harness.bar import Bar, bar_lines
from benchmarks.harness.calibration import PARTS, measure_calibration
from benchmarks.harness.calibration_accel import CARES, MISALIGNMENT, ROWS, measure_accel
from benchmarks.harness.calibration_table import SESSIONS, measure_table
from benchmarks.harness.calibration_temperature import SOAKS, measure_temperature
from benchmarks.harness.section import Section
from plumbob.calibration.predicted import filled
from plumbob.core.errors import ShapeError
from plumbob.core.units import deg, to_deg
from plumbob.papers.buoy.modules import STRENGTH, field_n, in_body
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


def test_heading_error_of_a_turned_calibration_is_the_turn():
    turn = deg(1.0)
    about_z = np.array([[math.cos(turn), -math.sin(turn), 0.0], [math.sin(turn), math.cos(turn), 0.0], [0.0, 0.0, 1.0]])
    level = calibration_world.heading_error(np.eye(3), np.zeros(3), TriadErrors(), deg(60.0))
    turned = calibration_world.heading_error(about_z, np.zeros(3), TriadErrors(), 0.0)
    assert level < 1e-12
    # a turn about the body's z axis turns a level field by that axis's vertical part, cos(pitch) cos(roll); the mean of
    # cos² over ±45° is 1/2 + 1/π, and two of them under a root are that again; 400 attitudes tell it to 1 %
    assert turned == pytest.approx(turn * (0.5 + 1.0 / math.pi), rel=0.03)  # 3 sd


def test_z_scores_count_what_is_wrong_and_was_said_to_be_zero():
    case = calibration_mag.CASES[0]
    errors = calibration_mag.unit(case, np.random.default_rng(1))
    perfect = errors.card("uT")
    off = {"matrix": perfect.matrix, "bias": perfect.bias + [0.1, 0.0, 0.0], "unit_in": "uT", "unit_out": "uT"}
    told, silent = (calibration_mag.TriadCalibration(**off, covariance=sd * np.eye(12)) for sd in (1.0, 0.0))
    assert calibration_mag.scores(told, errors)[:3] == pytest.approx([0.1, 0.0, 0.0], abs=1e-9)
    assert calibration_mag.scores(silent, errors).max() > 1e6


def test_every_section_tells_its_rows_and_bars(result):
    told = json.loads(json.dumps(result.as_dict(), allow_nan=False))
    assert tuple(result.sections) == tuple(PARTS)
    for name, section in result.sections.items():
        assert len(section.rows) == PARTS[name].steps
        assert all(len(row) == len(section.columns) for row in section.rows.values())
        assert section.bars
        assert [row["name"] for row in told[name]["rows"]] == list(section.rows)
        assert [bar["met"] for bar in told[name]["bars"]] == [bar.met for bar in section.bars]
    assert result.text().count("MISSED") == sum(not bar.met for bar in result.bars)


def test_one_section_alone_and_an_unknown_one():
    steps = []
    one = measure_calibration(range(1), ["temperature"], steps.append)
    assert list(one.sections) == ["temperature"]
    assert sum(steps) == PARTS["temperature"].steps
    with pytest.raises(ShapeError, match="section must be one of"):
        measure_calibration(range(1), ["gyro"])


def test_an_infinite_figure_misses_its_bar():
    bar = Bar("heading", math.inf, 0.0, 1.0)
    section = Section("t", ("heading, °", "wrong"), {"a": (math.inf, "none")}, (bar,))
    assert section.as_dict()["rows"] == [{"name": "a", "heading, °": None, "wrong": "none"}]
    assert "MISSED" in list(bar_lines([bar]))[1]
    assert bar.as_dict()["value"] is None


def columns_of(section):
    return {name: dict(zip(section.columns, row, strict=True)) for name, row in section.rows.items()}


def test_accelerometers_keep_their_bars_and_their_errors_follow_the_noise():
    """A median of 20 scatters by 12 %, and the figures are a fifth below their bars; twelve times the noise.

    Without misalignment directions are wrong by its symmetric part: symmetric entries of the sd s turn directions by
    √(6/5) s (root mean square over the sphere), s = 0.5°/√3/√2. Over units that is nearly distributed as χ of 3 degrees
    of freedom, whose median is √(2.366/3): 0.2°. 20 scatter by 11 %.
    """
    section = measure_accel(range(20))
    assert len(section.rows) == len(CARES) * len(ROWS)
    assert [bar.name for bar in section.bars if not bar.met] == []
    figures = columns_of(section)
    few, many = (figures[f"18 positions, 9 parameters; {care.name}"] for care in CARES)
    for column in ("bias, mg", "predicted, °"):
        assert many[column] / few[column] == pytest.approx(12.0, rel=0.3)
    six, nine, most = (
        figures[f"{count}; {CARES[0].name}"]
        for count in ("6 positions, 6 parameters", "9 positions, 9 parameters", "26 positions, 9 parameters")
    )
    assert nine["length, mg"] > 1.5 * most["length, mg"]
    expected = to_deg(MISALIGNMENT) / np.sqrt(6.0) * np.sqrt(1.2) * np.sqrt(2.366 / 3.0)
    assert six["direction, °"] == pytest.approx(expected, rel=0.33)
    assert six["predicted, °"] > six["direction, °"]


def test_twelve_parameters_of_a_rate_table_leave_what_closed_forms_say():
    measured = measure_table(range(40))
    assert tuple(measured.rows) == tuple(SESSIONS)
    assert all(bar.met for bar in measured.bars)
    simple, coupled, *_ = columns_of(measured).values()
    assert [bar.value for bar in measured.bars] == [
        coupled[bar.name.removeprefix("rate table: ")] for bar in measured.bars
    ]
    # a mounting's 0.1° in a random direction is 0.1°/√2 per entry; the mean of two halves the variance. Medians of the
    # root mean square of 6 are 0.945 of it (χ² with 6 degrees of freedom), and those of 40 trials scatter by 6 %.
    assert simple["misalignment, °"] == pytest.approx(0.945 * 0.1 / 2**0.5, rel=0.24)
    assert coupled["misalignment, °"] == pytest.approx(0.945 * 0.05, rel=0.24)
    # one end up leaves a third of each of three terms of 0.05 °/s/g in the bias; median factor of 3: 0.888; 8 %
    assert simple["bias, °/s"] == pytest.approx(0.888 * 0.05 / 3**0.5, rel=0.32)
    # 42 plateaus of 0.015 °/s
    assert coupled["bias, °/s"] == pytest.approx(0.888 * 0.015 / 42**0.5, rel=0.32)


def test_a_polynomial_of_the_unit_keeps_its_bar_and_the_papers_figure_does_not():
    result = measure_temperature(range(6))
    (_, white, paper, raw), (_, wandering, _, _) = (result.rows[name] for name, *_ in SOAKS)
    assert white < 0.005 < wandering < 0.05  # 36 °/h wander by 0.664 × 0.01 °/s at any time scale
    assert min(paper, raw) > 1.0
    assert [(bar.value, bar.met) for bar in result.bars] == [(white, True), (paper, True)]
    told = json.loads(json.dumps(result.as_dict(), allow_nan=False))
    assert [bar["high"] for bar in told["bars"]] == [0.005, None]
