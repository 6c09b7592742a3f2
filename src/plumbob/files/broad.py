"""Trials of BROAD, the Berlin robust orientation estimation data set [Laidig2021], CC BY 4.0.

A trial is recognised by its content, not by its name. It holds a 9-axis unit and an optical reference on one time
line; the same content comes as HDF5 and as MATLAB v5.
"""

import math
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from plumbob.core.check import Floats
from plumbob.core.errors import DecodeError
from plumbob.core.files import existing_file, reading, require_room
from plumbob.data import AttitudeTrack, ImuData, ImuMeta
from plumbob.data.recording import Recording
from plumbob.files.arrays import (
    HDF5_SIGNATURE,
    MAT5_SIGNATURE,
    NUMERIC,
    Variable,
    mat_array,
    mat_order,
    mat_variables,
    opened_hdf5,
    own_dataset,
    require_whole_chunks,
)
from plumbob.rotations import Frame, North

SHAPES: Final[dict[str, tuple[int, ...]]] = {
    "imu_gyr": (3,),
    "imu_acc": (3,),
    "imu_mag": (3,),
    "opt_quat": (4,),
    "movement": (),
}
"""Shape of one row of each array; `sampling_rate` is a single number besides."""

RATE: Final = "sampling_rate"
MAX_ROWS: Final = 1_000_000
"""Rows beyond which a file is refused: the longest trial has 60 000, and a container can claim any number."""


def require_keys(found: Iterable[str]) -> None:
    """Refuse a container without the keys of a trial."""
    missing = [key for key in (*SHAPES, RATE) if key not in set(found)]
    if missing:
        raise DecodeError(
            f"it is not a BROAD trial: {', '.join(missing)} missing; export other data as CSV and describe that with a "
            "profile."
        )


def require_shapes(shapes: dict[str, tuple[int, ...]]) -> None:
    """Refuse arrays that do not belong together, or claim too many rows."""
    rows = max(shapes["imu_gyr"][:1], default=0)
    if not 1 <= rows <= MAX_ROWS:
        raise DecodeError(f"imu_gyr claims {rows} rows, but a trial has 1 to {MAX_ROWS}.")
    for key, row in SHAPES.items():
        if shapes[key] != (rows, *row):
            raise DecodeError(f"{key} must have shape {(rows, *row)}, but it has {shapes[key]}.")


def load_hdf5(file: Path) -> dict[str, NDArray[Any]]:
    """Arrays of a trial.

    Raises
    ------
    MissingExtraError
        If h5py is not installed.
    DecodeError
        If keys are missing, data lie outside the file, or it is damaged.
    """
    with opened_hdf5(file) as (h5py, hdf5):
        return _arrays(h5py, hdf5, file.stat().st_size)


def _arrays(h5py: Any, hdf5: Any, size: int) -> dict[str, NDArray[Any]]:
    require_keys([*hdf5.keys(), *(key for key in hdf5.attrs if key == RATE)])
    sets = {key: own_dataset(h5py, hdf5, key) for key in SHAPES}
    require_shapes({key: tuple(dataset.shape) for key, dataset in sets.items()})
    if RATE not in hdf5.attrs:
        sets[RATE] = own_dataset(h5py, hdf5, RATE)
    require_room(sum(dataset.size * dataset.dtype.itemsize for dataset in sets.values()), size)
    for key, dataset in sets.items():
        require_whole_chunks(h5py, key, dataset, size)
    content = {key: dataset[()] for key, dataset in sets.items()}
    rate = np.asarray(content[RATE] if RATE in content else hdf5.attrs[RATE])
    if rate.dtype.kind not in "fiu":
        raise DecodeError(f"{RATE} must be a number, but its type is {rate.dtype}.")
    return content | {RATE: rate}


MAX_BYTES: Final = 256 * 1024 * 1024
"""Bytes of a file; a trial of a million rows has 145 MB, unpacked."""
_KEYS = (*SHAPES, RATE)
_TELLING: Final = ("opt_quat", "imu_gyr")
"""Names by which a trial is known; the others must be there too when it is read."""


def load_mat(file: Path) -> dict[str, NDArray[Any]]:
    """Arrays of a trial; no other variable of the file is unpacked.

    Raises
    ------
    DecodeError
        If keys are missing or of another class, the file unpacks to too much, or it is damaged.
    """
    if (size := file.stat().st_size) > MAX_BYTES:
        raise DecodeError(f"it has {size} bytes, but a trial has {MAX_BYTES} at most; check the path.")
    raw = memoryview(file.read_bytes())
    order = mat_order(raw)
    variables = mat_variables(raw, order)
    _require(variables)
    require_room(sum(variables[key].size for key in _KEYS), len(raw))
    content = {key: mat_array(variables[key], order) for key in _KEYS}
    return content | {"movement": content["movement"].ravel()}  # MATLAB has no vectors, only tables of one column


