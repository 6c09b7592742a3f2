"""Draft a profile: of a text file, or of what a device prints."""

import os
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from plumbob.core.errors import LineError
from plumbob.core.files import as_list, existing_file
from plumbob.core.units import Quantity, given
from plumbob.files.draft import Draft, drafted

STDIN: Final = "-"  # word for standard input


def profile(
    path: str | os.PathLike[str] | Sequence[str | os.PathLike[str]],
    *,
    baud: int = 115200,
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
    baud : int
        Speed of a port.
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
        If the port cannot be opened, or nothing comes.
    """
    paths = as_list(path)
    if not is_line(paths[0]):
        return drafted([existing_file(item) for item in paths], accept=accept, answers=answers, out=out)
    port, seconds = os.fspath(paths[0]), given("duration", duration, Quantity.TIME, positive=True) or 0.0
    with tempfile.TemporaryDirectory(prefix="plumbob-") as folder:
        file = Path(folder) / f"{Path(port).name.strip('-') or 'lines'}.txt"
        file.write_bytes(_heard(port, baud, seconds, note or print))
        return drafted([file], accept=accept, answers=answers, out=out, numbered=True)


def is_line(path: str | os.PathLike[str]) -> bool:
    """Whether a path is a serial port, or the word for standard input."""
    return os.fspath(path) == STDIN or Path(path).is_char_device()


def _heard(port: str, baud: int, seconds: float, note: Callable[[str], object]) -> bytes:
    """Whole lines that come in that time."""
    from plumbob.live.session import SourceSpec
    from plumbob.live.sources import make_source
    from plumbob.live.transports.transport import Received

    settings: dict[str, Any] = {} if port == STDIN else {"port": port, "baud": baud}
    source = make_source(SourceSpec("serial" if settings else "stdin", settings)).open()
    note(f"listening to {source.name}" + (f" for {seconds:g} s" if settings else ""))
    data, end = b"", time.monotonic() + seconds
    while not source.finished and (not settings or time.monotonic() < end):
        data += b"".join(item.data for item in source.read(0.1) if isinstance(item, Received))
    source.close()
    if not data:
        raise LineError(f"nothing has come from {port} in {seconds:g} s: is the device on, does it send by itself?")
    return data[: max(data.rfind(b"\n"), data.rfind(b"\r")) + 1] or data
