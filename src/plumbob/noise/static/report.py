"""What was found in a record that should be static: errors and warnings in words, and when it was still."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from plumbob.errors import ShapeError


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing to know about a record.

    Attributes
    ----------
    kind : str
        ``"not finite"``, ``"short"``, ``"constant"``, ``"one way"``, ``"interleaved"``, ``"held"``, ``"clipped"``,
        ``"stuck"``, ``"moving"``, ``"disturbed"``, ``"periodic"``, ``"not at rest"``, ``"coarse"`` or ``"spikes"``.
    channel : str
        Name of the channel; where it concerns all, their names.
    refuses : bool
        Whether an analysis of the channel would mislead.
    text : str
        One sentence, without the channel.
    """

    kind: str
    channel: str
    refuses: bool
    text: str

    def concerns(self, channel: str) -> bool:
        """Whether it is about a channel, alone or with others; a name may hold a comma."""
        return channel == self.channel or channel in self.channel.split(", ")

    def __str__(self) -> str:
        """Sentence with the channel."""
        return f"{self.channel}: {self.text}"


@dataclass(frozen=True)
class StaticReport:
    """What was found in a record.

    Attributes
    ----------
    findings : tuple of Finding
        Errors and warnings.
    steps : mapping of str to float
        Step of the values of each channel, in their unit; 0 where none was found.
    moving : tuple of (float, float)
        When something moved or was stuck, s, in order.
    still : (float, float) or None
        Longest stretch without, s, if it has enough samples.
    skipped : mapping of str to tuple of (float, float)
        Times, s, that an analysis of a channel leaves out, with their margins.
    """

    findings: tuple[Finding, ...]
    steps: Mapping[str, float]
    moving: tuple[tuple[float, float], ...]
    still: tuple[float, float] | None
    skipped: Mapping[str, tuple[tuple[float, float], ...]] = field(default_factory=dict)

    @property
    def errors(self) -> tuple[Finding, ...]:
        """Findings for which an analysis would mislead."""
        return tuple(finding for finding in self.findings if finding.refuses)

    @property
    def warnings(self) -> tuple[Finding, ...]:
        """Findings that a reader must know."""
        return tuple(finding for finding in self.findings if not finding.refuses)

    def refused(self, *channels: str) -> bool:
        """Whether an analysis of any of the channels would mislead."""
        return any(finding.concerns(channel) for finding in self.errors for channel in channels)

    def require(self, *sensors: Sequence[str]) -> None:
        """Refuse a record of which no sensor can be analysed.

        Parameters
        ----------
        *sensors : sequence of str
            Names of the channels of each sensor; without any, one error refuses the record.

        Raises
        ------
        ShapeError
            With the first error, and how many there are.
        """
        if self.errors and all(self.refused(*names) for names in sensors):
            more = f" ({len(self.errors) - 1} more)" if len(self.errors) > 1 else ""
            raise ShapeError(f"no static record: {self.errors[0]}{more}")
