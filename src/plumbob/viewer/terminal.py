"""The view in a terminal: the same batches as text, for who has no browser, as over ssh."""

import contextlib
import os
import select
import sys
import threading
import time
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np
from rich.cells import cell_len, set_cell_size
from rich.text import Text

from plumbob.core.flags import names
from plumbob.core.text import visible
from plumbob.core.units import to_deg
from plumbob.live.transports.transport import Stop
from plumbob.reporting.content import chinese_labels
from plumbob.rotations import Frame, North
from plumbob.rotations.frames import heading_of
from plumbob.viewer.charts import Tare, euler_deg
from plumbob.viewer.commands import ClientCommand
from plumbob.viewer.messages import Batch, Command, Hello
from plumbob.viewer.rows import REFERENCE

_EVERY: Final = 0.1
_STALE_NS: Final = 1_000_000_000
_EVENTS: Final = 50
_JOIN: Final = 1.0
_LABEL: Final = 12
_NARROW: Final = 76  # Columns below which a table of estimators stands closer
_TAPE: Final = 0.2  # Characters for a degree of the heading's tape
_SCALES: Final = {"gyr": 250.0, "acc": 20.0, "mag": 80.0}  # ends of the bars, °/s, m/s², µT, wider than most motions
_SENSORS: Final = (("gyr", "rate", "°/s", 2), ("acc", "force", "m/s²", 2), ("mag", "field", "µT", 1))


@dataclass(slots=True)
class Now:
    """What a terminal shows: the newest of everything that came."""

    hello: Hello | None = None  # what the columns are
    values: dict[str, float] = field(default_factory=dict)  # newest number of each column
    fields: Mapping[str, Any] = field(default_factory=dict)  # as `messages.Batch` has them
    t: float | None = None  # time of the newest sample, s
    words: int = 0  # its flags
    events: deque[str] = field(default_factory=lambda: deque(maxlen=_EVENTS))  # the newest at the end
    tare: Tare = field(default_factory=Tare)  # what angles count from


class Terminal:
    """Outlet on a terminal, whose key q sets `stop`."""

    def __init__(self, stop: Stop, lang: str = "en") -> None:
        self.now = Now()
        self._stop, self._words = stop, chinese_labels() if lang == "zh" else {}
        self._lock = threading.Lock()
        self._marks = 0

    def hello(self, hello: Hello) -> None:
        """Take over the columns."""
        with self._lock:
            self.now.hello = hello
            keys = {column.key for column in hello.columns}
            self.now.values = {key: value for key, value in self.now.values.items() if key in keys}

    def batch(self, batch: Batch) -> None:
        """Take the newest of a batch."""
        rows, hello = batch.rows, self.now.hello
        with self._lock:
            self.now.fields = batch.fields
            if hello is None or not len(rows["t"]):
                return
            self.now.t, self.now.words = float(rows["t"][-1]), int(rows["flags"][-1])
            last = rows["values"][-1]
            self.now.values.update({
                column.key: float(value)
                for column, value in zip(hello.columns, last, strict=True) if np.isfinite(value)
            })  # fmt: skip

    def event(self, t: float | None, kind: str, text: str) -> None:
        """Take an event."""
        when = "" if t is None else f"{t:.1f} s "
        with self._lock:
            self.now.events.append(visible(f"{when}{kind}: {text}"))

    def reset(self) -> None:
        """Forget what was shown."""
        with self._lock:
            self.now.values.clear()

    def answer(self, request: ClientCommand, ok: bool, text: str) -> None:
        """Show what became of a key."""
        if not ok:
            self.event(self.now.t, request.command.verb, text)

    @property
    def ready(self) -> bool:
        """A terminal shows the newest, whatever comes."""
        return True

    def take_commands(self) -> Sequence[ClientCommand]:
        """What keys ask for."""
        commands = []
        for key in _pressed():
            command = self._command(key)
            if command is not None:
                commands.append(ClientCommand(None, command))
        return commands

    def lines(self, width: int, height: int, now_ns: int) -> list[Text]:
        """What the screen shows: lines of at most `width`, `height` of them at most."""
        with self._lock:
            return _Screen(self.now, self._words, width, now_ns).lines(height)

    def _command(self, key: str) -> Command | None:
        """What a key asks of the session; what it asks of the view is done here."""
        live = self.now.hello is not None and self.now.hello.live
        if key == "q":
            self._stop.set()
        elif key == "t":
            self._tare()
        elif key == "r" and live:
            return Command(id=0, verb="record" if self.now.fields.get("recording") is None else "stop")
        elif key == "m" and live:
            self._marks += 1
            return Command(id=0, verb="mark", text=f"mark {self._marks}")
        elif key == " " and not live:
            playing = (self.now.fields.get("playback") or {}).get("playing")
            return Command(id=0, verb="pause" if playing else "play")
        return None

    def _tare(self) -> None:
        with self._lock:
            attitudes = self.now.fields.get("attitudes") or {}
            first = next(iter(attitudes.values()), None)
            if self.now.tare.is_set or first is None:
                self.now.tare.clear()
            else:
                self.now.tare.set(first["q_nb"])


