"""MTB logs of MT Manager: what Xsens units sent on the Xbus, message by message, as the columns of a text export.

A message is FA, a bus identifier, a message identifier, a length (FF: two more bytes hold it), data, and a byte that
makes the sum of all but FA 0 mod 256 (MT Low Level Communication Protocol MT0101P; ethzasl_xsens_driver, mtdevice.py).
Numbers are big-endian. MTData2 (36) is a list of blocks: an identity of two bytes, a size and data. The lowest digit of
an identity is its precision (0 float32, 1 fixed 12.20, 2 fixed 16.32, 3 float64) and the frame of an attitude (0 ENU,
4 NED, 8 NWU); the rest says what it is (Xsens' xsdataidentifier.h). Fixed 16.32 sends the fraction first, four bytes,
and then the integer, two (xsmessage.c, getDataFP1632; einride/xsens-go, fixedpoint_test.go).

MTData (32) of older units has a layout that follows from OutputMode and OutputSettings in the message Configuration
(0D), which also holds the sampling period in 1/115200 s (xsdeviceconfiguration.c; legacydatapacket.cpp,
updateInfoList). Its matrices run down their columns, as those of MTData2 do, and its frame is NWU, or NED where the
settings say so.
"""

import tomllib
from array import array
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbob.core.check import Floats
from plumbob.core.errors import DecodeError
from plumbob.core.findings import Note, info, warning
from plumbob.core.text import counted, first_words
from plumbob.files.foreign.logged import choose, records

PREAMBLE: Final = 0xFA
_MTDATA, _MTDATA2 = 0x32, 0x36
_DEVICE_ID, _CONFIGURATION, _PRODUCT_CODE, _OUTPUT_CONFIGURATION = 0x01, 0x0D, 0x1D, 0xC1
_MASTER: Final = 0xFF
_LONG: Final = 0xFF
_PART: Final = 1 << 18  # bytes that are searched at a time
_MOST_LAYOUTS: Final = 64  # of a unit's packets: its slower sensors are in some and not in others
_QUATERNION, _MATRIX, _EULER = 0x2010, 0x2020, 0x2030
_UTC: Final = 0x1010
_FRAMES: Final = {0x0: "ENU", 0x4: "NED", 0x8: "NWU"}


class _BlockKind(NamedTuple):
    """What a block is called, its columns in an export, and types that it always has."""

    columns: Sequence[str]
    name: str = "block"
    types: Sequence[str] = ()


_TABLES: Final = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))
_KINDS: Final = {int(identity, 16): _BlockKind(**kind) for identity, kind in _TABLES["blocks"].items()}
_NAMES: Final = {int(identity, 16): name for identity, name in _TABLES["others"].items()} | {
    identity: kind.name for identity, kind in _KINDS.items()
}
_CHOICES: Final = ((0x8020, 0x8040, 0x8030), (0x4020, 0x4040, 0x4010), (_QUATERNION, _MATRIX, _EULER))
_NUMBERS: Final[tuple[Any, ...]] = (">f4", ">i4", [("part", ">u4"), ("whole", ">i2")], ">f8")  # by precision
_Block = tuple[int, int, int]  # identity, place in the data, and size


@dataclass
class XbusUnit:
    """What one unit sent, as MT Manager exports it."""

    head: dict[str, str] = field(default_factory=dict)
    columns: dict[str, Floats] = field(default_factory=dict)
    notes: list[Note] = field(default_factory=list)


@dataclass
class _CheckedMessages:
    """Messages whose checksums fit, by their places in the file."""

    raw: bytes
    data: NDArray[np.uint8]
    begins: NDArray[np.int64]
    sizes: NDArray[np.int64]
    bus: NDArray[np.uint8]
    kind: NDArray[np.uint8]
    configuration: bytes = b""  # data of the message that says how the units are set
    devices: Sequence[bytes] = ()  # and its part of each unit

    def indices(self, kind: int, bus: int | None = None) -> NDArray[np.int64]:
        """Numbers of the messages of a kind, of one bus identifier or of all."""
        return np.flatnonzero((self.kind == kind) & ((self.bus == bus) if bus is not None else True))

    def body(self, number: int) -> bytes:
        """Data of a message."""
        begin = int(self.begins[number])
        return self.raw[begin : begin + int(self.sizes[number])]


