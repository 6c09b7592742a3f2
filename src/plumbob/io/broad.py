"""Trials of BROAD, the Berlin robust orientation estimation data set (doi:10.3390/data6070072, CC BY 4.0).

A trial is recognised by its content, not by its name. It holds a 9-axis unit and an optical reference on one time
line; the same content comes as HDF5 and as MATLAB v5.
"""

from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from plumbob._files import existing_file, reading
from plumbob.check import Floats
from plumbob.data import AttitudeTrack, ImuData, ImuMeta
from plumbob.errors import DecodeError
from plumbob.io.broad_hdf5 import load_hdf5
from plumbob.io.broad_mat import load_mat
from plumbob.io.recording import Recording
from plumbob.rotations import Frame, North

DEVICE: Final = "Myon aktos-t"
SOURCE: Final = "BROAD optical reference (OptiTrack)"
_PROVENANCE: Final = "from the BROAD data set, doi:10.3390/data6070072, CC BY 4.0"
_HDF5_SIGNATURE = b"\x89HDF\r\n\x1a\n"
_MAT5_SIGNATURE = b"MATLAB 5.0"
_LOADERS = {_HDF5_SIGNATURE: load_hdf5, _MAT5_SIGNATURE: load_mat}


def read_broad(path: str | Path) -> Recording:
    """Read a trial: samples, and the reference in ENU with magnetic north.

    The reference's `score` marks the samples of the movement phase in which the reference is known.

    Raises
    ------
    DecodeError
        If the file is neither HDF5 nor MATLAB v5, is no BROAD trial, is damaged, or refers to other files.
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
    known = np.isfinite(q_nb).all(axis=1)
    return AttitudeTrack(
        t=t,
        q_nb=q_nb,
        frame=Frame.ENU,
        north=North.MAGNETIC,
        score=(content["movement"] != 0) & known,
        source=SOURCE,
    )


def _lost(content: dict[str, NDArray[Any]]) -> str:
    lost = int(np.count_nonzero(~np.isfinite(content["opt_quat"]).all(axis=1)))
    scored = int(np.count_nonzero(content["movement"]))
    rows = content["opt_quat"].shape[0]
    return f"reference lost in {lost} of {rows} samples; {scored} belong to the movement phase"
