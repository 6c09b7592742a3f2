"""How an answer to the second battery is measured; its cases stand beside those of the first."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.harness.contender import Answer
from benchmarks.harness.fault_scene import LONGEST, record
from benchmarks.harness.second import compare, listen, measure_second
from benchmarks.harness.second_cases import CASES, NONE
from benchmarks.harness.silence import Outcome
from plumbob.rotations import quat_from_euler_zyx, quat_multiply

BY_NAME = {case.name: case for case in CASES}


class Told:
    """A contender that answers with the truth turned by some angles, degrees, at each sample."""

    name = settings = "told"
    timed, alarms = True, 1

    def __init__(self, yaw, roll=0.0, words=0, sd_deg=None):
        self.yaw, self.roll, self.words, self.sd_deg = yaw, roll, words, sd_deg

    def answer(self, given):
        n = given.t.size
        angles = np.zeros((n, 3))
        angles[:, 0], angles[:, 2] = np.broadcast_to(self.yaw, n), np.broadcast_to(self.roll, n)
        q = quat_multiply(quat_from_euler_zyx(np.radians(angles)), given.truth[given.newest])
        cov = None if self.sd_deg is None else np.tile(np.diag(np.radians(self.sd_deg) ** 2), (n, 1, 1))
        return Answer(q, np.broadcast_to(self.words, n).astype(np.int64), cov, {})


def test_errors_and_claims_are_of_heading_and_inclination():
    clean = record(NONE, LONGEST)
    heard = listen(Told(6.0, sd_deg=[1.0, 1.0, 2.0]), clean, free=False)
    assert (heard.error_deg, heard.claimed.ratio) == (pytest.approx(6.0), pytest.approx(3.0))
    heard = listen(Told(0.0, 6.0, sd_deg=[3.0, 4.0, 4.0]), clean, free=False)
    assert heard.claimed.error_deg[0] == pytest.approx([0.0, 6.0], abs=1e-6)
    assert heard.claimed.ratio == pytest.approx(6.0 / 5.0)  # of both tilts, 3° and 4°
    upright = record(replace(NONE, start=(0.0, -0.5 * math.pi, 0.0)), 100)  # on its x axis, which is then the vertical
    assert listen(Told(6.0, sd_deg=[2.0, 1.0, 1.0]), upright, free=False).claimed.ratio == pytest.approx(3.0)


def test_warnings_and_errors_that_the_clean_run_has_too_are_none():
    case = BY_NAME["field_east_10s_none"]
    given = case.stream()
    heard = listen(Told(9.0, words=0b11), given, free=False)
    outcomes = [
        compare(case, given, heard, listen(Told(0.0, words=before), case.clean(), free=False), alarms).by_both
        for before, alarms in ((0, 1), (0, 2), (0, 4), (1, 1))
    ]
    assert outcomes == [Outcome.SAID, Outcome.SAID, Outcome.WRONG, Outcome.WRONG]
    clean = listen(Told(5.0), case.clean(), free=False)
    assert compare(case, given, listen(Told(6.9), given, free=False), clean, 1).by_both == Outcome.RIGHT
    assert compare(case, given, listen(Told(7.1), given, free=False), clean, 1).by_both == Outcome.WRONG


def test_bars_count_what_could_be_seen_apart():
    wrong = Told(np.where(np.arange(LONGEST) < 3000, 0.0, 9.0), sd_deg=[1.0, 1.0, 1.0])
    wrong.answer = lambda given, whole=wrong: Told(
        np.where(given.newest < 3000, 0.0, 9.0 if given.t.size < LONGEST else 0.0), sd_deg=[1.0] * 3
    ).answer(given)
    names = ["turn_1dps_60s", "turn_1dps_60s_field_too", "field_east_1s_none", "field_east_3s_none"]
    found = measure_second([wrong], [BY_NAME[name] for name in names])
    assert [bar.value for bar in found.bars("told")] == [75.0, 100.0, 100.0, 100.0]
    assert re.search(r"^told +4 +0 % +0 % +0 % +100 % ", found.text(), re.MULTILINE)
    assert "turn_1dps_60s_field_too?" in found.text()
