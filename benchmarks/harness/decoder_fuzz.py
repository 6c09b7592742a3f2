"""Bytes that no device sends: what passes for a frame in noise, and whether anything makes a decoder fail or grow."""

import time
from dataclasses import asdict, dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from benchmarks.harness.decoder_streams import frames_of
from benchmarks.harness.false_accepts import false_accepts
from plumbob.protocols.decode import Decoder
from plumbob.protocols.format import Format

_BLOCK: Final = 1 << 16
_CHUNK: Final = 4096


@dataclass(frozen=True, slots=True)
class InNoise:
    """What was taken for frames in random bytes.

    Attributes
    ----------
    size : int
        Random bytes.
    accepted : int
        Frames of known messages.
    expected : float
        As many as follow from the format.
    """

    size: int
    accepted: int
    expected: float

    def summary(self) -> dict[str, Any]:
        """Values by name, for JSON."""
        return asdict(self)


@dataclass(frozen=True, slots=True)
class Fuzzed:
    """How a decoder took mutated bytes.

    Attributes
    ----------
    size : int
        Bytes fed.
    frames : int
        Frames that came out.
    pending, bound : int
        Most bytes that ever waited for more, and how many may: one frame, and a sync behind it.
    reads : int
        Most reads that were remembered for their time, beyond one per byte that waits.
    per_kb_ms : float
        Time per kilobyte, ms.
    """

    size: int
    frames: int
    pending: int
    bound: int
    reads: int
    per_kb_ms: float

    @property
    def sound(self) -> bool:
        """Whether nothing grew."""
        return self.pending <= self.bound and self.reads <= 1

    def summary(self) -> dict[str, Any]:
        """Values by name, for JSON."""
        return asdict(self)


def listen_to_noise(form: Format, size: int, rng: np.random.Generator) -> InNoise:
    """Feed random bytes."""
    decoder, left = Decoder(form), size
    while left:
        part = min(left, 1 << 20)
        decoder.feed(rng.bytes(part))
        left -= part
    decoder.finish()
    return InNoise(size, sum(decoder.counts.frames.values()), false_accepts(form) * size)


def fuzz(form: Format, size: int, rng: np.random.Generator) -> Fuzzed:
    """Feed frames with changed, missing, added, repeated and swapped bytes, in pieces of any size.

    Raises
    ------
    Exception
        Whatever the decoder raises; it should raise nothing.
    """
    decoder, fed, pending, reads = Decoder(form), 0, 0, 0
    frames = np.frombuffer(b"".join(frames_of(form, max(1, _BLOCK // form.framing.most), rng)), dtype=np.uint8)
    began = time.process_time()
    while fed < size:
        block = mutated(frames, rng)[: size - fed].tobytes()
        at = 0
        while at < len(block):
            step = int(rng.integers(1, _CHUNK))
            decoder.feed(block[at : at + step], fed + at)
            at += step
            pending = max(pending, decoder.counts.pending)
            reads = max(reads, decoder.remembered - decoder.counts.pending)
        fed += len(block)
    decoder.finish()
    spent = 1e3 * (time.process_time() - began) / (fed / 1e3)
    bound = form.framing.most + len(form.framing.sync[0] if form.framing.sync else b"")
    return Fuzzed(fed, sum(decoder.counts.frames.values()), pending, bound, reads, spent)


def mutated(frames: NDArray[np.uint8], rng: np.random.Generator) -> NDArray[np.uint8]:
    """Bytes with some changed, some dropped, some doubled, and a piece moved; how many differs from call to call."""
    share = 10.0 ** rng.uniform(-4, -0.5)
    data = frames.copy()
    hit = rng.random(data.size) < share
    data[hit] = rng.integers(0, 256, int(hit.sum()), dtype=np.uint8)
    times = np.ones(data.size, dtype=np.int64)
    times[rng.random(data.size) < share / 4] = 0
    times[rng.random(data.size) < share / 4] = 2
    data = np.repeat(data, times)
    first, second = sorted(rng.integers(0, data.size, 2).tolist())
    return np.concatenate([data[second:], data[first:second], data[:first]])
