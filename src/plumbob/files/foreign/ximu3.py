"""Logs of x-IMU3 (x-io Technologies): ``.ximu3``, and the folder of CSV that its GUI makes of one device's.

A log is a row of messages that end in a line feed: ASCII as ``I,1000000,…``, or binary, whose first byte is that of
ASCII plus 0x80, with the time in µs (64 bits) and numbers of 32 bits, least byte first; a line feed in them is DB DC,
and DB is DB DD. There is no checksum, so a message counts by its identity and its length. Units, files and headings are
those of x-IMU3-Software, generate_data_messages.json: rate in deg/s, acceleration (specific force) in g, and the
magnetic field in arbitrary units, 1 at the place of calibration, whose size in µT is not known.

The quaternion describes the sensor relative to the Earth, scalar first, North-West-Up unless the device was set
otherwise (Fusion, README).
"""

import re
import struct
from array import array
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from plumbob.core.check import Floats
from plumbob.core.errors import DecodeError
from plumbob.core.findings import Note, info, warning
from plumbob.data import ImuMeta
from plumbob.data.recording import Recording
from plumbob.files.foreign.logged import RELATIVE_NOTE, LoggedAttitude, SensorLog
from plumbob.files.foreign.parts import Parts, names_in, sheet
from plumbob.files.known_logs import KNOWN_TABLES
from plumbob.rotations import Frame, North

_HEADINGS: Final[Mapping[str, list[str]]] = KNOWN_TABLES["ximu3"]  # of the messages that are read
NUMBERS: Final = {letter: len(names) for letter, names in _HEADINGS.items()}
TABLES: Final = {"I": "Inertial.csv", "M": "Magnetometer.csv", "Q": "Quaternion.csv", "T": "Temperature.csv"}
STAMP: Final = "Timestamp (us)"
_SOURCE: Final = "the x-IMU3's own attitude, which is an estimate and not a reference"
_Messages = dict[str, tuple[NDArray[np.int64], Floats]]


def accepts(path: Path) -> bool:
    """Whether a path is a log of x-IMU3, or a folder or a file with its table of inertial messages."""
    if path.suffix.lower() == ".ximu3" and path.is_file():
        return True
    parts = Parts(path)
    name = TABLES["I"] if path.is_dir() else path.name
    return name in parts.names and names_in(parts.start(name))[:2] == (STAMP, "Gyroscope X (deg/s)")


def read(path: Path) -> Recording:
    """Read a log of x-IMU3, its table of inertial messages, or the folder of one device's tables."""
    notes: list[Note] = [info("source.ximu3")]
    if path.suffix.lower() == ".ximu3":
        messages, answers = _of_log(path.read_bytes(), notes)
    else:
        parts = Parts(path)
        messages = _of_tables(parts, path.is_dir(), notes)
        answers = parts.text("Command.json") if "Command.json" in parts.names else ""
    return _recording(path.stem, messages, answers, notes)


def _recording(name: str, messages: _Messages, answers: str, notes: list[Note]) -> Recording:
    if "I" not in messages:
        raise DecodeError(f"it has no inertial message; {'; '.join(map(str, notes[1:])) or 'is this the file?'}.")
    frame, north, how = _convention(answers)
    log = SensorLog(notes, ImuMeta(device="x-IMU3", frame=frame, unit_check=False))
    stamps, inertial = messages["I"]
    log.add("gyr", stamps, inertial[:, :3], "deg/s")
    log.add("acc", stamps, inertial[:, 3:], "g")
    if "M" in messages:
        log.add("mag", *messages["M"], "relative")
        notes.append(RELATIVE_NOTE)
    if "T" in messages:
        log.add("temp_c", messages["T"][0], messages["T"][1][:, 0])
    if "Q" in messages:
        log.attitudes.append(LoggedAttitude(*messages["Q"], _SOURCE, frame, north, f"{_SOURCE}; {how}"))
    return log.recording(name)