@dataclass
class _Group:
    """Packets of one layout: their rows, where their data begin, and their blocks."""

    rows: NDArray[np.int64]
    begins: NDArray[np.int64]
    blocks: list[_Block]


def read_unit(raw: bytes, unit: str | None) -> XbusUnit:
    """One unit of a log: that of an identity, as 037003F8, or a number from 1 in the order of the bus; or the first."""
    notes: list[Note] = [info("source.mtb")]
    messages = _messages(raw, notes)
    messages.configuration, messages.devices = _configuration(messages)
    data = np.isin(messages.kind, (_MTDATA, _MTDATA2)) & (messages.sizes > 0)
    names: dict[str, int] = {}
    for bus in np.unique(messages.bus[data]).tolist():
        label = _name(messages, bus)
        names[f"{label}.bus{bus}" if label in names else label] = bus
    if not names:
        kinds = ", ".join(f"{kind:02X}" for kind in np.unique(messages.kind).tolist()[:20])
        raise DecodeError(
            f"it holds {counted(messages.kind.size, 'message')}, but no data (MTData2, 36, or MTData, 32): {kinds}."
        )
    counts = {key: int(np.count_nonzero(data & (messages.bus == bus))) for key, bus in names.items()}
    name = choose(notes if len(counts) > 1 else [], counts, unit, "unit", "packet")
    content = XbusUnit({} if name == f"bus{names[name]}" else {"deviceid": name}, {}, notes)
    if product := _product(messages, names[name]):
        content.head["productcode"] = product
    groups, rate = _groups(messages, names[name], content)
    _fill(content, messages.data, groups, rate)
    return content


def _messages(raw: bytes, notes: list[Note]) -> _CheckedMessages:
    """Messages one after another; after damage the next is one whose checksum fits and that another follows."""
    data, size = np.frombuffer(raw, np.uint8), len(raw)
    sums, starts, ends, done = np.cumsum(data, dtype=np.uint8), array("q"), array("q"), 0
    for part in range(0, size - 4, _PART):
        at = part + np.flatnonzero(data[part : min(part + _PART, size - 4)] == PREAMBLE)
        length = data[at + 3].astype(np.int64)
        long = at[length == _LONG]
        length[length == _LONG] = 2 + 256 * data[long + 4].astype(np.int64) + data[np.minimum(long + 5, size - 1)]
        end = at + 5 + length
        fits = (end <= size) & (sums[np.minimum(end, size) - 1] == sums[at])
        at, end = at[fits], end[fits]
        chained = (end == size) | (data[np.minimum(end, size - 1)] == PREAMBLE)
        for start, stop, is_followed in zip(at.tolist(), end.tolist(), chained.tolist(), strict=True):
            if start == done or (start > done and is_followed):
                starts.append(start)
                ends.append(stop)
                done = stop
    if not starts:
        raise DecodeError("it holds no message of the Xbus (FA, bus, kind, length, data, checksum); copy it again.")
    begins, sizes = np.frombuffer(starts, np.int64), np.frombuffer(ends, np.int64) - np.frombuffer(starts, np.int64)
    if is_cut := done < size and raw[done] == PREAMBLE:
        notes.append(warning("reading.cut_message_bytes", count=size - done))
    if junk := (done if is_cut else size) - int(sizes.sum()):
        notes.append(warning("reading.damage_checksums", junk=junk))
    head = np.where(data[begins + 3] == _LONG, 6, 4)
    return _CheckedMessages(raw, data, begins + head, sizes - head - 1, data[begins + 1], data[begins + 2])


