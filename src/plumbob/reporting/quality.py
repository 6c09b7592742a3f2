"""Description of what the motion of a recording says about its conventions."""

from plumbob.quality.diagnosis import Diagnosis
from plumbob.reporting.content import Table
from plumbob.reporting.report import Report


def diagnosis(d: Diagnosis) -> Report:
    """Verdicts, lines of the profile, and remarks."""
    rows = [
        (f"{it.sensor} {it.question}", str(it.answer), it.odds,
         f"{'WRONG: ' if it.wrong else ''}{it.value}{it.why and f' ({it.why})'}")
        for it in d.findings
    ]  # fmt: skip
    lines = [(line,) for line in d.lines]
    profile = [Table("Lines of the profile", ("",), lines, words=(0,))] if lines else []
    tables = (Table("Answers", ("question", "answer", "odds", "found"), rows, words=(1, 3)), *profile)
    return Report("Conventions", facts=tuple(d.facts().items()), tables=tables, remarks=d.remarks)
