"""A capture: the bytes of a line in a file, as a logger keeps them, without the times at which a host read them."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from plumbob.clock import Counter, TimeSpec
from plumbob.errors import DecodeError, ParameterError
from plumbob.link import Event, Received
from plumbob.pipeline.line import time_spec
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
            If it cannot be read, or holds no frame of the message.
        ParameterError
            If nothing tells the time.
        """
        try:
            data = self._path.read_bytes()
        except OSError as error:
            raise DecodeError(f"{self._path} cannot be read: {error.strerror}.") from error
        found, counts = decode(self._form, data)
        if self._message not in found:
            what = f"no frame of {self._form.name}, message {self._message}, in {counts.received} bytes"
            raise DecodeError(f"{self._path} holds {what}; 'plumbob decode' tries other formats.")
        frames = found[self._message]
        t_ns = frame_times(self._form, frames, self._rate)
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


def frame_times(form: Format, frames: Frames, rate: float | None) -> NDArray[np.int64]:
    """Times (N,) that frames tell of themselves, ns from the first, never going back.

    Parameters
    ----------
    form : Format
        Their format.
    frames : Frames
        Frames of one message.
    rate : float or None
        Frames per second, Hz, where the format does not say it.

    Raises
    ------
    ParameterError
        If there is neither a clock nor a rate.
    """
    spec = time_spec(form, frames.message)
    period = rate or form.framing.rate
    if spec.clock is None and period is None:
        raise ParameterError(f"{form.name} has neither a clock nor a rate to tell the time by; give the rate.")
    return np.asarray(np.maximum.accumulate(_told(spec, frames, period)), dtype=np.int64)


def _told(spec: TimeSpec, frames: Frames, rate: float | None) -> NDArray[np.int64]:
    clock, count = frames.message.of_role("clock"), frames.message.of_role("counter")
    if clock is not None and spec.clock is not None and spec.clock.tick is not None:
        tick = spec.clock.tick
        steps = _unwrapped(spec.clock, frames.columns[clock.name])
        return np.asarray(steps * tick.numerator // tick.denominator)
    period = 1e9 / float(rate or 1.0)
    if count is not None and spec.frames is not None:
        return np.asarray(np.rint(_unwrapped(spec.frames, frames.columns[count.name]) * period), dtype=np.int64)
    places = (frames.start - frames.start[0]) / frames.message.length if spec.frame_bytes else np.arange(len(frames))
    return np.asarray(np.rint(places * period), dtype=np.int64)


def _unwrapped(counter: Counter, counts: NDArray[np.float64] | NDArray[np.int64]) -> NDArray[np.int64]:
    """Counts (N,) from the first on; a step is taken for the shorter way round."""
    half, size = counter.modulus // 2, counter.modulus
    whole = counts.astype(np.int64)
    steps = (whole[1:] - whole[:-1]) * (-1 if counter.down else 1)
    return np.concatenate([[0], np.cumsum((steps + half) % size - half)]).astype(np.int64)
