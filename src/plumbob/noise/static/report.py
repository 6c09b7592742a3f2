"""What was found in a record that should be static: errors and warnings in words, and when it was still."""

from collections.abc import Mapping
from dataclasses import dataclass

from plumbob.errors import ShapeError


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing to know about a record.

    Attributes
    ----------
    kind : str
        ``"not finite"``, ``"short"``, ``"constant"``, ``"one way"``, ``"held"``, ``"clipped"``, ``"stuck"``,
        ``"moving"``, ``"periodic"``, ``"not at rest"``, ``"coarse"`` or ``"spikes"``.
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
    """

    findings: tuple[Finding, ...]
    steps: Mapping[str, float]
    moving: tuple[tuple[float, float], ...]
    still: tuple[float, float] | None

    @property
    def errors(self) -> tuple[Finding, ...]:
        """Findings for which an analysis would mislead."""
        return tuple(finding for finding in self.findings if finding.refuses)

    @property
    def warnings(self) -> tuple[Finding, ...]:
        """Findings that a reader must know."""
        return tuple(finding for finding in self.findings if not finding.refuses)

    def require(self) -> None:
        """Refuse a record with errors.

        Raises
        ------
        ShapeError
            With the first error, and how many there are.
        """
        if self.errors:
            more = f" ({len(self.errors) - 1} more)" if len(self.errors) > 1 else ""
            raise ShapeError(f"no static record: {self.errors[0]}{more}")
