"""Many recordings to one dataset: `plumbob.batch`."""

import json
import os
import socket
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from tempfile import TemporaryFile
from typing import TYPE_CHECKING, Any, Final

from plumbob.core import check
from plumbob.core.errors import DecodeError, ParameterError, one_line
from plumbob.core.files import lock, replacing, require_place
from plumbob.core.text import FactsText, counted
from plumbob.core.units import Quantity, given
from plumbob.door.estimate import given_noise
from plumbob.files.text import text_cell
from plumbob.fleet.items import JOBS, Item, Source, batch_items
from plumbob.fleet.job import COLUMNS, VERDICTS, BatchSettings, JobOutcome
from plumbob.fleet.urls import is_url
from plumbob.fleet.workers import outcomes
from plumbob.quality.waves import WaveSettings
from plumbob.rotations import Frame

if TYPE_CHECKING:
    from plumbob.data.cards import CalibrationCard, NoiseCard

_TABLES: Final = "verdicts.parquet", "verdicts.csv"
_SHOWN: Final = 20
_MEMORY_KIB: Final = 400 << 10  # of a process with recordings of a quarter of an hour, measured, less what is shared
_ROWS: Final = 1000


@dataclass(frozen=True, eq=False, repr=False)
class BatchRun(FactsText):
    """What a run of a batch did.

    Attributes
    ----------
    dataset : str
        Path of the dataset.
    counts : mapping of str to int
        Recordings of each verdict.
    skipped : int
        How many of them had been so before.
    seconds : float
        Time of the run.
    others : tuple of JobOutcome
        The first recordings that are not done.
    """

    dataset: str
    counts: Mapping[str, int]
    skipped: int
    seconds: float
    others: tuple[JobOutcome, ...]

    @property
    def recordings(self) -> int:
        """How many there were."""
        return sum(self.counts.values())

    def facts(self) -> Mapping[str, str]:
        """Dataset, and the count of each verdict."""
        return {"dataset": self.dataset, **{name: str(count) for name, count in self.counts.items()}}

    def rows(self) -> list[dict[str, Any]]:
        """Rows of the table of verdicts, of this run and of those before it into the same dataset."""
        return list(_rows(Path(self.dataset)))

    def summary(self) -> dict[str, Any]:
        """All numbers, as JSON can hold them."""
        return {
            "dataset": self.dataset,
            "recordings": self.recordings,
            "verdicts": dict(self.counts),
            "skipped": self.skipped,
            "seconds": round(self.seconds, 3),
            "not_done": [
                {"recording": job.name, "verdict": job.verdict, "reason": job.reason} for job in self.others
            ],
        }  # fmt: skip

    def text(self) -> str:
        """What a reader wants to know first, a line each."""
        lines = [f"recordings   {self.recordings}, {self.skipped} of them as they were before"]
        lines += [f"{name:12} {count}" for name, count in self.counts.items() if count]
        lines += [f"{outcome.verdict:12} {outcome.name}: {outcome.reason}" for outcome in self.others]
        if (more := self.recordings - self.counts["done"] - len(self.others)) > 0:
            lines.append(f"{'':12} and {counted(more, 'further one')}; see the table of verdicts")
        lines.append(f"dataset      {self.dataset}, {self.seconds:.1f} s")
        return "\n".join(lines)


