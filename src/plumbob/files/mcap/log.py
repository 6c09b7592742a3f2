"""Read a recording: every row that is whole, in the order of the files, and a list of what is not."""

from bisect import bisect_right
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from operator import itemgetter
from os import PathLike
from pathlib import Path
from typing import Final, NamedTuple

from plumbob.core.errors import DecodeError
from plumbob.files.mcap import layout
from plumbob.files.mcap.layout import Channel
from plumbob.files.mcap.scan import Damage, FileBytes, Identity, RowBlock, Scan, identify


class SequenceGaps:
    """Sequence numbers of one channel; `base` is the first that can come, None where nobody knows."""

    def __init__(self, base: int | None) -> None:
        self.next = base  # one more than the largest number that has come
        self.missing = 0  # how many numbers are missing
        self._holes: list[tuple[int, int]] = []  # in order

    def place(self, on_disk: int) -> int:
        """Number that 32 bits on disk mean: the one that is nearest to the number expected."""
        if self.next is None:
            return on_disk
        half = layout.SEQUENCES // 2
        return self.next + (on_disk - self.next + half) % layout.SEQUENCES - half

    def is_new(self, low: int, count: int) -> bool:
        """Whether none of the `count` numbers from `low` on has come before."""
        if self.next is None or low >= self.next:
            return True
        i = self._hole_before(low)
        return i >= 0 and low + count <= self._holes[i][1]

    def take(self, low: int, count: int) -> None:
        """Take in numbers that are new."""
        if self.next is None or low >= self.next:
            self.reach(low)
            self.next = low + count
            return
        i = self._hole_before(low)
        a, b = self._holes[i]
        self.missing -= count
        self._holes[i : i + 1] = [hole for hole in ((a, low), (low + count, b)) if hole[0] < hole[1]]

    def reach(self, end: int) -> None:
        """All numbers before `end` should have come."""
        if self.next is not None and end > self.next:
            self._holes.append((self.next, end))
            self.missing += end - self.next
        if self.next is None or end > self.next:
            self.next = end

    def _hole_before(self, low: int) -> int:
        """Place of the last hole that begins at `low` or before."""
        return bisect_right(self._holes, low, key=itemgetter(0)) - 1


UNKNOWN_NS: Final = 10_000_000_000  # distance of two starts of which no clock tells it, ns


class LogMessage(NamedTuple):
    """A row of a recording."""

    channel: Channel  # its channel
    sequence: int  # which row of its channel, from 0
    t_ns: int  # host's monotonic clock, ns
    data: bytes  # the message

    @property
    def topic(self) -> str:
        """Topic of its channel."""
        return self.channel.topic


@dataclass(slots=True)
class _Run:
    """What a recorder wrote from one start to its end."""

    recording: str  # its name
    # which start of the host it was, whose monotonic clock counts from it; empty where that is not known
    boot: str = ""
    base: dict[str, int] = field(default_factory=dict)  # rows per topic that the starts before it wrote
    damages: int = 0  # how many damages belong to them
    shift_ns: int | None = None  # what is added to its times; None where the wall clock has to tell
    begun: bool = False  # whether a row of it has come