def _configuration(messages: _CheckedMessages) -> tuple[bytes, list[bytes]]:
    """Data of the message Configuration that the first packets follow, 98 bytes of the master, and 20 of each device.

    Empty where there is none.
    """
    data = np.flatnonzero(np.isin(messages.kind, (_MTDATA, _MTDATA2)))
    configuration, devices = b"", list[bytes]()
    for number in messages.indices(_CONFIGURATION)[:1000].tolist():
        if devices and data.size and number > data[0]:
            break
        body = messages.body(number)
        end = 98 + 20 * _uint(body, 96, 2)
        if 98 < end <= len(body):
            configuration, devices = body, [body[at : at + 20] for at in range(98, end, 20)]
    return configuration, devices


def _uint(data: bytes, at: int, size: int) -> int:
    return int.from_bytes(data[at : at + size], "big")


def _name(messages: _CheckedMessages, bus: int) -> str:
    """Identity of a unit as Xsens writes it; where no message tells it, its bus identifier."""
    if bus == _MASTER and len(messages.devices) > 1:
        return messages.configuration[:4].hex().upper()
    for number in messages.indices(_DEVICE_ID, bus)[:1]:
        if messages.sizes[number] in {4, 8}:
            return messages.body(int(number)).hex().upper().lstrip("0").zfill(8)
    place = 0 if bus == _MASTER else bus - 1
    return messages.devices[place][:4].hex().upper() if 0 <= place < len(messages.devices) else f"bus{bus}"


def _product(messages: _CheckedMessages, bus: int) -> str:
    """Product code of a unit; that in the configuration is the master's, which a unit alone is itself."""
    said = [messages.body(int(number)) for number in messages.indices(_PRODUCT_CODE, bus)[:1]]
    if not said and len(messages.devices) == 1:
        said = [messages.configuration[32:52]]
    text = b"".join(said).split(b"\0")[0].decode("ascii", "replace").strip()
    return text if text.isprintable() and len(text) <= 40 else ""


def _groups(messages: _CheckedMessages, bus: int, unit: XbusUnit) -> tuple[list[_Group], float | None]:
    """Packets of a unit by their layouts, and its packets per second, where a message tells them."""
    numbers = np.flatnonzero(np.isin(messages.kind, (_MTDATA, _MTDATA2)) & (messages.bus == bus) & (messages.sizes > 0))
    modern = messages.kind[numbers] == _MTDATA2
    if modern.any():
        if lost := int(np.count_nonzero(~modern)):
            unit.notes.append(info("source.mtdata_left_out", lost=lost))
        rates = [0]  # packets per second: the largest that the output configuration asks for, Hz
        for number in messages.indices(_OUTPUT_CONFIGURATION, bus)[-1:]:
            body = messages.body(int(number))
            rates += [rate for at in range(2, len(body) - 1, 4) if (rate := _uint(body, at, 2)) not in (0, 0xFFFF)]
        return _modern(messages, numbers[modern], unit.notes), float(max(rates)) or None
    return _legacy(messages, numbers, unit)


def _modern(messages: _CheckedMessages, numbers: NDArray[np.int64], notes: list[Note]) -> list[_Group]:
    """Packets of MTData2, told apart by their sizes and the heads of their blocks."""
    data, begins, sizes = messages.data, messages.begins[numbers], messages.sizes[numbers]
    at, heads, walked = begins.copy(), sizes.copy(), np.arange(numbers.size)
    while (walked := walked[at[walked] + 3 <= (begins + sizes)[walked]]).size:
        head = data[at[walked, None] + np.arange(3)] @ np.array([1 << 16, 1 << 8, 1])
        heads[walked] = heads[walked] * 1_000_003 + head
        at[walked] += 3 + (head & 0xFF)
    rows = np.flatnonzero(at == begins + sizes)  # of packets that their blocks fill
    rows = rows[np.argsort(heads[rows], kind="stable")]
    layouts = np.split(rows, np.flatnonzero(np.diff(heads[rows])) + 1) if rows.size else []
    layouts = sorted(layouts, key=len, reverse=True)[:_MOST_LAYOUTS]
    if lost := numbers.size - sum(map(len, layouts)):
        notes.append(warning("reading.damage_blocks", lost=lost))
    return [_Group(of, begins[of], _blocks(messages.body(int(numbers[of[0]])))) for of in layouts]