def _require(variables: Mapping[str, Variable]) -> None:
    require_keys(variables)
    for key in _KEYS:
        if variables[key].kind not in NUMERIC.values():
            raise DecodeError(f"{key} must be numeric, but its class is {variables[key].kind}.")
    shapes = {key: variables[key].shape for key in SHAPES}
    if shapes["movement"][1:] == (1,):  # MATLAB has no vectors, only tables of one column
        shapes["movement"] = shapes["movement"][:1]
    require_shapes(shapes)
    if (values := math.prod(variables[RATE].shape)) != 1:
        raise DecodeError(f"{RATE} must be one number in Hz, but it is {values}.")


DEVICE: Final = "Myon aktos-t"
SOURCE: Final = "BROAD optical reference (OptiTrack)"
_PROVENANCE: Final = "from the BROAD data set, doi:10.3390/data6070072, CC BY 4.0"
_LOADERS = {HDF5_SIGNATURE: load_hdf5, MAT5_SIGNATURE: load_mat}


def read_broad(path: str | Path) -> Recording:
    """Read a trial: samples, and the reference in ENU with magnetic north.

    The reference's `score` marks the samples of the movement phase in which the reference is known.

    Raises
    ------
    DecodeError
        If the file is neither HDF5 nor MATLAB v5, is not a BROAD trial, is damaged, or refers to other files.
    MissingExtraError
        If it is HDF5 and h5py is not installed.
    """
    file = existing_file(path)
    with reading(file):
        content = _loader(file)(file)
        rate = _rate(content["sampling_rate"])
        t = np.arange(content["imu_gyr"].shape[0]) / rate
        return Recording(
            imu=_imu(content, t, rate), track=_track(content, t), name=file.stem, notes=(_PROVENANCE, _lost(content))
        )


def accepts(file: Path) -> bool:
    """Whether a file names the arrays of a trial."""
    with file.open("rb") as stream:
        start = stream.read(16)
        if not start.startswith(tuple(_LOADERS)) or file.stat().st_size > MAX_BYTES:
            return False
        rest = stream.read()
    if any(key.encode() in rest for key in _TELLING) or not start.startswith(MAT5_SIGNATURE):
        return any(key.encode() in rest for key in _TELLING)
    raw = memoryview(start + rest)  # names of packed variables show once their beginnings are unpacked
    return bool(set(_TELLING) & set(mat_variables(raw, mat_order(raw))))


def _loader(file: Path) -> Any:
    with file.open("rb") as stream:
        start = stream.read(16)
    for signature, load in _LOADERS.items():
        if start.startswith(signature):
            return load
    raise DecodeError("it is neither HDF5 nor MATLAB v5; BROAD trials are one of these.")


def _rate(value: NDArray[Any]) -> float:
    rate = float(value.ravel()[0]) if value.size == 1 else float("nan")
    if not 0.0 < rate < 1e6:
        raise DecodeError(f"sampling_rate must be one number in Hz, but it is {rate:g} ({value.size} values).")
    return rate


def _imu(content: dict[str, NDArray[Any]], t: Floats, rate: float) -> ImuData:
    return ImuData(
        t=t,
        gyr=content["imu_gyr"],
        acc=content["imu_acc"],
        mag=content["imu_mag"],
        meta=ImuMeta(device=DEVICE, rate_nominal=rate, frame=Frame.ENU, north=North.MAGNETIC),
    )


def _track(content: dict[str, NDArray[Any]], t: Floats) -> AttitudeTrack:
    q_nb = content["opt_quat"]
    valid = np.isfinite(q_nb).all(axis=1)
    return AttitudeTrack(
        t=t,
        q_nb=q_nb,
        frame=Frame.ENU,
        north=North.MAGNETIC,
        score=(content["movement"] != 0) & valid,
        source=SOURCE,
    )


def _lost(content: dict[str, NDArray[Any]]) -> str:
    lost = int(np.count_nonzero(~np.isfinite(content["opt_quat"]).all(axis=1)))
    scored = int(np.count_nonzero(content["movement"]))
    rows = content["opt_quat"].shape[0]
    return f"reference lost in {lost} of {rows} samples; {scored} belong to the movement phase"
