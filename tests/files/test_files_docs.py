"""The examples of the documentation are read as they stand."""

import re

import numpy as np
import pytest

from plumbob.core.constants import G0
from plumbob.files import FORMATS, parse_profile, read
from plumbob.files.columns import COLUMNS
from tests.helpers.io_samples import ROOT

PAGE = (ROOT / "docs" / "file-formats.md").read_text()


def example(name, tmp_path, encoding):
    section = PAGE.split(f"### {name}")[1]
    text, profile = (re.search(rf"```{kind}\n(.*?)```", section, re.DOTALL)[1] for kind in ("text", "toml"))
    (tmp_path / "a.txt").write_bytes(text.encode(encoding))
    return read(tmp_path / "a.txt", profile=parse_profile(profile))


def test_the_examples_are_read(tmp_path):
    imu = example("LabVIEW", tmp_path, "gbk").imu
    assert imu.t.tolist() == [0.0, 0.01, 0.02]
    assert imu.gyr[0] == pytest.approx(np.radians([0.12, 0.05, -0.01]), rel=1e-14)  # y and z turned by axes
    assert np.isnan(imu.gyr[1]).tolist() == [False, False, True]
    assert imu.acc[2] == pytest.approx([0.002 * G0, 0.012 * G0, G0], rel=1e-14)  # at rest it points up, and z is up
    assert imu.temp_c.tolist() == [23.4, 23.4, 23.5]
    imu = example("Dates", tmp_path, "utf-8").imu
    assert imu.t.tolist() == [0.0, 0.01]
    assert imu.meta.t0_ns == 1_714_566_605_120_000_000  # date -u -d 2024-05-01T12:30:05Z +%s (GNU coreutils 9.1)
    assert imu.acc[0] == pytest.approx([0.0, -4 / 4096 * G0, 4098 / 4096 * G0], rel=1e-14)
    assert imu.gyr[0] == pytest.approx(np.radians([0.003, 0.012, 0.110]), rel=1e-14)
    assert imu.mag[0] == pytest.approx([21.2, 1.1, -38.8], rel=1e-14)  # 1 G = 100 µT
    recording = example("A plain logger", tmp_path, "utf-8")
    imu, track = recording.imu, recording.track
    assert imu.t.tolist() == [0.0, 0.01]
    assert imu.gyr[0, 0] == pytest.approx(np.radians(16 / 16.4), rel=1e-14)
    assert imu.acc[0, 2] == pytest.approx(16350 / 16384 * G0, rel=1e-14)
    assert imu.mag[0].tolist() == pytest.approx([31.8, 1.65, -58.2])
    assert track.q_nb.tolist() == [[1.0, 0.0, 0.0, 0.0]] * 2


def test_every_suffix_and_column_is_documented():
    for kind in FORMATS:
        for suffix in filter(None, kind.suffixes):
            assert f"`{suffix}`" in PAGE
    for column in COLUMNS:
        assert column.startswith("cov_") or f"`{column}`" in PAGE