def batch(
    sources: Source | Iterable[Source],
    out: str | os.PathLike[str],
    *,
    filter: str | None = None,
    causal: bool = False,
    lag: float | str | None = None,
    params: Mapping[str, Any] | None = None,
    frame: Frame | str | None = None,
    init: str | None = None,
    calibration: Any = None,
    noise: "NoiseCard | str | Path | None" = None,
    place: str | None = None,
    date: str | None = None,
    profile: str | Path | None = None,
    unit: str | None = None,
    burst: float | str = "20 min",
    tilt_limit: float | str = "15 deg",
    align: Iterable[str] = (),
    settle: float | str = 0.0,
    pages: bool = False,
    waves: bool | WaveSettings = False,
    jobs: int | None = None,
    cluster: str | None = None,
    max_bytes: int = 4 << 30,
    note: Callable[[str], object] | None = None,
    progress: Callable[[int, int | None], object] | None = None,
) -> BatchRun:
    """Estimate the attitude of many recordings, and write a dataset and a table of verdicts.

    A recording that is damaged or cannot be used is a row of the table, and not the end. A second run goes on where the
    first one ended, however it ended: what was made of the same input by the same settings is not made again.

    Parameters
    ----------
    sources : path, URL, pattern, Recording or ImuData, or an iterable of them
        Files of any format that `plumbob.read` takes; folders, with all folders in them; patterns, as
        ``"sea/**/*.parquet"``; URLs that fsspec knows. An iterable is asked for its next recording when there is room.
    out : path
        Folder of the dataset, a new one or one of an earlier run.
    filter, causal, lag, params, frame, init, noise, place, date, profile, unit : optional
        As of `plumbob.estimate`, the same for all.
    calibration : CalibrationCard or path, or several, optional
        One card for all recordings; or a folder or a sequence of cards, each for the recordings of its device.
    burst, tilt_limit : float or str
        As of `plumbob.report`.
    align, settle : optional
        As of `plumbob.evaluate`, where a recording carries a reference.
    pages : bool
        Whether a page of each recording is written, as `plumbob.report` does.
    waves : bool
        Whether sea states are computed, of recordings of something that floats: `plumbob.waves` of the dataset has them
        all, the table of verdicts those of the highest burst.
    jobs : int, optional
        Processes; by default one for each processor that this one may use, as far as there is memory. Each takes about
        260 MiB, and 440 with recordings of a quarter of an hour. One recording alone, or with 1 all of them, are done
        in this process.
    cluster : str, optional
        Address of a Dask scheduler, as ``"tcp://127.0.0.1:8786"``, whose workers do it in place of processes here. They
        must see the same paths.
    max_bytes : int
        Bytes that a file behind a URL may have.
    note : callable, optional
        Called with each remark, and each recording that is not done.
    progress : callable, optional
        Called with the number of recordings that are over, and of all; None where that is not known.

    Returns
    -------
    BatchRun
        Its `rows` are those of the table of verdicts.

    Raises
    ------
    ParameterError
        If an option is wrong, nothing matches, two recordings have one name, or another run writes the dataset.
    CalibrationError, DecodeError
        If a card cannot be read.
    DecodeError, LineError
        If the dataset cannot be written, or what is behind a URL cannot be reached.
    MissingExtraError
        If a URL, a cluster or pages need what is not installed.
    """
    began = time.perf_counter()
    say = note if note is not None else lambda _: None
    how = {
        "filter": filter, "causal": causal, "lag": lag, "params": dict(params or {}),
        "frame": None if frame is None else str(Frame.parse(frame)), "init": init, "place": place, "date": date,
        "profile": profile, "unit": unit,
    }  # fmt: skip
    settings = BatchSettings(
        how={name: value for name, value in how.items() if value},
        cards=load_cards(calibration), noise=given_noise(noise),
        burst=_si("burst", burst, Quantity.TIME), tilt_limit=_si("tilt_limit", tilt_limit, Quantity.ANGLE),
        align=tuple(align), settle=_si("settle", settle, Quantity.TIME), pages=pages, max_bytes=max_bytes,
        waves=waves,
    )  # fmt: skip
    dataset, workers = _dataset(out), _workers(jobs, cluster)
    items, total = listed_items(sources, say)
    settings.try_out()
    if total is not None:
        workers = min(workers, total)  # a recording alone is over before a process of its own has started
    held = locked(dataset, _TABLES, ("attitude", "pages") if pages else ("attitude",))
    with held, closing(outcomes(settings, items, dataset, workers, cluster)) as running:
        counts, others, skipped = _tally(running, total, say, progress)
        _write_tables(dataset)
    shown = tuple(sorted(others, key=lambda outcome: outcome.name))
    return BatchRun(str(dataset), counts, skipped, time.perf_counter() - began, shown)


def _tally(
    running: Iterable[JobOutcome],
    total: int | None,
    say: Callable[[str], object],
    progress: Callable[[int, int | None], object] | None,
) -> tuple[dict[str, int], list[JobOutcome], int]:
    """Recordings of each verdict, the first ones that are not done, and how many were so before."""
    counts, others, skipped = dict.fromkeys(VERDICTS, 0), list[JobOutcome](), 0
    for number, outcome in enumerate(running, 1):
        counts[outcome.verdict] += 1
        skipped += outcome.skipped
        if outcome.reason:
            say(f"{outcome.name}: {outcome.verdict}: {outcome.reason}")
            if len(others) < _SHOWN:
                others.append(outcome)
        if progress is not None:
            progress(number, total)
    return counts, others, skipped


def _si(name: str, value: float | str, quantity: Quantity) -> float:
    """In SI, so that settings are the same however a number was written."""
    number = given(name, value, quantity)
    assert number is not None
    return number


