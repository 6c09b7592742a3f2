"""A guided capture from a line, and its progress: drawn on a terminal while a unit is moved, or printed at the end."""

import shutil
import sys
import textwrap
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, TextIO

from plumbob.calibration.calibration import Capture, capture
from plumbob.calibration.predicted import NAMES, REGIONS, region_names
from plumbob.core.errors import CalibrationError
from plumbob.data import TITLES, ImuMeta
from plumbob.live.guide.guide import Guide, GuideSink, Progress
from plumbob.live.record import record
from plumbob.live.session import OutputSpec, RecordSpec, Session
from plumbob.live.session_toml import capture_session
from plumbob.live.sinks import Collected, Sink
from plumbob.live.transports.transport import Stop

if TYPE_CHECKING:
    from plumbob.data.cards import CalibrationCard

_EVERY: Final = 0.25
_SELDOM: Final = 5.0
_SEEN, _MISSING, _GOAL, _HERE = "■", "·", "○", "▣"
_LAYERS: Final = ("+z", "across z", "−z")
_ROWS: Final = ((1, -1), (1, 0), (1, 1)), ((0, -1), (0, 0), (0, 1)), ((-1, -1), (-1, 0), (-1, 1))


class Board:
    """Draws progress on standard error, over itself where that is a terminal.

    Elsewhere each event gets a line, and every 5 s what to do next.
    """

    def __init__(self, title: str, guide: Guide, out: TextIO | None = None) -> None:
        self._title, self._guide, self._out = title, guide, out or sys.stderr
        self._told = self._lines = 0
        self._next = 0.0

    def show(self, progress: Progress) -> None:
        """Show how it stands, a few times in a second, and what is new at once."""
        drawn = self._out.isatty()
        now = time.monotonic() if drawn else progress.elapsed
        new = self._guide.timeline[self._told :]
        if now < self._next and not new:
            return
        self.erase()
        self._told += len(new)
        for moment in new:
            self._tell(moment.t, moment.text)
        if drawn:
            self._out.write("\a" if new else "")  # who holds the unit does not look at the screen
            self._draw(progress)
        elif now >= self._next and not progress.done:
            self._tell(now, f"next: {progress.next_step}")
        if now >= self._next:
            self._next = now + (_EVERY if drawn else _SELDOM)
        self._out.flush()

    def erase(self) -> None:
        """Take away what was drawn, to write something else."""
        if self._lines:
            self._out.write(f"\033[{self._lines}F\033[J")
            self._lines = 0

    def _tell(self, t: float, text: str) -> None:
        self._out.write(f"{t:7.1f} s  {text}\n")

    def _draw(self, progress: Progress) -> None:
        width = shutil.get_terminal_size().columns - 1
        lines = [
            row
            for line in board_lines(self._title, progress)
            for row in textwrap.wrap(line, width, subsequent_indent=" " * 9) or [""]
        ]
        self._out.write("\n".join(lines) + "\n")
        self._lines = len(lines)


def board_lines(title: str, progress: Progress) -> list[str]:
    """Lines of a board."""
    lines = ["", f"{title}, {progress.elapsed:.0f} s; Ctrl-C ends it with what there is", ""]
    if progress.filled is not None:
        lines += [*map_lines(progress), ""]
    lines.append(f"now      {f'at rest for {progress.still_for:.1f} s' if progress.at_rest else 'moving'}")
    lines.append(f"next     {progress.next_step}")
    if progress.predicted:
        lines.append(f"so far   {progress.predicted}, {progress.grade or 'not usable'} as far as it goes")
    return [*lines, *(f"WARNING  {text}" for text in progress.warnings)]


def map_lines(progress: Progress) -> list[str]:
    """Map of the 18 directions: +x upward and +y to the right, in the three layers of z."""
    cells = _cells(progress)
    layers = [[" ".join(cells.get((x, y, z), " ") for x, y in row) for row in _ROWS] for z in (1, 0, -1)]
    count = 0 if progress.filled is None else int(progress.filled.sum())
    notes = (f"{count} of 18 seen", f"{_SEEN} seen  {_MISSING} missing", f"{_HERE} here  {_GOAL} next")
    head = "    ".join(f"{name:^8}" for name in _LAYERS) + "    +x upward, +y to the right"
    return [head, *("    ".join(f"{row:^8}" for row in rows) + f"    {note}"
                    for *rows, note in zip(*layers, notes, strict=True))]  # fmt: skip