class Log:
    """A recording as `open_log` gives it, over restarts of its recorder; each iteration reads all, chunk by chunk."""

    def __init__(self, parts: Sequence[Identity]) -> None:
        self._parts = tuple(parts)
        self.paths = tuple(part.path for part in self._parts)  # the files
        # name of the recording; empty where it cannot be determined any more
        self.recording = next((part.recording for part in self._parts if part.recording), "")
        # how often a recorder was started to write it
        self.starts = max(1, len({part.recording for part in self._parts if part.recording}))
        self.first_info = self._parts[0].info  # what the first part says about itself
        # what the recording's owner said of the whole
        self.metadata: Mapping[str, str] = next((part.info.metadata for part in parts if part.info is not None), {})
        self._start()

    def again(self) -> "Log":
        """The same recording, to be read beside this one."""
        return Log(self._parts)

    @property
    def lost(self) -> dict[str, int]:
        """Rows per topic that are missing, as sequence numbers tell, besides those that the recorder dropped."""
        return dict(Counter(self.missing) - self.dropped)

    @property
    def missing(self) -> dict[str, int]:
        """Rows per topic that are missing for whatever reason."""
        return {topic: sequence.missing for topic, sequence in self._sequences.items() if sequence.missing}

    @property
    def ends(self) -> dict[str, int]:
        """Per topic, one more than the last sequence number that is known of."""
        return {topic: sequence.next for topic, sequence in self._sequences.items() if sequence.next is not None}

    def __iter__(self) -> Iterator[LogMessage]:
        for block in self.blocks():
            yield from block

    def blocks(self) -> Iterator[list[LogMessage]]:
        """Rows of one chunk after the other."""
        self._start()
        for part in self._parts:
            self._begin_part(part)
            with FileBytes(part.path) as source:
                scan = Scan(source, self._run.recording or self.recording)
                for item in scan.items():
                    if isinstance(item, Damage):
                        self.damage.append(item)
                        continue
                    if rows := self._chunk_rows(part.path, item):
                        yield rows
            self._end_part(part, scan)

    def _start(self) -> None:
        self.damage: list[Damage] = []  # what is wrong with the files, as far as they have been read
        self.dropped: Counter[str] = Counter()  # rows per topic that the recorder gave up itself, and said so
        self.clean = True  # whether every part has its end, known once all has been read; a crash leaves none
        self._sequences: dict[str, SequenceGaps] = {}
        self._last_part: int | None = None
        self._run = _Run(self.recording)
        self._channels: dict[str, Channel] = {}
        self._origin_ns: int | None = None
        self._latest_ns: int | None = None

    @property
    def shift_ns(self) -> int:
        """What was added to the latest times, ns: after a restart of the host they go on by the wall clock."""
        return self._run.shift_ns or 0

    # --- parts --------------------------------------------------------------------------------------------------

    def _begin_part(self, part: Identity) -> None:
        goes_on = not part.recording or part.recording == self._run.recording
        if part.info is not None and self._last_part is not None and part.info.part > self._last_part + 1:
            absent = f"parts {self._last_part + 1} to {part.info.part - 1} of the recording are not here, or are empty"
            self.damage.append(Damage(part.path, 0, 0, absent, certain=goes_on))
        if not goes_on:
            same_boot = part.info is not None and part.info.boot == self._run.boot != ""
            shift_ns = self._run.shift_ns if same_boot else None
            self._run = _Run(part.recording or "", "", dict(self.ends), len(self.damage), shift_ns)
        if part.info is not None:
            self._last_part, self._run.boot = part.info.part, part.info.boot
            self._settle(part.info.starts)

    def _end_part(self, part: Identity, scan: Scan) -> None:
        self.clean &= scan.clean
        info = scan.info or part.info
        if info is not None and info.ends is None and scan.clean:  # its last word is damaged, its summary is not
            self._settle({topic: info.starts.get(topic, 0) + count for topic, count in scan.counts.items()})
        if info is None or info.ends is None:
            return
        self.dropped.update(info.dropped)
        self._settle(info.ends)

    def _settle(self, reached: Mapping[str, int]) -> None:
        """All rows before these numbers should have come: what is missing belongs to the damages so far."""
        before, since = self.missing, self._run.damages
        for topic, end in reached.items():
            self._sequence(topic).reach(self._run.base.get(topic, 0) + end)
        self._attribute(before)
        self.damage[since:] = [replace(damage, certain=True) for damage in self.damage[since:]]

    # --- rows ---------------------------------------------------------------------------------------------------

    def _chunk_rows(self, path: Path, block: RowBlock) -> list[LogMessage]:
        """Rows of a chunk, unless they have come before."""
        lows: dict[int, int] = {}
        for number, sequence, _, _ in block.rows:
            lows.setdefault(number, sequence)
        counts = {number: len(flat) // 2 for number, flat in block.entries.items()}
        offset = self._time_offset(block)
        channels = {number: self._joined(block.channels[number]) for number in lows}
        sequences = {number: self._sequence(channels[number].topic) for number in lows}
        base = {number: self._run.base.get(channel.topic, 0) for number, channel in channels.items()}
        places = {number: sequences[number].place(base[number] + low) for number, low in lows.items()}
        if not all(sequences[number].is_new(places[number], count) for number, count in counts.items()):
            self.damage.append(Damage(path, block.offset, 0, "a chunk is repeated here; its rows are left out"))
            return []
        if any(places[number] < (sequence.next or 0) for number, sequence in sequences.items()):
            self.damage.append(Damage(path, block.offset, 0, "a chunk is out of order; its rows are whole"))
        before = self.missing
        for number, count in counts.items():
            sequences[number].take(places[number], count)
        self._attribute(before)
        messages = [
            LogMessage(
                channels[number], places[number] + (sequence - lows[number]) % layout.SEQUENCES, log_time - offset, data
            )
            for number, sequence, log_time, data in block.rows
        ]
        self._latest_ns = max(row.t_ns for row in messages)
        return messages

    def _time_offset(self, block: RowBlock) -> int:
        """What is taken from the times of a block, ns; by a clock set back, a start comes `UNKNOWN_NS` later."""
        number, _, log_time, _ = block.rows[0]
        offset, run = block.channels[number].epoch_offset_ns, self._run
        if self._origin_ns is None:
            self._origin_ns = offset
        if not run.begun:
            run.begun = True
            run.shift_ns = offset - self._origin_ns if run.shift_ns is None else run.shift_ns
            first_ns = log_time - offset + run.shift_ns
            if self._latest_ns is not None and first_ns <= self._latest_ns:
                run.shift_ns += self._latest_ns + UNKNOWN_NS - first_ns
        return offset - self.shift_ns

    def _joined(self, channel: Channel) -> Channel:
        """Channel as the first start wrote it."""
        if self._run.recording == self.recording or self._origin_ns is None:
            return channel
        first = self._channels.get(channel.topic)
        if first is None:
            first = replace(channel, recording=self.recording, epoch_offset_ns=self._origin_ns)
            self._channels[channel.topic] = first
        return first

    def _sequence(self, topic: str) -> SequenceGaps:
        sequence = self._sequences.get(topic)
        if sequence is None:
            first = self.first_info
            sequence = self._sequences[topic] = SequenceGaps(None if first is None else first.starts.get(topic, 0))
        return sequence

    def _attribute(self, before: Mapping[str, int]) -> None:
        """Rows that are newly known to be missing belong to the last damage that may have held rows."""
        new = Counter(self.missing) - Counter(before)
        may_have_held = (i for i in reversed(range(self._run.damages, len(self.damage))) if not self.damage[i].certain)
        if new and (place := next(may_have_held, None)) is not None:
            damage = self.damage[place]
            self.damage[place] = replace(damage, lost=dict(Counter(damage.lost) + new))


def open_log(path: str | PathLike[str] | Sequence[str | PathLike[str]]) -> Log:
    """Open a recording, whole or damaged; DecodeError where a file is another program's.

    `path` is the name that the recorder was given, for all parts; one part; a folder of the parts of one recording; or
    a list of parts.
    """
    files = _files(path)
    parts = _identified(files, strict=not isinstance(path, str | PathLike))
    if all(part.info is not None for part in parts):
        parts.sort(key=lambda part: part.info.part if part.info else 0)
    for part in (part for part in parts if part.recording is None):
        raise DecodeError(
            f"{part.path} was written by another program, so what is missing in it cannot be known here: 'mcap doctor' "
            "judges it, 'mcap recover' mends it, and plumbob.read reads messages of ROS in it."
        )
    if other := _other_recording(parts):
        raise DecodeError(
            f"{files[0].parent} holds parts of several recordings ({', '.join(file.name for file in files[:6])}): "
            f"{other.path.name} does not go on from the part before it. Name the parts of one."
        )
    return Log(parts)


def _other_recording(parts: Sequence[Identity]) -> Identity | None:
    """First part that belongs neither to the recording of those before it nor to one that goes on from it."""
    earlier: list[Identity] = []
    for part in parts:
        if earlier and part.recording not in {"", earlier[-1].recording}:
            # whether one of another name goes on from those before it; one whose beginning is damaged cannot tell
            before, info = earlier[-1].info, part.info
            later = info is None or before is None or info.part > before.part
            goes_on = later and (info is None or info.follows is not None)
            if not goes_on or part.recording in {other.recording for other in earlier}:
                return part
        if part.recording != "":
            earlier.append(part)
    return None


def _identified(files: Sequence[Path], strict: bool) -> list[Identity]:
    """Whose files these are; among parts found by their names, one of which nothing is left is damage, no error."""
    parts, refused = [], []
    for file in files:
        try:
            parts.append(identify(file))
        except DecodeError as error:
            refused.append(error)
            parts.append(Identity(file, ""))
    if refused and (strict or len(refused) == len(files)):
        raise refused[0]
    return parts


def _files(path: str | PathLike[str] | Sequence[str | PathLike[str]]) -> list[Path]:
    if not isinstance(path, str | PathLike):
        files = [Path(name) for name in path]
    elif Path(path).is_dir():
        files = sorted(Path(path).glob(f"*{layout.SUFFIX}"))
    else:
        files = layout.existing_parts(Path(path))
    if not files:
        raise DecodeError(f"{path} is not a recording: there is no such file, or no {layout.SUFFIX} file in it.")
    return files
