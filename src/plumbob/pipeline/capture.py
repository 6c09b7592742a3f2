"""A capture: the bytes of a line in a file, as a logger keeps them, without the times at which a host read them."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from plumbob._files import existing_file
from plumbob.clock import CountedTime
from plumbob.errors import DecodeError
from plumbob.link import Event, Received
from plumbob.pipeline.line import counts_of, time_spec
from plumbob.sensors.decode import Frames, decode
from plumbob.sensors.format import Format

_TOGETHER = 64
"""Frames that are handed on at a time."""


class CaptureSource:
    """A file of raw bytes as a line that is read as fast as it goes.

    No host was there, so each read is given the time that the frames themselves tell: the device's clock, else the
    frame counter and the rate, else their place and the rate. What only a host could tell is not known: how long the
    device was silent, where its counter went round more than half.

    Parameters
    ----------
    path : str
        The file.
    form : Format
        What its bytes mean, bound.
    message : str
        Which message has the samples.
    rate : float or None
        Frames per second, Hz, where the format does not say it.
    """

    def __init__(self, path: str, form: Format, message: str, rate: float | None = None) -> None:
        self._path, self._form, self._message, self._rate = Path(path), form, message, rate
        self._items: list[Received] | None = None

    @property
    def name(self) -> str:
        """Name of the file."""
        return self._path.name

    @property
    def finished(self) -> bool:
        """Whether everything has been handed on."""
        return self._items == []

    def open(self) -> "CaptureSource":
        """Read the file.

        Raises
        ------
        DecodeError
            If it is no regular file, cannot be read, or holds no frame of the message.
        """
        try:
            data = existing_file(self._path).read_bytes()
        except OSError as error:
            raise DecodeError(f"{self._path} cannot be read: {error.strerror}.") from error
        found, counts = decode(self._form, data)
        if self._message not in found:
            what = f"no frame of {self._form.name}, message {self._message}, in {counts.received} bytes"
            raise DecodeError(f"{self._path} holds {what}; 'plumbob decode' tries other formats.")
        frames = found[self._message]
        t_ns = self._times(frames)
        ends = [int(frames.start[k]) for k in range(_TOGETHER, len(frames), _TOGETHER)] + [len(data)]
        lasts = [*range(_TOGETHER - 1, len(frames) - 1, _TOGETHER)][: len(ends) - 1] + [len(frames) - 1]
        begins = [0, *ends[:-1]]
        self._items = [
            Received(int(t_ns[last]), data[begin:end]) for begin, end, last in zip(begins, ends, lasts, strict=True)
        ]
        return self

    def read(self, timeout: float) -> list[Received | Event]:
        """Next bytes."""
        if self._items is None:
            self.open()
        assert self._items is not None
        return [self._items.pop(0)] if self._items else []

    def close(self) -> None:
        """Nothing is held open."""

    def _times(self, frames: Frames) -> NDArray[np.int64]:
        spec = time_spec(self._form, frames.message)
        counted = CountedTime(replace(spec, rate=self._rate or spec.rate))
        return counted.after_first(frames.start, **counts_of(frames))
