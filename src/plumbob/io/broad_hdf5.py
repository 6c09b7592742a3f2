"""Arrays of a BROAD trial in HDF5, refusing every way in which such a file can point at another one."""

import math
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from plumbob.errors import DecodeError, MissingExtraError, PlumbobError, one_line
from plumbob.io.broad_keys import RATE, SHAPES, require_keys, require_shapes

_CHUNK_SLACK = 1_000_000  # values; a writer may choose chunks larger than a short data set


def load_hdf5(file: Path) -> dict[str, NDArray[Any]]:
    """Arrays of a trial.

    Raises
    ------
    MissingExtraError
        If h5py is not installed.
    DecodeError
        If keys are missing, data lie outside the file, or it is damaged.
    """
    try:
        import h5py
    except ImportError as error:
        raise MissingExtraError('HDF5 files need h5py; install it with: pip install "plumbob[hdf5]".') from error
    try:
        with h5py.File(file, "r") as hdf5:
            return _arrays(h5py, hdf5)
    except PlumbobError:
        raise
    except Exception as error:  # h5py raises many types for damaged input
        raise DecodeError(f"it is cut or damaged ({one_line(error)[:160]}); take a copy that is whole.") from error


def _arrays(h5py: Any, hdf5: Any) -> dict[str, NDArray[Any]]:
    require_keys([*hdf5.keys(), *(key for key in hdf5.attrs if key == RATE)])
    sets = {key: _own_dataset(h5py, hdf5, key) for key in SHAPES}
    require_shapes({key: tuple(dataset.shape) for key, dataset in sets.items()})
    rate = np.asarray(hdf5.attrs[RATE]) if RATE in hdf5.attrs else np.asarray(_own_dataset(h5py, hdf5, RATE)[()])
    if rate.dtype.kind not in "fiu":
        raise DecodeError(f"{RATE} must be a number, but its type is {rate.dtype}.")
    return {RATE: rate} | {key: dataset[()] for key, dataset in sets.items()}


def _own_dataset(h5py: Any, hdf5: Any, key: str) -> Any:
    """Return a plain numeric data set stored in this very file."""
    if hdf5.id.links.get_info(key.encode()).type != h5py.h5l.TYPE_HARD:  # asked without following it
        raise DecodeError(f"{key} is a link, which may lead to another file; links are refused.")
    dataset = hdf5[key]
    if not isinstance(dataset, h5py.Dataset) or dataset.shape is None or dataset.dtype.kind not in "fiub":
        raise DecodeError(f"{key} is no numeric data set.")
    if dataset.external or dataset.is_virtual:
        raise DecodeError(f"{key} is stored in another file; external and virtual data are refused.")
    if dataset.chunks and math.prod(dataset.chunks) > _CHUNK_SLACK + dataset.size:
        raise DecodeError(f"{key} claims chunks of {dataset.chunks} for {dataset.shape} values, which cannot be.")
    return dataset
