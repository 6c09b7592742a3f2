"""Recordings for the tests of files, and how two of them are compared."""

import json
import zlib
from copy import copy
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest

from plumbob import AttitudeTrack, ImuData, ImuMeta, Recording
from plumbob.core.errors import DecodeError
from plumbob.files import header
from plumbob.files.columns import column
from plumbob.rotations import Frame, North, quat_normalize

ROWS = 12
ROOT = Path(__file__).resolve().parents[2]


def make_imu(rows: int = ROWS, **changes: object) -> ImuData:
    rng = np.random.default_rng(7)
    mag = rng.normal(size=(rows, 3)) + [20.0, 0.0, -40.0]
    mag[1::3] = np.nan  # a magnetometer at a third of the rate leaves such holes; here one in three is one
    content = {
        "t": np.arange(rows) * 0.0035 + 0.25,
        "gyr": rng.normal(size=(rows, 3)),
        "acc": rng.normal(size=(rows, 3)) + [0.0, 0.0, 9.8],
        "mag": mag,
        "temp_c": 20.0 + rng.normal(size=rows),
        "meta": ImuMeta(
            device="unit; 7, \"blue\" = 'µ'",
            gyr_range=34.906585039886591,
            acc_range=156.9064,
            mag_range=4900.0,
            rate_nominal=2000.0 / 7.0,
            t0_ns=1_700_000_000_123_456_789,
            axes="y -x z",
            frame=Frame.NED,
            north=North.TRUE,
            declination=-0.061,
            calibration="card of 2024-05-01",
        ),
    }
    return ImuData(**(content | changes))


def make_track(rows: int = ROWS, *, full: bool = True) -> AttitudeTrack:
    rng = np.random.default_rng(8)
    q_nb = quat_normalize(rng.normal(size=(rows, 4)))
    q_nb[2] = np.nan
    track = AttitudeTrack(
        t=np.arange(rows) * 0.0035 + 0.25, q_nb=q_nb, frame=Frame.NWU, north=North.FREE, source="test, of the files"
    )
    if not full:
        return track
    return replace(
        track, bias_b=rng.normal(size=(rows, 3)) * 1e-3, cov_b=rng.normal(size=(rows, 3, 3)) * 1e-6,
        flags=rng.integers(0, 2**32, rows).astype(np.uint32), score=rng.random(rows) < 0.5,
        mag_weight=np.where(rng.random(rows) < 0.3, np.nan, rng.random(rows)),
    )  # fmt: skip


def put(path: Path, content: str | bytes) -> Path:
    """The path, where a file of this content lies now."""
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


LEFT = tuple(np.random.default_rng(9).normal(size=78).tolist())
EXTREMES = np.zeros((ROWS, 3))
EXTREMES[0] = [-0.0, 5e-324, -2.2250738585072009e-308]  # smallest and largest denormal (IEEE 754 binary64)
EXTREMES[1] = [np.inf, -np.inf, 1.7976931348623157e308]
CASES = {
    "imu": Recording(imu=make_imu()),
    "imu without mag": Recording(imu=make_imu(mag=None, temp_c=None, meta=ImuMeta())),
    "gyr alone": Recording(imu=make_imu(mag=None, acc=None, temp_c=None, meta=ImuMeta(gyr_range=35.0))),
    "mag alone": Recording(imu=make_imu(gyr=None, acc=None, meta=ImuMeta(mag_range=4900.0, unit_check=False))),
    "ranges of axes": Recording(imu=make_imu(meta=ImuMeta(gyr_range=(4.0, 5.0, 0.1 + 0.2 + 6.0), acc_range=200.0))),
    "what a calibration leaves": Recording(
        imu=make_imu(meta=ImuMeta(calibration="a card", gyr_left=LEFT, acc_left=LEFT, mag_left=LEFT[::-1]))
    ),
    "extremes": Recording(imu=make_imu(gyr=EXTREMES, meta=ImuMeta(unit_check=False))),
    "one sample": Recording(imu=make_imu(rows=1)),
    "track": Recording(track=make_track(full=False)),
    "full track": Recording(track=make_track()),
    "both": Recording(imu=make_imu(), track=make_track(), notes=("first, of all", '=HYPERLINK("x";"y")')),
}


def assert_same(a: Recording, b: Recording, *, nan_bits: bool = True) -> None:
    """Equal to the last bit; with nan_bits False any NaN equals any other."""
    for mine, other in ((a.imu, b.imu), (a.track, b.track)):
        assert (mine is None) == (other is None)
        if mine is None or other is None:
            continue
        for name, value in vars(mine).items():
            found = copy(getattr(other, name))
            if not isinstance(value, np.ndarray):
                assert found == value, name
                continue
            assert found.dtype == value.dtype, name
            assert found.shape == value.shape, name
            if not nan_bits and value.dtype == np.float64:
                assert np.array_equal(np.isnan(found), np.isnan(value)), name
                found[np.isnan(value)] = value[np.isnan(value)]
            assert found.tobytes() == value.tobytes(), name


def schema_keys(schema):
    named = schema.get("properties", {})
    inner = [*schema.get("anyOf", ()), schema.get("items"), schema.get("additionalProperties")]
    return {*named, *(key for part in (*named.values(), *filter(None, inner)) for key in schema_keys(part))}


def refused(call, *args, match: str, error: type[Exception] = DecodeError, name: str = "", **options) -> str:
    """A call is refused, in one line that names the file, and is given."""
    with pytest.raises(error, match=match) as caught:
        call(*args, **options)
    assert name in str(caught.value)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def sealed(columns: dict[str, np.ndarray], content: dict[str, object], seal: bool = True) -> pa.Table:
    """Table of a native recording with this header, and a checksum that fits: CRC-32 of the header and the columns."""
    crc = zlib.crc32(header.dump(content))
    for _, values in sorted(columns.items()):
        crc = zlib.crc32(np.ascontiguousarray(values).astype(values.dtype.newbyteorder("<")).tobytes(), crc)
    raw = json.dumps(content | ({"crc32": f"{crc:08x}"} if seal else {}))
    units = {name: {"unit": column(name).unit} for name in columns}
    fields = [pa.field(name, pa.from_numpy_dtype(v.dtype), False, units[name]) for name, v in columns.items()]
    return pa.table(list(map(pa.array, columns.values())), pa.schema(fields, {"plumbob": raw}))
