"""The page of a motion: what the stick figure shows is where the chain is, and nothing foreign can run in it."""

import json
import re
from base64 import b64encode
from hashlib import sha256

import numpy as np
import pytest

from plumbob.arm import JointTrack, taught
from plumbob.core.errors import ParameterError, ShapeError
from plumbob.data.chain import Chain, Joint, Segment
from plumbob.reporting.arm import arm_report, stick_figure
from plumbob.reporting.report import Report
from tests.helpers.arm_samples import arm, pick_and_place, scipy_hand


def data_of(page: str) -> dict:
    return json.loads(re.search(r"<script type='application/json'>(.*?)</script>", page, re.DOTALL)[1])


def test_the_stick_figure_is_where_scipy_says() -> None:
    chain = arm()
    angles = np.random.default_rng(2).uniform(-2.0, 2.0, (40, 6))
    scene = stick_figure(chain, np.arange(40) / 10.0, angles)
    found = data_of(Report("a", scenes=[scene]).page())
    assert found["names"] == ["base", "upper", "lower", "hand", "tip"] and found["trail"] == 4
    assert found["lines"] == [[0, 1], [1, 2], [2, 3], [3, 4]]
    assert found["t"] == [round(k / 10.0, 3) for k in range(40)]
    np.testing.assert_allclose(found["points"][4], [scipy_hand(row) for row in angles], atol=0.6e-4)
    name, values = found["values"][3]
    assert name == "elbow"
    np.testing.assert_allclose(values, np.degrees(angles[:, 3]), atol=0.051)


def test_a_long_motion_has_a_bounded_page_and_unknown_places_are_left_out() -> None:
    chain = arm()
    angles = np.zeros((200_000, 6))
    angles[100_000:, 3] = np.nan
    found = data_of(Report("a", scenes=[stick_figure(chain, np.arange(200_000) / 100.0, angles)]).page())
    assert len(found["t"]) <= 1500 and found["t"][0] == 0.0 and found["t"][-1] == 1999.99
    assert found["points"][4][-1] == [None] * 3 and found["points"][1][-1] is not None


def test_only_the_one_script_may_run_and_names_cannot_leave_their_place() -> None:
    bad = "</script><script>alert(1)</script>"
    chain = Chain(bad, (Segment("base"), Segment(bad)), (Joint("j", "base", bad, axes=((0, 0, 1.0),)),))
    page = Report(bad, scenes=[stick_figure(chain, np.arange(3.0), np.zeros((3, 1)))]).page()
    assert "<script>alert" not in page
    assert "<script" not in Report("a").page() and "script-src" not in Report("a").page()
    (script,) = re.findall(r"<script>(.*?)</script>", page, re.DOTALL)
    digest = b64encode(sha256(script.encode()).digest()).decode()
    (policy,) = re.findall(r'http-equiv="Content-Security-Policy" content="([^"]*)"', page)
    assert policy.startswith("default-src 'none'; style-src 'unsafe-inline'; ")
    assert re.findall("script-src [^;]*", policy) == [f"script-src 'sha256-{digest}'"]
    assert data_of(page)["names"] == ["base", bad]
    assert not re.search(r"(?:src|href)=|https?://(?!www\.w3\.org)", page)


def test_a_report_has_angles_hand_and_program() -> None:
    chain = arm()
    clean = pick_and_place(np.random.default_rng(4).uniform(-0.9, 0.9, (2, 6)), rest=0.6, move=1.4)
    angles = clean.angles + np.radians(2.0)
    track = JointTrack(clean.t, chain.angles, angles, sd=np.full_like(angles, 0.01))
    truth = JointTrack(clean.t, chain.angles, clean.angles)
    report = arm_report(chain, track, program=taught(track, chain), truth=truth, facts=[("take", "7")])
    rows = {row[0]: row for row in report.tables[0].rows}
    assert rows["elbow"][3:] == ["0.57", "2.00", "2.00"]  # 0.01 rad, and an error of 2° everywhere
    assert len(data_of(report.page())["shadow"]) == 5
    with pytest.raises(ParameterError, match="the angles of arm are"):
        arm_report(chain, JointTrack([0.0], ("a",), [[0.0]]))
    with pytest.raises(ShapeError, match="truth must have the times"):
        arm_report(chain, track, truth=truth[1:])