def _workers(jobs: int | None, cluster: str | None) -> int:
    """Processes to use, by default one for each processor that this one may use, as far as there is memory."""
    if jobs is not None and cluster is not None:
        raise ParameterError("jobs is the number of processes here, but a cluster has its own workers. Leave one out.")
    if jobs is None:  # a container or a queue of jobs may have given it fewer than there are
        jobs = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
        with suppress(OSError, IndexError, ValueError):  # a small board has more processors than memory for their work
            free = Path("/proc/meminfo").read_text(encoding="ascii").split("MemAvailable:")[1].split()[0]
            jobs = min(jobs, max(1, int(free) // _MEMORY_KIB))
    if not 1 <= jobs <= 1024:
        raise ParameterError(f"jobs must be 1 to 1024, but it is {jobs}.")
    return jobs


def load_cards(given: Any) -> "dict[str | None, CalibrationCard]":
    """Cards of a folder or a sequence by the device that each is for, else one for None, all devices."""
    if given is None:
        return {}
    from plumbob.data.cards import CalibrationCard

    if isinstance(given, str | Path) and Path(given).is_dir():
        files = sorted(Path(given).glob("*.json"))
        if not files:
            raise ParameterError(f"{given} holds no calibration card (*.json). Name a card, or a folder of cards.")
        given = files
    if not isinstance(given, list | tuple):
        return {None: CalibrationCard.of(given)}
    cards: dict[str | None, CalibrationCard] = {}
    for card in map(CalibrationCard.of, given):
        if card.device in cards:
            raise ParameterError(f"two calibration cards are of the device '{card.device}'. Keep one of them.")
        cards[card.device] = card
    return cards


def _dataset(out: str | os.PathLike[str]) -> Path:
    """Folder of a dataset, or one that is empty or not there; ParameterError if other files lie there."""
    if is_url(os.fspath(out)):
        raise ParameterError(f"{out} is a URL, but a dataset is a folder. Name one, and copy it there afterwards.")
    folder = check.path("out", out).absolute()  # the workers of a cluster have folders of their own
    if folder.exists() and not folder.is_dir():
        raise ParameterError(f"{out} is a file, but a dataset is a folder. Name another one.")
    names = sorted(path.name for path in folder.iterdir()) if folder.is_dir() else []
    if names and JOBS not in names:
        raise ParameterError(f"{out} holds other files ({names[0]}), and not a dataset. Name a new or an empty folder.")
    return folder


@contextmanager
def locked(dataset: Path, files: Iterable[str] = (), folders: Iterable[str] = ()) -> Iterator[None]:
    """Context in which no other run writes a dataset, by a lock that goes with its process, however that ends.

    DecodeError where nothing can be written here, to one of these folders, or to a file of one of these names.
    """
    held = dataset / JOBS / ".lock"
    try:
        for folder in held.parent, *map(dataset.joinpath, folders):
            folder.mkdir(parents=True, exist_ok=True)
            with TemporaryFile(dir=folder):  # what a system says of rights need not be so
                pass
        descriptor = os.open(held, os.O_CREAT | os.O_RDWR, 0o666)
    except OSError as error:
        why = f"{error.filename}: {error.strerror}" if error.filename else one_line(error)
        raise DecodeError(f"{dataset} cannot be written ({why}). Name another folder.") from error
    try:
        try:
            lock(descriptor)
        except OSError:
            holder = os.read(descriptor, 200).decode("utf-8", "replace") or "not named"
            raise ParameterError(f"{dataset} is written by another run ({holder}); wait for its end.") from None
        os.truncate(descriptor, 0)
        os.write(descriptor, f"process {os.getpid()} on {socket.gethostname()}".encode())
        for name in files:
            require_place(dataset / name, overwrite=True)
        yield
    finally:
        os.close(descriptor)


def listed_items(sources: Source | Iterable[Source], say: Callable[[str], object]) -> tuple[Iterable[Item], int | None]:
    """Items, and how many there are where they need not be made to be counted."""
    items = batch_items(sources, say)
    if isinstance(sources, Iterator):
        return items, None
    listed = list(items)
    if not listed:
        raise ParameterError("the given paths hold no recording. Name files, a folder or a pattern.")
    return listed, len(listed)


def _rows(dataset: Path) -> Iterator[dict[str, Any]]:
    """Rows of all records, in the order of their names."""
    for path in sorted((dataset / JOBS).glob("[!.]*.json")):
        yield json.loads(path.read_bytes())["row"]


def _write_tables(dataset: Path) -> None:
    """Write the table of verdicts, as Parquet and as CSV, from columns that are filled with few rows at a time."""
    import pyarrow as pa
    from pyarrow.parquet import write_table

    kinds = {str: pa.string(), int: pa.int64(), float: pa.float64()}
    schema = pa.schema([pa.field(name, kinds[kind]) for name, kind in COLUMNS.items()])
    rows, parts = _rows(dataset), list[pa.RecordBatch]()
    while some := list(islice(rows, _ROWS)):
        parts.append(pa.RecordBatch.from_pylist(some, schema))

    for path in map(dataset.joinpath, _TABLES):
        with replacing(path, overwrite=True) as temporary:
            if path.suffix == ".csv":
                with temporary.open("w", encoding="utf-8") as text:
                    text.write(",".join(COLUMNS) + "\n")
                    for part in parts:
                        text.writelines(",".join(map(_cell, row.values())) + "\n" for row in part.to_pylist())
            else:
                write_table(pa.Table.from_batches(parts, schema), str(temporary))


def _cell(value: Any) -> str:
    """Text that no spreadsheet takes for a formula, or a number."""
    return text_cell(value) if isinstance(value, str) else "" if value is None else str(value)
