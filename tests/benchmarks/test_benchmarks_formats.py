"""The table of kinds of files: every kind is in it, a row is without faults, and faults that are planted are seen."""

import re
from dataclasses import replace

import numpy as np
import pytest

from benchmarks import formats
from plumbob.data.recording import Recording
from plumbob.files import FORMATS
from tests.helpers.io_samples import make_imu, make_track

pytest.importorskip("rosbags")


def test_every_format_and_each_of_its_rows_is_on_the_page():
    """Otherwise: make formats."""
    assert {kind.format for kind in formats.MADE} == {kind.name for kind in FORMATS}
    page = formats.PAGE.read_text(encoding="utf-8")
    assert page.startswith(formats.HEAD)
    rows = page.partition("| TUM |\n")[2].partition("\n\n")[0].splitlines()[1:]
    told = [tuple(re.split(r" \| ", row.strip("| "))[:2]) for row in rows]
    assert told == [(kind.name, kind.source) for kind in formats.MADE]
    assert "differ" not in page and "come or go" not in page


@pytest.mark.parametrize("name", ["x-IMU3, folder", "tlog"])
def test_a_row_without_faults(name):
    (row,) = formats.rows([name])
    assert (row.silent, row.changed, row.tracebacks) == ([], [], [])
    assert row.grade.endswith(", good") and float(row.run.removesuffix("°")) < 0.3
    assert set(row.cells) == {target.name for target in formats.TARGETS}
    assert all(row.cells[name] == "=" for name in ("Parquet", "CSV", "MCAP", "TUM"))


def test_what_is_lost_or_changed_is_seen():
    whole = Recording(imu=make_imu(), track=make_track(), notes=("made here",))
    assert formats.compared(whole, whole) == ({}, set())
    imu, track = whole.imu, whole.track
    gyr = imu.gyr.copy()
    gyr[3, 1] = np.nextafter(gyr[3, 1], 9.0)
    later = replace(imu.meta, t0_ns=imu.meta.t0_ns + 1)
    for other, changed, lost in (
        (replace(whole, notes=()), {}, {"notes"}),
        (replace(whole, track=None), {}, {"attitude"}),
        (replace(whole, imu=make_imu(mag=None)), {}, {"mag"}),
        (replace(whole, imu=make_imu(gyr=gyr)), {"gyr": "1 ulp"}, set()),
        (replace(whole, imu=make_imu(meta=replace(imu.meta, declination=None))), {}, {"declination"}),
        (replace(whole, track=replace(track, cov_b=None, score=None)), {}, {"covariance", "scores"}),
        (replace(whole, track=replace(track, q_nb=-track.q_nb)), {}, set()),
        (replace(whole, track=replace(track, q_nb=track.q_nb * [1, -1, -1, -1])), {"q": "3 rad"}, set()),
    ):
        assert formats.compared(whole, other) == (changed, lost)
    changed, lost = formats.compared(whole, Recording(imu=make_imu(meta=later), track=track, notes=whole.notes))
    assert changed["stamps"] == "12 of 12 differ" and "some rows" in lost
