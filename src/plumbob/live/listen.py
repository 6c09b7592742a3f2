"""Draft a profile: of a text file, or of what a device prints."""

import os
import re
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from plumbob.core.errors import DecodeError, LineError
from plumbob.core.files import as_list, existing_file
from plumbob.core.units import Quantity, given
from plumbob.files.draft import Draft, drafted

if TYPE_CHECKING:
    from plumbob.live.transports.serial_line import SerialSource
    from plumbob.live.transports.transport import Received, Source

STDIN: Final = "-"  # word for standard input
BAUDS: Final = (115200, 9600, 57600, 38400, 230400, 19200, 460800, 921600, 1_000_000, 4800)  # the most common first
_PROBE, _ENOUGH = 2.5, 1000  # s or bytes in which a speed shows what it gives
_CLEAR, _LIKELY = 0.98, 0.6  # share of text above which a speed is right, and above which it may be


def profile(
    path: str | os.PathLike[str] | Sequence[str | os.PathLike[str]],
    *,
    baud: int | None = None,
    duration: float | str = 10.0,
    accept: bool = False,
    answers: Mapping[str, Any] | None = None,
    out: str | os.PathLike[str] | None = None,
    note: Callable[[str], object] | None = None,
) -> Draft:
    """Draft the profile of a text file, or of lines that a device prints; every guess is a question.

    Parameters
    ----------
    path : path or sequence of paths
        The text file; several of one recording, with a sensor each; a serial port, to which it listens; or ``-`` for
        standard input.
    baud : int, optional
        Speed of a port; without it, the first of the usual ones at which text comes. Where none stands out, or frames
        come, it is not guessed.
    duration : float or str
        How long to listen to a port: s, or text with a unit.
    accept : bool
        Take every guess for which the file has evidence: a name, a unit, a size that is gravity's or the Earth's
        field's. What nothing speaks for stays a question, but body axes are then those of the sensor, and the
        navigation frame, which a filter asks for anyway, is left out.
    answers : mapping, optional
        By dotted key, as ``{"frame": "ENU", "gyr.unit": "deg/s"}``; also of keys that were not asked. What is of
        a sensor that the file lacks is passed over.
    out : path, optional
        Where to write the draft; ``NAME.profile.toml`` beside ``NAME.csv`` is found again by `plumbob.read`. With
        `accept` nothing is written while questions are open.
    note : callable, optional
        Called with each remark as it is made.

    Returns
    -------
    Draft
        The profile. `plumbob.read` refuses it until no value begins with ``?``.

    Raises
    ------
    DecodeError
        If there is no table of numbers, nothing in it can give an attitude, an answer does not fit, or the system
        refuses to write.
    ParameterError
        If `out` exists: somebody may have answered it.
    LineError
        If the port cannot be opened, nothing comes, or no speed stands out.
    """
    paths = as_list(path)
    if not is_line(paths[0]):
        return drafted([existing_file(item) for item in paths], accept=accept, answers=answers, out=out)
    port, seconds = os.fspath(paths[0]), given("duration", duration, Quantity.TIME, positive=True) or 0.0
    with tempfile.TemporaryDirectory(prefix="plumbob-") as folder:
        file = Path(folder) / f"{Path(port).name.strip('-') or 'lines'}.txt"
        heard, lasted = _heard(port, baud, seconds, note or print)
        file.write_bytes(heard)
        try:
            return drafted([file], accept=accept, answers=answers, out=out, heard=lasted)
        except DecodeError as error:
            raise DecodeError(str(error).replace(str(file), port)) from error


def is_line(path: str | os.PathLike[str]) -> bool:
    """Whether a path is a serial port, or the word for standard input."""
    return os.fspath(path) == STDIN or Path(path).is_char_device()


def _heard(port: str, baud: int | None, seconds: float, note: Callable[[str], object]) -> tuple[bytes, float]:
    """Whole lines that come in that time, and how long they came, s; inf where nothing is waited for."""
    from plumbob.live.session import SourceSpec
    from plumbob.live.sources import make_source

    settings: dict[str, Any] = {} if port == STDIN else {"port": port, "baud": baud or BAUDS[0]}
    source: Any = make_source(SourceSpec("serial" if settings else "stdin", settings)).open()
    note(f"listening to {source.name}" + (f" for {seconds:g} s" if settings else ""))
    items = [] if baud or not settings else _at_its_speed(source, seconds, note)
    items += _taken(source, seconds if settings else inf)
    source.close()
    if not items:
        raise LineError(f"nothing has come from {port} in {seconds:g} s: is the device on, does it send by itself?")
    data = _joined(items)
    lasted = 1e-9 * (items[-1].t_ns - items[0].t_ns) if settings else inf
    return data[: max(data.rfind(b"\n"), data.rfind(b"\r")) + 1] or data, lasted


def _taken(source: "Source", seconds: float, most: float = inf) -> "list[Received]":
    """What comes in that time, or until there is enough."""
    from plumbob.live.transports.transport import Received

    items, size, end = list[Received](), 0, time.monotonic() + seconds
    while not source.finished and time.monotonic() < end and size < most:
        items += (came := [item for item in source.read(0.1) if isinstance(item, Received)])
        size += sum(len(item.data) for item in came)
    return items


def _joined(items: "Sequence[Received]") -> bytes:
    return b"".join(item.data for item in items)


def _at_its_speed(source: "SerialSource", seconds: float, note: Callable[[str], object]) -> "list[Received]":
    """What came at the first speed, if that is text or nothing; else set the port to the speed at which text comes."""
    items = _taken(source, seconds, _ENOUGH)
    if not items or _text_share(_joined(items)) >= _CLEAR:
        return items
    heard = {BAUDS[0]: _joined(items)}
    for baud in BAUDS[1:]:
        source.set_baud(baud)
        heard[baud] = _joined(_taken(source, _PROBE, _ENOUGH))
        if _text_share(heard[baud]) >= _CLEAR:
            break
    from plumbob.protocols.page import other_format

    (best, baud), (second, _), *_ = shares = sorted(((_text_share(heard[b]), b) for b in heard), reverse=True)
    if best < max(_LIKELY, 2.0 * second):
        listed = ", ".join(f"{share:.0%} at {b}" for share, b in shares)
        frames = (f"{words[:-1]} at {b} baud." for b in heard if (words := other_format(None, heard[b])))
        raise LineError(f"no speed stands out, by the share of lines that are text: {listed}.{next(frames, '')} "
                        "Give --baud.")  # fmt: skip
    source.set_baud(baud)
    note(f"{source.name} sends text at {baud} baud; record it with --baud {baud}")
    return []


def _text_share(data: bytes) -> float:
    """Share of the bytes of whole lines that stand in lines of printable text, where one of these has a digit."""
    lines = re.split(rb"[\r\n]+", data)[1:-1]
    words = [line.decode(errors="replace").replace("\t", " ") for line in lines]
    text = [line for line, word in zip(lines, words, strict=True) if word.isprintable() and "\ufffd" not in word]
    return len(b"".join(text)) / len(b"".join(lines)) if re.search(rb"\d", b"".join(text)) else 0.0
