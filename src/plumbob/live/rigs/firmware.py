"""The drifting buoy's own program between its sensors and its outputs, emulated [Yu2018].

A timer of 1 ms sets flags every 3, 10 and 50 ms. The main loop polls them: it reads both chips, fuses what it has read
with the PI filter of `plumbob.filters.mahony`, and sends one frame and stores it. Otherwise the processor sleeps.

The paper gives the periods and the rates, and no duration: those of `Processor` are figures of data sheets, and
assumptions where it says so. Not emulated: single precision (the filter runs in double), and the time of interrupts.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from plumbob.core import check, flags
from plumbob.core.check import Floats
from plumbob.core.errors import DecodeError, ParameterError, ShapeError
from plumbob.core.text import FactsText
from plumbob.core.time import to_s
from plumbob.data import TRIADS, AttitudeTrack, ImuData
from plumbob.data.calibrated import apply_card
from plumbob.data.cards import CalibrationCard
from plumbob.filters import Filter
from plumbob.protocols.decode import decode
from plumbob.protocols.encode import encode
from plumbob.protocols.format_toml import find_format
from plumbob.protocols.ring import BLANK
from plumbob.rotations import Frame, North, euler_zyx_from_quat, quat_from_euler_zyx

Bytes = NDArray[np.uint8]

RECORD: Final = 32  # bytes of a record
PAGE: Final = 256  # bytes that the chip programs at once, as Winbond's W25Q80
SECTOR: Final = 4096  # bytes that it erases at once


class FlashLog(FactsText):
    """Ring of records in a NOR Flash chip of so many bytes, emulated to the byte.

    Records are gathered in memory until they fill a page, which is then programmed. With the last page of a sector the
    next sector is erased, so that a blank page is always ready and no call waits for an erasure; of a full ring that
    costs its oldest sector. No record lies across two pages: where one is torn, the others are sound. `erases` counts
    the wear of each sector; `lost` are `written` records that were erased again.
    """

    per_page: Final = PAGE // RECORD
    pages: Final = SECTOR // PAGE  # of a sector

    def __init__(self, *, size: int = 1 << 20) -> None:
        if size % SECTOR or size < 2 * SECTOR:
            raise ParameterError(f"a log needs two sectors or more of {SECTOR} bytes, but it has {size} bytes.")
        self._cells: Bytes = np.full((size // PAGE, PAGE), BLANK, dtype=np.uint8)
        self._buffer = bytearray()
        self._next = 0
        self._held = np.zeros(size // SECTOR, dtype=np.int64)
        self.erases: NDArray[np.int64] = np.zeros(size // SECTOR, dtype=np.int64)
        self.written = self.lost = 0

    @property
    def image(self) -> bytes:
        """What the chip holds."""
        return self._cells.tobytes()

    @property
    def capacity(self) -> int:
        """Records that its pages hold; of a full ring, up to a sector of them is blank."""
        return len(self._cells) * self.per_page

    @property
    def waiting(self) -> int:
        """Records in memory that do not fill a page yet, and that a loss of power would take."""
        return len(self._buffer) // RECORD

    def write(self, records: bytes | Bytes) -> None:
        """Take records: bytes one behind the other, or rows (N, record)."""
        data = records if isinstance(records, bytes) else np.asarray(records, dtype=np.uint8).tobytes()
        if len(data) % RECORD:
            raise ShapeError(f"a log takes records of {RECORD} bytes, but {len(data)} bytes are not a multiple.")
        self._buffer += data
        waiting = np.frombuffer(bytes(self._buffer), dtype=np.uint8)
        rows = waiting[: waiting.size // PAGE * PAGE].reshape(-1, PAGE)
        while len(rows):
            count = min(len(rows), self.pages - self._next % self.pages)
            self._cells[self._next : self._next + count] = rows[:count]
            self._advance(count, count * self.per_page)
            rows = rows[count:]
        self._buffer = self._buffer[len(self._buffer) // PAGE * PAGE :]

    def _advance(self, pages: int, records: int) -> None:
        """Go on by pages of one sector; with its last, erase the next."""
        self._held[self._next // self.pages] += records
        self.written += records
        self._next = (self._next + pages) % len(self._cells)
        if self._next % self.pages == 0:
            sector = self._next // self.pages
            self._cells[self._next : self._next + self.pages] = BLANK
            self.lost += int(self._held[sector])
            self._held[sector] = 0
            self.erases[sector] += 1

    def facts(self) -> dict[str, str]:
        """Records and wear."""
        return {
            "records": f"{self.written} written, {self.lost} overwritten, {self.waiting} in memory",
            "erasures of a sector": f"{self.erases.min()} to {self.erases.max()}",
        }


Ints = NDArray[np.int64]

TICK_NS: Final = 1_000_000
"""Period of the timer, ns [Yu2018]."""


@dataclass(frozen=True, slots=True)
class FirmwareTask:
    """What the loop does when it finds a flag."""

    name: str  # for the counts
    every: int  # ticks from one event to the next; the first comes after as many
    # how long it takes, ns: for the first call, the second and so on, and then from the beginning again
    takes_ns: tuple[int, ...]


@dataclass(frozen=True, eq=False, slots=True)
class Calls:
    """Calls of one task."""

    due_ns: Ints  # (N,), when the flag of each was set, ns from the start
    # begun_ns, done_ns: (N,), when it began and ended
    begun_ns: Ints
    done_ns: Ints
    missed_ns: Ints  # (M,), when the timer found the flag still set: an event that is served no more

    def __len__(self) -> int:
        return int(self.due_ns.size)

    @property
    def late_ns(self) -> Ints:
        """How much later than its event each call began, ns (N,)."""
        return self.begun_ns - self.due_ns


def poll(tasks: Sequence[FirmwareTask], end_ns: int) -> dict[str, Calls]:
    """Let the loop run: it looks at the flags in the order of the tasks, serves the first that is set, and looks again.

    Nothing interrupts a task but the timer, which only sets flags and takes no time. A flag is cleared when its task
    begins; none begins at or after `end_ns`.
    """
    periods = [task.every * TICK_NS for task in tasks]
    following = periods.copy()
    due: list[int | None] = [None] * len(tasks)
    calls: list[list[tuple[int, int, int]]] = [[] for _ in tasks]
    missed: list[list[int]] = [[] for _ in tasks]
    now = 0
    while now < end_ns:
        for i, period in enumerate(periods):
            while following[i] <= now:
                if due[i] is None:
                    due[i] = following[i]
                else:
                    missed[i].append(following[i])
                following[i] += period
        which = next((i for i, flag in enumerate(due) if flag is not None), None)
        if which is None:
            now = min(following)
            continue
        flag, due[which] = due[which], None
        assert flag is not None
        done = now + tasks[which].takes_ns[len(calls[which]) % len(tasks[which].takes_ns)]
        calls[which].append((flag, now, done))
        now = done
    made = (np.array(served, dtype=np.int64).reshape(-1, 3) for served in calls)
    return {
        task.name: Calls(table[:, 0], table[:, 1], table[:, 2], np.array(late, dtype=np.int64))
        for task, table, late in zip(tasks, made, missed, strict=True)
    }


FORMAT: Final = "buoy_attitude"
_SAMPLE, _FUSE, _SEND = "sample", "fuse", "send"


@dataclass(frozen=True, slots=True, kw_only=True)
class Processor:
    """How long the tasks take."""

    # Of the MSP430F5342, Hz: the most that its data sheet allows. The paper says no more than "high".
    clock_hz: float = 25e6
    spi_hz: float = 1e6  # of the sensors' bus, Hz: the most that the MPU-6000 takes for all its registers (data sheet)
    # a command and 14 bytes of the MPU-6000, a command and 7 of the HMC5983: six of data, and its status
    spi_bytes: int = 23
    # assumed: 200 cycles for each of some 200 multiplications and additions in software, 5000 for square roots and
    # quotients
    fuse_cycles: int = 45_000
    send_cycles: int = 15_000  # assumed: three arcs, a frame and its check
    baud: int = 115_200  # of the line, bits/s; a byte takes ten
    flash_hz: float = 8e6  # Of the bus of the Flash chip, Hz; assumed. A page goes out behind a command of 4 bytes.
    # page_s, erase_s: how long the chip programs a page and erases a sector, s: typical of a serial NOR Flash
    page_s: float = 0.7e-3
    erase_s: float = 45e-3
    uart_waits: bool = False  # Whether the loop waits until a frame is out. By default bytes leave by interrupt.
    # Whether the loop waits until the chip is ready. By default the chip works meanwhile; the next page follows eight
    # frames later.
    flash_waits: bool = False

    def tasks(self, log: FlashLog) -> tuple[FirmwareTask, ...]:
        """Tasks in the order in which the loop looks at their flags, the most frequent first."""
        send = self.send_cycles / self.clock_hz + self.uart_waits * 10 * RECORD / self.baud
        page = 8 * (4 + PAGE) / self.flash_hz + self.flash_waits * self.page_s
        sends = np.full(log.pages * log.per_page, send)
        sends[log.per_page - 1 :: log.per_page] += page
        sends[-1] += self.flash_waits * self.erase_s
        return (
            FirmwareTask(_SAMPLE, 3, _ns(8 * self.spi_bytes / self.spi_hz)),
            FirmwareTask(_FUSE, 10, _ns(self.fuse_cycles / self.clock_hz)),
            FirmwareTask(_SEND, 50, _ns(*sends)),
        )


def _ns(*seconds: float) -> tuple[int, ...]:
    return tuple(round(1e9 * second) for second in seconds)


@dataclass(frozen=True, eq=False, repr=False)
class Firmware(FactsText):
    """What the program did."""

    rows: NDArray[np.uint8]  # (N, 32), frames that went out, of format ``buoy_attitude``
    columns: Mapping[str, NDArray[Any]]  # (N,), what they say, by field
    sent_ns: Ints  # (N,), when each was handed to the line, ns from the start
    # what a reader decodes of them: 20 Hz, magnetic North; times are those of the newest sample in each
    track: AttitudeTrack
    calls: Mapping[str, Calls]  # of the tasks ``sample``, ``fuse`` and ``send``
    idle: float  # share of the time in which the processor sleeps
    samples: ImuData  # what was read, at the instants of reading, without calibration
    fused: ImuData  # what the filter was given, calibrated
    flash: FlashLog  # the log

    @property
    def frames(self) -> bytes:
        """Bytes that went out."""
        return self.rows.tobytes()

    @property
    def served(self) -> dict[str, int]:
        """Events that were served, by task."""
        return {name: len(call) for name, call in self.calls.items()}

    @property
    def missed(self) -> dict[str, int]:
        """Events whose flag was set again before they were served, by task."""
        return {name: int(call.missed_ns.size) for name, call in self.calls.items()}

    @property
    def latest(self) -> dict[str, float]:
        """How late the latest call of each task began, s."""
        return {name: float(call.late_ns.max(initial=0)) * 1e-9 for name, call in self.calls.items()}

    def facts(self) -> dict[str, str]:
        """Events, idle time and log."""
        tasks = {name: f"{self.served[name]} served, {self.missed[name]} missed" for name in self.calls}
        return {**tasks, "idle": f"{100.0 * self.idle:.1f} %", **self.flash.facts()}


def run_firmware(
    imu: ImuData, *, calibration: CalibrationCard | None = None, processor: Processor | None = None,
    params: Mapping[str, Any] | None = None, log: FlashLog | None = None,
) -> Firmware:  # fmt: skip
    """Run the program over what the chips have in their registers, in body axes of NED; a read gets the newest value.

    Best at 1 kHz, the most that the MPU-6000 gives. A fusion gets the mean of the three or four samples since the last
    one; the paper does not say. Parameters of the filter are the paper's by default.
    """
    log = FlashLog() if log is None else log
    end_ns = int(imu.t_ns[-1])
    calls = poll((processor or Processor()).tasks(log), end_ns)
    if not all(map(len, calls.values())):
        raise ParameterError(f"the recording of {imu.t[-1]:g} s ends, or the processor is too slow, before a frame.")
    samples = _samples(imu, calls[_SAMPLE].begun_ns)
    fused, at = _fused(samples, calls)
    fused = apply_card(calibration, fused) if calibration else fused
    track = Filter("mahony", frame=Frame.NED, params=params).process(fused, look=False)
    columns, sent_ns = _columns(track, fused, at, calls, log)
    rows = encode(find_format(FORMAT), columns)
    log.write(rows)
    busy = sum(int((np.minimum(call.done_ns, end_ns) - call.begun_ns).sum()) for call in calls.values())
    return Firmware(rows, columns, sent_ns, decoded(rows.tobytes()), calls, 1.0 - busy / end_ns, samples, fused, log)


def decoded(data: bytes) -> AttitudeTrack:
    """Attitude that frames of format ``buoy_attitude`` say, by their own clock, from the first sample of the buoy."""
    frames = decode(data, find_format(FORMAT)).frames
    if FORMAT not in frames:
        raise DecodeError(f"there is no frame of {FORMAT} in {len(data)} bytes.")
    said = frames[FORMAT].columns
    clock = said["clock"].astype(np.int64)
    clock = clock[0] + np.cumsum(np.diff(clock, prepend=clock[0]) % (1 << 32))
    angles = np.stack([said[name] for name in ("heading", "pitch", "roll")], axis=1)
    return AttitudeTrack(
        t=to_s(1000 * clock),
        q_nb=quat_from_euler_zyx(angles),
        frame=Frame.NED,
        north=North.MAGNETIC,
        source=f"frames of {FORMAT}",
    )


def _samples(imu: ImuData, read_ns: Ints) -> ImuData:
    """What the reads got: of each triad the newest value, NaN where it was read before."""
    row = np.searchsorted(imu.t_ns, read_ns, side="right") - 1
    row = np.maximum(row, 0)
    rows = {name: _renewed(values, row) for name in TRIADS if (values := getattr(imu, name)) is not None}
    return ImuData(
        t=to_s(read_ns), **rows, flags=imu.flags[row] & ~np.uint32(flags.GAP),
        temp_c=None if imu.temp_c is None else imu.temp_c[row],
        meta=replace(imu.meta, declination=None, rate_nominal=None),  # the processor knows of no declination
    )  # fmt: skip


def _renewed(values: Floats, row: Ints) -> Floats:
    last = check.last_marked(np.asarray(~np.isnan(values).any(axis=1)))[row]
    new = np.diff(last, prepend=-1) > 0
    return np.where(new[:, np.newaxis], values[last], np.nan)


def _fused(samples: ImuData, calls: Mapping[str, Calls]) -> tuple[ImuData, Ints]:
    """What each fusion gets of the samples since the last one, at the time of the newest, and when it began, ns.

    A fusion without a new sample is none. With the mean of evenly spaced rates and their own time, no turn is lost.
    """
    begun = calls[_FUSE].begun_ns
    stop = np.searchsorted(calls[_SAMPLE].begun_ns, begun, side="right")
    start = np.concatenate(([0], stop[:-1]))
    some = stop > start
    start, stop = start[some], stop[some]
    triads = {name: _means(getattr(samples, name), start, stop) for name in samples.triads}
    fused = ImuData(
        t=samples.t[stop - 1],
        **triads,
        flags=np.bitwise_or.reduceat(samples.flags[: stop[-1]], start),
        temp_c=None if samples.temp_c is None else samples.temp_c[stop - 1],
        meta=samples.meta,
    )
    return fused, begun[some]


def _means(values: Floats, start: Ints, stop: Ints) -> Floats:
    """Means of the values (N, 3) in each range; NaN where there is none."""
    there = np.asarray(~np.isnan(values).any(axis=1))
    sums = np.add.reduceat(np.where(there[:, np.newaxis], values, 0.0)[: stop[-1]], start)
    counts = np.add.reduceat(there[: stop[-1]].astype(np.int64), start)[:, np.newaxis]
    return np.divide(sums, counts, out=np.full_like(sums, np.nan), where=counts > 0)


def _columns(
    track: AttitudeTrack, fused: ImuData, at: Ints, calls: Mapping[str, Calls], log: FlashLog
) -> tuple[dict[str, NDArray[Any]], Ints]:
    """Columns of the frames, and when each was handed on; a send without a new fusion sends nothing."""
    send = calls[_SEND]
    stop = np.searchsorted(at, send.begun_ns, side="right")
    start = np.concatenate(([0], stop[:-1]))
    some = stop > start
    start, stop = start[some], stop[some]
    begun = send.begun_ns[some]
    newest = stop - 1
    yaw, pitch, roll = euler_zyx_from_quat(track.q_nb[newest]).T
    assert track.flags is not None
    masks = [((track.flags & bit) != 0)[: stop[-1]] for bit in (flags.ACC_GATED, flags.MAG_ABSENT)]
    gated, blind = (np.logical_and.reduceat(mask, start) for mask in masks)
    missed = np.searchsorted(np.sort(np.concatenate([call.missed_ns for call in calls.values()])), begun)
    numbers = log.written + log.waiting + np.arange(begun.size)
    triads = {name: _means(getattr(fused, name), start, stop) for name in ("gyr", "acc")}
    columns = {
        "counter": numbers, "clock": np.rint(1e6 * track.t[newest]).astype(np.int64),
        "roll": roll, "pitch": pitch, "heading": yaw,
        **{f"{name}.{axis}": values[:, i] for name, values in triads.items() for i, axis in enumerate("xyz")},
        "calibrated": np.full(begun.size, fused.meta.calibration is not None),
        "acc_gated": gated, "mag_absent": blind, "log_full": numbers >= log.capacity,
        "deadline_missed": np.diff(missed, prepend=0) > 0, "missed": missed % 256,
    }  # fmt: skip
    return columns, send.done_ns[some]