class _Screen:
    """A screen of text."""

    def __init__(self, now: Now, words: Mapping[str, str], width: int, now_ns: int) -> None:
        self._now, self._words, self._width = now, words, width
        arrived = now.fields.get("arrived_ns")
        live = now.hello is not None and now.hello.live
        self._age = None if arrived is None or not live else (now_ns - arrived) / 1e9
        self._stale = self._age is not None and self._age * 1e9 > _STALE_NS

    def lines(self, height: int) -> list[Text]:
        if self._now.hello is None:
            return [Text(self._say("waiting"))]
        head = [*self._head(), *self._attitudes(), *self._tape(), *self._sensors(), *self._state()]
        room = max(0, height - len(head) - 1)
        events = [Text(line, style="dim") for line in list(self._now.events)[-room:]] if room else []
        lines = [*head, *events]
        lines += [Text("")] * (height - 1 - len(lines))
        lines = [*lines[: height - 1], Text(self._keys(), style="reverse")]
        for line in lines:
            if self._stale:
                line.stylize("bright_black")
            line.truncate(self._width, overflow="ellipsis")
            line.no_wrap = True
        return lines

    def _say(self, word: str) -> str:
        return self._words.get(f"terminal.{word}", self._words.get(word, word))

    def _head(self) -> Iterator[Text]:
        hello, now = self._now.hello, self._now
        assert hello is not None
        playback = now.fields.get("playback")
        if playback is not None:
            status = self._say("playing" if playback["playing"] else "paused")
        else:
            status = self._say("stale" if self._stale else "live" if now.t is not None else "waiting")
        line = Text(f"{visible(hello.session)}  ", style="bold")
        line.append(status, style="bold red" if self._stale else "bold green")
        line.append("  " if now.t is None else f"  {now.t:.2f} s")
        if now.tare.is_set:
            line.append(f"  {self._say('tared')}", style="yellow")
        yield line
        facts = f"{visible(hello.device)}, {visible(hello.format)}, {self._say('calibration')}: "
        line = Text(facts, style="dim")
        bare = hello.calibration == "uncalibrated"
        line.append(visible(self._say(hello.calibration)), style="bold yellow" if bare else "dim")
        yield line

    def _attitudes(self) -> Iterator[Text]:
        attitudes = self._now.fields.get("attitudes") or {}
        if not attitudes:
            return
        narrow = self._width < _NARROW
        title = [self._say(word) for word in ("estimator", "roll", "pitch", "yaw", "error")]
        yield Text(_row(title[0], [f"{word} [°]" for word in title[1:4]], title[4], narrow=narrow), style="dim")
        for name, attitude in attitudes.items():
            angles = euler_deg(self._now.tare.applied(np.array(attitude["q_nb"]))).tolist()
            sds = attitude["sd"] or [None] * 3
            cells = [f"{round(angle, 2) + 0.0:7.2f}{_sd(sd)}" for angle, sd in zip(angles, sds, strict=True)]
            error = "" if attitude["error"] is None else f"{attitude['error']:.2f}"
            label = self._say(name) if name == REFERENCE else visible(name)
            yield Text(_row(label, cells, error, narrow=narrow), style="dim" if name == REFERENCE else "bold")

    def _tape(self) -> Iterator[Text]:
        hello, attitudes = self._now.hello, self._now.fields.get("attitudes") or {}
        if hello is None or hello.frame is None or not attitudes:
            return
        q_nb = np.array(next(iter(attitudes.values()))["q_nb"])
        heading = float(to_deg(heading_of(q_nb, Frame(hello.frame))))
        width = self._width - 1
        yield Text(tape(heading, width))
        north = self._say(hello.north or North.FREE)
        yield Text(f"▲ {heading:05.1f}° {north}".rjust(width // 2 + len(f" {heading:05.1f}° {north}") + 1))

    def _sensors(self) -> Iterator[Text]:
        values = self._now.values
        for sensor, label, unit, digits in _SENSORS:
            if not any(f"{sensor}.{axis}" in values for axis in "xyz"):
                continue
            line = Text(_padded(self._say(label), _LABEL))
            bar = max(3, (self._width - _LABEL - 3 * 10 - 6) // 3)
            for axis in "xyz":
                value = values.get(f"{sensor}.{axis}")
                line.append("       - " if value is None else f"{value:8.{digits}f} ")
                line.append(_bar(value, _SCALES[sensor], bar), style="cyan")
                line.append(" ")
            line.append(unit, style="dim")
            yield line
        if "temp" in values:
            yield Text(f"{_padded(self._say('temperature'), _LABEL)}{values['temp']:8.2f} °C{self._residual()}")

    def _residual(self) -> str:
        """Residuals of the primary estimator."""
        hello, values = self._now.hello, self._now.values
        first = hello.estimators[0].name if hello is not None and hello.estimators else ""
        residuals = [
            f"{self._say(label)} {values[key]:.2f}°"
            for label, key in (("force", f"{first}.force_angle"), ("field", f"{first}.field_angle")) if key in values
        ]  # fmt: skip
        return f"   {self._say('residual')}: {', '.join(residuals)}" if residuals else ""

    def _state(self) -> Iterator[Text]:
        fields = self._now.fields
        risen = [self._say(name) for name in names(self._now.words)]
        line = Text(f"{self._say('flags')}: ")
        line.append(" ".join(risen) or self._say("none"), style="yellow" if risen else "dim")
        yield line
        link = fields.get("link") or {}
        if link:
            rate = "-" if link["rate"] is None else f"{link['rate']:.1f} Hz"
            parts = [rate, f"{link['samples']} {self._say('samples')}"]
            if self._age is not None:
                parts.append(f"{self._say('latency')} {1e3 * min(self._age, 9999.0):.0f} ms")
            drift = "" if link["drift_ppm"] is None else f" {link['drift_ppm']:+.1f} ppm"
            parts.append(f"{self._say('clock')} {link['clock']}{drift}")
            yield Text(", ".join(parts))
            bad = link["lost"] or link["junk"] or link["rejected"]
            counts = ", ".join(f"{self._say(name)} {link[name]}" for name in ("lost", "gaps", "junk", "rejected"))
            yield Text(counts, style="yellow" if bad else "dim")
        yield self._recorded()

    def _recorded(self) -> Text:
        fields, hello = self._now.fields, self._now.hello
        playback, file = fields.get("playback"), fields.get("recording")
        if playback is not None and hello is not None:
            total = f" {self._say('of')} {hello.duration:.1f} s" if hello.duration is not None else ""
            return Text(f"{self._say('at')} {playback['position']:.2f}{total}, × {playback['speed']:g}")
        if file is None:
            return Text(f"{self._say('recording')}: {self._say('nothing')}", style="dim")
        lost = f", {self._say('dropped')} {file['dropped']}" if file["dropped"] else ""
        text = f"● {Path(file['path']).name}: {file['acknowledged']}/{file['rows']} {self._say('rows')}{lost}"
        return Text(visible(text), style="bold red")

    def _keys(self) -> str:
        hello = self._now.hello
        live = hello is not None and hello.live
        keys = (("r", "record"), ("m", "mark")) if live else (("␣", "pause"),)
        return " " + "  ".join(f"{key} {self._say(word)}" for key, word in (("q", "quit"), *keys, ("t", "tare"))) + " "


def tape(heading: float, width: int) -> str:
    """Tape of headings around one, which stands in the middle: a tick every 10°, a number every 30°."""
    cells = ["·"] * width
    middle = width // 2
    reach = int(middle / _TAPE)
    for tick in range(-((reach - int(heading)) // 10) * 10 - 10, int(heading) + reach + 10, 10):
        at = middle + round((tick - heading) * _TAPE)
        label = {0: "N", 90: "E", 180: "S", 270: "W"}.get(tick % 360, f"{tick % 360:03d}")
        label = label if tick % 30 == 0 else "|"
        at -= len(label) // 2
        if at >= 0 and at + len(label) <= width:
            cells[at : at + len(label)] = label
    return "".join(cells)


def _sd(sd: float | None) -> str:
    if sd is None:
        return ""
    return f" ±{sd:.{2 if sd < 9.995 else 1 if sd < 99.95 else 0}f}"


def _row(name: str, cells: Sequence[str], error: str, *, narrow: bool) -> str:
    return (
        f"{_padded(name, 11 if narrow else 16)}{''.join(_padded(cell, 14 if narrow else 17) for cell in cells)}{error}"
    )


def _padded(text: str, width: int) -> str:
    """Text with spaces behind it, by the cells that it takes: a Chinese sign takes two."""
    return set_cell_size(text, width) if cell_len(text) > width else text + " " * (width - cell_len(text))


def _bar(value: float | None, end: float, width: int) -> str:
    """Bar around its middle: where a value lies between −`end` and `end`."""
    cells = ["─"] * width
    middle = width // 2
    cells[middle] = "┼"
    if value is not None:
        place = middle + round(max(-1.0, min(1.0, value / end)) * middle)
        cells[min(place, width - 1)] = "█"
    return "".join(cells)


def _pressed() -> str:
    """Keys that were pressed since the last call."""
    if not sys.stdin.isatty() or not select.select([sys.stdin], [], [], 0.0)[0]:
        return ""
    with contextlib.suppress(OSError):
        return os.read(sys.stdin.fileno(), 64).decode(errors="ignore")
    return ""


@contextmanager
def keys_at_once() -> Iterator[None]:
    """Terminal that gives each key as it is pressed, and does not show it."""
    try:
        import termios
        import tty
    except ImportError:  # a system without them: no keys, but Ctrl-C
        yield
        return
    if not sys.stdin.isatty():
        yield
        return
    before = termios.tcgetattr(sys.stdin)
    tty.setcbreak(sys.stdin)
    try:
        yield
    finally:
        termios.tcsetattr(sys.stdin, termios.TCSADRAIN, before)


@contextmanager
def painted(terminal: Terminal) -> Iterator[None]:
    """Screen that a thread keeps up to date: a terminal that does not take its text keeps nobody else waiting."""
    from rich.console import Console, Group
    from rich.live import Live

    console, ended = Console(file=sys.__stdout__), threading.Event()  # what steers it is our own

    def paint() -> None:
        with contextlib.suppress(OSError), Live(console=console, screen=True, auto_refresh=False) as live:
            while not ended.wait(_EVERY):
                size = console.size
                live.update(Group(*terminal.lines(size.width, size.height, time.monotonic_ns())), refresh=True)

    painter = threading.Thread(target=paint, daemon=True)
    painter.start()
    try:
        yield
    finally:
        ended.set()
        painter.join(_JOIN)