def _convention(answers: str) -> tuple[Frame, North, str]:
    """Frame and north of the attitude by the settings among the answers to commands, and how they are known."""
    axes = re.search(r'"ahrs_?axes_?convention" *: *([012])', answers, re.IGNORECASE)
    ignored = re.search(r'"ahrs_?ignore_?magnetometer" *: *(true|false)', answers, re.IGNORECASE)
    frame = (Frame.NWU, Frame.ENU, Frame.NED)[int(axes[1])] if axes else Frame.NWU
    north = North.MAGNETIC if ignored and ignored[1] == "false" else North.FREE
    how = f"{frame}, as {'its settings say' if axes else 'x-IMU3 has it unless it was set to ENU or NED'}"
    if not ignored:
        how += "; the file does not say whether the magnetometer was used, so headings count from where it began"
    return frame, north, how


def _of_log(raw: bytes, notes: list[Note]) -> tuple[_Messages, str]:
    """Messages by their letter, and the answers to commands."""
    answers: list[str] = []
    rows = {letter: array("d") for letter in NUMBERS}  # time in µs and numbers, one message after another
    others = junk = 0
    lines = raw.split(b"\n")
    if lines.pop():
        notes.append(warning("reading.cut_last_message"))
    for line in lines:
        letter = chr(line[0] & 0x7F) if line else ""
        if letter in NUMBERS:
            numbers = (_binary if line[0] & 0x80 else _ascii)(line, NUMBERS[letter])
            rows[letter].extend(numbers)
            junk += not numbers
            continue
        if line[:1] == b"{":
            answers.append(line.decode("utf-8", "replace"))
        is_other = line[:1] == b"{" or (letter != "" and letter in "IMQRALEHTBWSNFPKCY")
        others, junk = others + is_other, junk + (not is_other)
    if others:
        notes.append(info("source.messages_left_out", others=others))
    if junk:
        notes.append(warning("reading.damage_ximu3", junk=junk))
    tables = {letter: np.frombuffer(rows[letter]).reshape(-1, 1 + count) for letter, count in NUMBERS.items()}
    messages = {letter: (_ns(table[:, 0]), table[:, 1:]) for letter, table in tables.items() if len(table)}
    return messages, "\n".join(answers)


def _binary(line: bytes, count: int) -> Sequence[float]:
    """Time and numbers of a binary message; none where it is not one."""
    body = line.replace(b"\xdb\xdc", b"\n").replace(b"\xdb\xdd", b"\xdb") if 0xDB in line else line
    return struct.unpack_from(f"<Q{count}f", body, 1) if len(body) == 9 + 4 * count else ()


def _ascii(line: bytes, count: int) -> Sequence[float]:
    """Time and numbers of an ASCII message; none where it is not one."""
    cells = line.rstrip(b"\r").split(b",")[1:]
    if len(cells) != 1 + count or not all(re.fullmatch(rb"-?\d{1,19}(\.\d{1,12})?", cell) for cell in cells):
        return ()
    return [float(cell) for cell in cells]


def _ns(us: Floats) -> NDArray[np.int64]:
    if not ((us >= 0.0) & (us < 9.2e15)).all():
        raise DecodeError("a message has a time that no clock has; the log is damaged.")
    return np.asarray(np.round(us).astype(np.int64) * 1000)


def _of_tables(parts: Parts, folder: bool, notes: list[Note]) -> _Messages:
    messages: _Messages = {}
    tables: Mapping[str, str] = TABLES if folder else {"I": parts.names[0]}
    for letter, name in tables.items():
        if name not in parts.names:
            continue
        source = sheet(name, parts.read(name))
        wanted = source.names[: 1 + NUMBERS[letter]]
        expected = (re.escape(STAMP), *_HEADINGS[letter])  # with their units and in their order
        if len(wanted) != len(expected) or not all(map(re.fullmatch, expected, wanted)):
            raise DecodeError(f"{name} has the columns {', '.join(source.names)}, which x-IMU3 does not write.")
        table = source.table(wanted)
        if table is None:
            notes.append(info("source.part_empty", name=name))
            continue
        notes += table.notes
        values = np.stack([table.columns[column] for column in wanted[1:]], axis=1)
        messages[letter] = (_ns(table.columns[STAMP]), values)
    return messages