def _cells(progress: Progress) -> dict[tuple[int, int, int], str]:
    cells = {}
    for region, place in enumerate(REGIONS.tolist()):
        filled = progress.filled is not None and progress.filled[region]
        mark = _SEEN if filled else _MISSING
        mark = _GOAL if region == progress.goal else mark
        mark = _HERE if region == progress.direction else mark
        x, y, z = (round(1.2 * value) for value in place)
        cells[x, y, z] = mark
    return cells


def guide_summary(guide: Guide, progress: Progress) -> dict[str, Any]:
    """What a guide saw, as JSON can hold it."""
    return {
        "guide": {
            "elapsed_s": progress.elapsed,
            "timeline": [{"t": moment.t, "text": moment.text} for moment in guide.timeline],
            "missing": None if progress.filled is None else [NAMES[i] for i in progress.missing],
            "next": progress.next_step,
            "predicted": progress.predicted,
            "grade": progress.grade,
            "warnings": list(progress.warnings),
            "done": progress.done,
        }
    }


def guide_text(guide: Guide, progress: Progress) -> str:
    """How a capture went, line by line, and what it lacks."""
    lines = [f"{moment.t:7.1f} s  {moment.text}" for moment in guide.timeline]
    lines.append(f"{progress.elapsed:7.1f} s  end of the capture")
    if progress.filled is not None:
        lines += ["", *map_lines(progress), "", f"missing      {region_names(progress.missing) or 'nothing'}"]
    if not progress.done:
        lines.append(f"what to add  {progress.next_step}")
    return "\n".join([*lines, ""])


def bare_session(file: Path | None, start: Any, device: str | None, raw: str | None, **line: Any) -> Session:
    """Session of a capture: nothing is estimated, and it is recorded to `raw` alone.

    A unit that is called like its format was not named, and a card needs a name.
    """
    session = capture_session(file, capture=start, device=device if file is None else None, **line)
    recorded = None if raw is None else replace(session.record or RecordSpec(""), path=raw)
    unit = session.meta.device
    if unit == session.form.name:
        unit = device or ImuMeta().device
    meta = replace(session.meta, device=unit)
    return replace(session, meta=meta, stage=None, record=recorded, output=OutputSpec(), send=())


def guided_capture(
    session: Session, guide: Guide, triads: tuple[str, ...], *, device: str | None, base: "CalibrationCard | None",
    stop: Stop, note: Callable[[str], object], opened: Callable[[], object],
) -> tuple[Capture, dict[str, Any]]:  # fmt: skip
    """Capture from a line, until the guide or somebody says stop, and what the guide says of it."""
    parts = [field.triad.rpartition(".") for field in session.form.message(session.message).fields if field.triad]
    present = {triad for unit, _, triad in parts if unit == session.unit}
    if missing := [name for name in triads if name not in present]:
        raise CalibrationError(f"the line has no {', '.join(missing)}, only {', '.join(sorted(present))}.")
    collected, board = Collected(), Board(f"calibration of the {TITLES[guide.triad]}", guide)

    def say(text: str) -> None:
        board.erase()
        note(text)

    sinks: list[Sink] = [collected, GuideSink(guide, stop, board.show)]
    note("waiting for samples; the capture ends when it is good, or by Ctrl-C with what there is")
    record(session, sinks=sinks, stop=stop, note=say, opened=opened)
    board.erase()
    if (imu := collected.imu(calibrated=False)) is None:
        raise CalibrationError(
            "no sample arrived over the line, so there is nothing to calibrate. See 'plumbob record'."
        )
    return capture(imu, triads=triads, device=device, base=base), guide_summary(guide, guide.progress())