def _blocks(data: bytes) -> list[_Block]:
    """Blocks that fill a packet of MTData2."""
    blocks, at = list[_Block](), 0
    while at < len(data):
        blocks.append((_uint(data, at, 2), at + 3, data[at + 2]))
        at += 3 + data[at + 2]
    return blocks


def _legacy(
    messages: _CheckedMessages, numbers: NDArray[np.int64], unit: XbusUnit
) -> tuple[list[_Group], float | None]:
    """Packets of MTData by the configuration of their unit."""
    configuration, devices = messages.configuration, messages.devices
    if len(devices) != 1:
        what = f"lists {len(devices)} units, whose packets it packs in one" if devices else "is not in the log"
        raise DecodeError(
            "its packets are of the older kind (MTData), whose layout the message Configuration gives, but that "
            f"{what}. Export it as text with MT Manager (File, Export)."
        )
    mode, settings = _uint(devices[0], 6, 2), _uint(devices[0], 8, 4)
    blocks, total = _legacy_blocks(mode, settings)
    sizes = messages.sizes[numbers]
    fits = sizes == total
    if not fits.any():
        raise DecodeError(
            f"its packets are of the older kind (MTData) and have {int(sizes[0])} bytes, but OutputMode {mode:04X} and "
            f"OutputSettings {settings:08X} make {total}. Export it as text with MT Manager (File, Export)."
        )
    if lost := int(np.count_nonzero(~fits)):
        unit.notes.append(warning("reading.damage_sizes", lost=lost, total=total))
    unit.notes.append(info("source.mtdata", mode=mode, settings=settings))
    period, skipped = _uint(configuration, 4, 2), _uint(configuration, 6, 2)
    rate = 115_200.0 / period / (skipped + 1) if period and skipped != 0xFFFF else None
    return [_Group(np.flatnonzero(fits), messages.begins[numbers[fits]], blocks)], rate


def _legacy_blocks(mode: int, settings: int) -> tuple[list[_Block], int]:
    """Blocks that a mode and its settings put one after another, under the identities of MTData2, and their bytes."""
    precision, blocks, at = settings >> 8 & 3, list[_Block](), 0
    word = np.dtype(_NUMBERS[precision]).itemsize
    for mask, value, identity, size, numbers in _TABLES["legacy"]:
        if (mode << 32 | settings) & mask == value:
            blocks.append((identity | precision if numbers else identity, at, size + numbers * word))
            at += size + numbers * word
    return blocks, at


