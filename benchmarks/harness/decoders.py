"""Decoders under damage: frames lost beside the damaged ones, wrong frames believed, noise, and mutated bytes."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from benchmarks.harness.decoder_fuzz import Fuzzed, InNoise, fuzz, listen_to_noise
from benchmarks.harness.decoder_streams import HARMS, ON_A_BUS, Damaged, damage, frames_of, settled
from plumbob.protocols.checksum import CRC, algorithm
from plumbob.protocols.decode import decode
from plumbob.protocols.format import Format

SHARE = 0.02
RESYNC = 2
"""Undamaged frames in a row after which a decoder must have found its way again."""
_SURE = 0.9999  # a count above this quantile of what is declared is no chance


@dataclass(frozen=True, slots=True)
class Harmed:
    """What one way of damage did.

    Attributes
    ----------
    kind : str
        From `decoder_streams.HARMS`.
    faults : int
        Frames damaged.
    lost : int
        Undamaged frames that were not found.
    longest : int
        Most undamaged frames lost one after another.
    wrong : int
        Frames believed that were never sent.
    allowed : int
        As many of them as the check's size explains.
    """

    kind: str
    faults: int
    lost: int
    longest: int
    wrong: int
    allowed: int

    @property
    def met(self) -> bool:
        """Whether at most one frame was lost per fault, never more than two in a row, and none wrong but as allowed."""
        return self.lost <= self.faults and self.longest <= RESYNC and self.wrong <= self.allowed

    def summary(self) -> dict[str, Any]:
        """Values by name, for JSON."""
        return {**asdict(self), "met": self.met}


@dataclass(frozen=True, slots=True)
class OfOne:
    """Everything about one format's decoder.

    Attributes
    ----------
    name : str
        Of the format.
    check : str
        What guards a frame.
    harms : tuple of Harmed
        By way of damage; on a bus, bit flips only.
    noise : InNoise or None
        What random bytes passed for; None on a bus, where there is nothing to find.
    fuzzed : Fuzzed
        Mutated bytes.
    """

    name: str
    check: str
    harms: tuple[Harmed, ...]
    noise: InNoise | None
    fuzzed: Fuzzed

    def summary(self) -> dict[str, Any]:
        """Values by name, for JSON."""
        noise = self.noise.summary() if self.noise else None
        harms = {one.kind: one.summary() for one in self.harms}
        return {"check": self.check, "harms": harms, "noise": noise, "fuzzed": self.fuzzed.summary()}


@dataclass(frozen=True, slots=True)
class Decoders:
    """Result for all formats.

    Attributes
    ----------
    frames : int
        Frames per stream.
    formats : tuple of OfOne
        By format.
    """

    frames: int
    formats: tuple[OfOne, ...]

    @property
    def met(self) -> bool:
        """Whether every format keeps what is asked."""
        return all(harm.met for one in self.formats for harm in one.harms) and all(o.fuzzed.sound for o in self.formats)

    def summary(self) -> dict[str, Any]:
        """Values by name, for JSON."""
        return {"frames": self.frames, "met": self.met, "formats": {one.name: one.summary() for one in self.formats}}

    def text(self) -> str:
        """Tables of damage and of noise."""
        return "\n".join([*self._damage_lines(), "", *self._noise_lines()])

    def _damage_lines(self) -> Iterator[str]:
        yield f"{self.frames} frames, {SHARE:.0%} damaged: undamaged frames lost per fault, and wrong frames believed"
        yield f"{'':16}{'check':20}" + "".join(f"{kind:>15}" for kind in HARMS)
        for one in self.formats:
            cells = {harm.kind: _cell(harm) for harm in one.harms}
            yield f"{one.name:16}{one.check:20}" + "".join(f"{cells.get(kind, '–'):>15}" for kind in HARMS)
        yield "–: a bus cuts its transfers itself, so that no byte can come or go. Without a check every flipped bit is"
        yield "data. !: more than 1 lost per fault, over 2 in a row, or more wrong than the check's size explains."

    def _noise_lines(self) -> Iterator[str]:
        yield f"{'':16}{'random bytes':>14}{'believed':>10}{'expected':>10}{'mutated bytes':>15}{'waiting':>9}" + (
            f"{'may':>6}{'ms/kB':>9}"
        )
        for one in self.formats:
            noise, fuzzed = one.noise, one.fuzzed
            heard = (
                f"{noise.size:14}{noise.accepted:10}{noise.expected:10.2g}" if noise else f"{'–':>14}{'–':>10}{'–':>10}"
            )
            yield f"{one.name:16}{heard}{fuzzed.size:15}{fuzzed.pending:9}{fuzzed.bound:6}{fuzzed.per_kb_ms:9.4f}"


def _cell(harm: Harmed) -> str:
    return f"{harm.lost / harm.faults:.2f} / {harm.wrong}{'' if harm.met else ' !'}"


def measure_decoders(
    forms: Sequence[Format],
    *,
    frames: int = 20_000,
    noise: int = 100_000_000,
    fuzzing: int = 10_000_000,
    seed: int = 1,
    progress: Callable[[int], None] = lambda _: None,
) -> Decoders:
    """Damage streams of each format, and let its decoder hear noise and mutated bytes.

    Parameters
    ----------
    forms : sequence of Format
        Formats; options without a default get some value.
    frames : int
        Frames per stream.
    noise, fuzzing : int
        Random and mutated bytes.
    seed : int
        Seed; each way of damage has its own from it.
    progress : callable
        Told after each format how many are done.
    """
    found = []
    for number, form in enumerate(map(settled, forms), 1):
        found.append(_measure(form, frames, noise, fuzzing, seed))
        progress(number)
    return Decoders(frames, tuple(found))


def _measure(form: Format, frames: int, noise: int, fuzzing: int, seed: int) -> OfOne:
    sent = frames_of(form, frames, np.random.default_rng([seed, 0]))
    kinds = ON_A_BUS if form.framing.transfers else tuple(HARMS)
    harms = tuple(
        judge(form, kind, damage(form, sent, kind, SHARE, np.random.default_rng([seed, 1, number])))
        for number, kind in enumerate(kinds)
    )
    heard = None if form.framing.transfers else listen_to_noise(form, noise, np.random.default_rng([seed, 2]))
    return OfOne(form.name, _check_name(form), harms, heard, fuzz(form, fuzzing, np.random.default_rng([seed, 3])))


def _check_name(form: Format) -> str:
    check = form.framing.checksum
    return check.kind if check else "parity" if form.framing.parity else "none"


def judge(form: Format, kind: str, stream: Damaged) -> Harmed:
    """Decode a damaged stream, and compare what was found with what was sent whole."""
    found, _ = decode(stream.data, form)
    at = {int(start): frames.message.length for frames in found.values() for start in frames.start}
    missing = [at.get(start) != length for start, length in stream.whole.items()]
    wrong = sum(
        stream.data[start : start + length] not in stream.lost
        for start, length in at.items()
        if stream.whole.get(start) != length
    )
    return Harmed(kind, stream.faults, sum(missing), _longest(missing), wrong, _allowed(form, kind, stream.faults))


def _longest(missing: Sequence[bool]) -> int:
    most = run = 0
    for gone in missing:
        run = run + 1 if gone else 0
        most = max(most, run)
    return most


def _allowed(form: Format, kind: str, faults: int) -> int:
    """None where a cyclic check or parity guards; else what a check of so many bits lets pass by chance."""
    from scipy.stats import poisson

    check = form.framing.checksum
    if check is None:
        return 0 if form.framing.parity else faults
    how = algorithm(check.kind)
    if how.code == CRC or "flip" in kind:
        return 0
    return int(poisson.ppf(_SURE, faults * 0.5**how.width))
