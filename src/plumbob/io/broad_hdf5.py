"""Arrays of a BROAD trial in HDF5, refusing every way in which such a file can point at another one."""

import math
import zlib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from plumbob._files import require_room
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
            return _arrays(h5py, hdf5, file.stat().st_size)
    except PlumbobError:
        raise
    except Exception as error:  # h5py raises many types for damaged input
        raise DecodeError(f"it is cut or damaged ({one_line(error)[:160]}); take a copy that is whole.") from error


def _arrays(h5py: Any, hdf5: Any, size: int) -> dict[str, NDArray[Any]]:
    require_keys([*hdf5.keys(), *(key for key in hdf5.attrs if key == RATE)])
    sets = {key: _own_dataset(h5py, hdf5, key) for key in SHAPES}
    require_shapes({key: tuple(dataset.shape) for key, dataset in sets.items()})
    if RATE not in hdf5.attrs:
        sets[RATE] = _own_dataset(h5py, hdf5, RATE)
    require_room(sum(dataset.size * dataset.dtype.itemsize for dataset in sets.values()), size)
    for key, dataset in sets.items():
        _require_whole_chunks(h5py, key, dataset, size)
    content = {key: dataset[()] for key, dataset in sets.items()}
    rate = np.asarray(content[RATE] if RATE in content else hdf5.attrs[RATE])
    if rate.dtype.kind not in "fiu":
        raise DecodeError(f"{RATE} must be a number, but its type is {rate.dtype}.")
    return content | {RATE: rate}


def _require_whole_chunks(h5py: Any, key: str, dataset: Any, size: int) -> None:
    """Refuse chunks that unpack to more than they state: the library would follow them as far as memory goes."""
    properties = dataset.id.get_create_plist()
    filters = [properties.get_filter(i)[0] for i in range(properties.get_nfilters())]
    if not set(filters) <= {h5py.h5z.FILTER_SHUFFLE, h5py.h5z.FILTER_DEFLATE, h5py.h5z.FILTER_FLETCHER32}:
        raise DecodeError(f"{key} is packed by a filter other than gzip; write it with gzip or unpacked.")
    if filters.count(h5py.h5z.FILTER_DEFLATE) > 1:
        raise DecodeError(f"{key} is packed twice; write it with gzip once.")
    if h5py.h5z.FILTER_DEFLATE not in filters:
        return
    most = math.prod(dataset.chunks) * dataset.dtype.itemsize + 4  # of a checksum
    for i in range(dataset.id.get_num_chunks()):
        chunk = dataset.id.get_chunk_info(i)
        if chunk.size > size:
            raise DecodeError(f"a chunk of {key} claims {chunk.size} bytes in a file of {size}, which cannot be.")
        skipped, packed = dataset.id.read_direct_chunk(chunk.chunk_offset)
        if not skipped and len(zlib.decompressobj().decompress(packed, most + 1)) > most:
            raise DecodeError(f"a chunk of {key} unpacks to more than the {most} bytes that it states.")


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