def _fill(unit: XbusUnit, data: NDArray[np.uint8], groups: list[_Group], rate: float | None) -> None:
    """Columns of the blocks that are taken, a row for each packet; what is not taken is a note."""
    held = Counter[int]()
    for group in groups:
        held.update(dict.fromkeys((kind for kind, _, _ in group.blocks), group.rows.size))
    frame = _frame(held)
    usable = {identity for identity in held if identity & ~0xF not in _CHOICES[2] or identity & 0xC == frame}
    taken = {identity & ~0xF for identity in usable} & _KINDS.keys()
    for choices in _CHOICES:  # the first of those that say the same
        taken -= {*[choice for choice in choices if choice in taken][1:]}
    rows = np.sort(np.concatenate([np.empty(0, np.int64), *(group.rows for group in groups)]))
    wrong: set[int] = set()
    for group in groups:
        places = np.searchsorted(rows, group.rows)
        once: set[int] = set()
        for identity, at, size in group.blocks:
            what = identity & ~0xF
            if what not in taken or what in once or identity not in usable:
                continue
            values = _values(data, group.begins + at, identity, size)
            if values is None:
                wrong.add(identity)
                continue
            once.add(what)
            for column, part in zip(_KINDS[what].columns, values.T, strict=True):
                unit.columns.setdefault(column, np.full(rows.size, np.nan))[places] = part
    if wrong:
        unit.notes.append(warning("reading.damage_block_size", blocks=_listed(wrong)))
    if unused := {identity for identity in held if identity & ~0xF not in taken}:
        unit.notes.append(info("source.left_out", names=_listed(unused)))
    if not {"Gyr_X", "OriInc_q0", "Acc_X", "VelInc_X", "Mag_X"} & unit.columns.keys():
        packed = {identity & ~0xF for identity in held} & {0xC810, 0xC820}
        snapshots = "; only Xsens' software takes snapshots apart" if packed else ""
        raise DecodeError(
            f"unit {unit.head.get('deviceid', '1')} has no rate, acceleration or magnetic field; it has "
            f"{_listed(held)}{snapshots}. Export the log as text with MT Manager (File, Export)."
        )
    if frame is not None:
        unit.head["coordinate system"] = _FRAMES.get(frame, "unknown")
    _timed(unit, rate)


def _frame(held: Mapping[int, int]) -> int | None:
    """Digit of the frame in which most attitudes of the best kind are."""
    for what in _CHOICES[2]:
        if counts := {identity & 0xC: count for identity, count in sorted(held.items()) if identity & ~0xF == what}:
            return max(counts, key=lambda digit: counts[digit])
    return None


def _values(data: NDArray[np.uint8], places: NDArray[np.int64], identity: int, size: int) -> Floats | None:
    """Numbers (N, k) of a block; None where its size is not that of its kind."""
    kind, precision = _KINDS[identity & ~0xF], identity & 3
    types = kind.types or [_NUMBERS[precision]] * len(kind.columns)
    layout = np.dtype([*zip(kind.columns, types, strict=True)])
    if size != layout.itemsize:
        return None
    fields = records(data, places, layout)
    columns = [fields[name] for name in kind.columns]
    if not kind.types and precision == 2:
        columns = [column["whole"] + column["part"] * 2.0**-32 for column in columns]
    values = np.column_stack(columns).astype(np.float64) * (2.0**-20 if not kind.types and precision == 1 else 1.0)
    if identity & ~0xF == _UTC:
        values[(fields["UTC_Valid"] & 0x04) == 0] = np.nan
    return values


def _timed(unit: XbusUnit, rate: float | None) -> None:
    """Leave out packets without the time that the others have; without any time, the rate is that of the settings."""
    columns = unit.columns
    if "SampleTimeFine" in columns:
        timed = np.isfinite(columns["SampleTimeFine"])
        if lost := int(np.count_nonzero(~timed)):
            unit.columns = {name: values[timed] for name, values in columns.items()}
            unit.notes.append(warning("reading.packets_without_time", lost=lost))
    elif rate is not None and "PacketCounter" in columns:
        unit.head["update rate"] = f"{rate:.6f}Hz"
    else:
        raise DecodeError(
            f"unit {unit.head.get('deviceid', '1')} sent neither SampleTimeFine nor PacketCounter with a rate that "
            "the log says, so that its time is not known. Record it with SampleTimeFine among the outputs."
        )
    counter = unit.columns.get("PacketCounter")
    if counter is not None and "SampleTimeFine" in columns and not np.isfinite(counter).all():
        del unit.columns["PacketCounter"]
        unit.notes.append(info("source.no_packet_counter"))


def _listed(identities: Iterable[int]) -> str:
    kinds = sorted({identity & ~0xF for identity in identities})
    return first_words([f"{_NAMES.get(kind, 'block')} ({kind:04X})" for kind in kinds], 20)
