"""How an unknown text file is laid out, found by trying: the layout in which most rows are numbers.

What is found here is tested on every row of the first part of the file, so it is not a guess; what the columns mean is
asked by `plumbob.files.draft`.
"""

import codecs
import json
import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from itertools import pairwise, product
from pathlib import Path
from typing import Final

import numpy as np

from plumbob.core.check import Floats
from plumbob.core.errors import DecodeError, excerpt
from plumbob.core.units import QUANTITY_BY_TRIAD, Quantity
from plumbob.files.arrow import text_bytes
from plumbob.files.column_names import ColumnName, canonical, is_unit, measured_in, named_sensor, taken_apart
from plumbob.files.columns import is_clocklike
from plumbob.files.known_logs import SENTENCES
from plumbob.files.profile import BLANK, JSON, QUOTED, TextLayout
from plumbob.files.stamps import CENTURY
from plumbob.files.text_table import (
    LEFT_OUT_MOST,
    NUMBER,
    TOKEN,
    all_words,
    among_words,
    are_objects,
    cells_apart,
    channel,
    channels_as_columns,
    decode,
    flat_cells,
    grouped,
    label,
    names_apart,
    normal,
    number_and_unit,
    objects_as_rows,
    split_vectors,
    titled,
    vector,
)

READ: Final = 1 << 20  # bytes that are looked at
TRIED: Final = 1000  # lines with which every layout is tried
_NAMES_WITHIN: Final = 1 << 14  # characters in which names are sought to tell an encoding
_MOST_KINDS: Final = 6  # kinds of rows in a file
_MOST_CHANNELS: Final = 60  # sensors' axes in a table with a row for each number
FEWEST: Final = 3  # rows that make a table
ROWS: Final = 4000  # rows of arrays that are looked at
MISSING: Final = (
    "", "NaN", "nan", "--", "null", "NULL", "N/A", "#N/A", "NA", "None", "none", "-", ".nan", "1.#QNAN", "#DIV/0!",
)  # fmt: skip
_COMMENTS: Final = ("#", "%", "//")
_GROUPED: Final = {
    ".": re.compile(r"[-+]?\d{1,3}((,\d{3}){2,}|(,\d{3})+\.\d+|([' ]\d{3})+(\.\d*)?)"),
    ",": re.compile(r"[-+]?\d{1,3}(\.\d{3}|[' ]\d{3})+,\d+"),
}  # numbers that surely stand in groups of three digits; between commas, a cell with one was quoted
_LAYOUTS: Final = (*product(";\t", ".,"), *product(",|", "."), *product(" ", ".,"), (QUOTED, ","))
# what a log or a prompt writes before the first number of a row
_WORDS_BEFORE: Final = re.compile(
    r"\D*[\[(] *[\d.]+[\])]\D*?(\S+\s+)(?=[-+.\d])|(?!.*\d:\d\d)(.*?[^\w\s.+-]\s*|.*[^\W\d].*?\s)(?=[-+.\d])"
)  # of a log that counts in brackets, its last word
_BESIDE_SIGNS: Final = re.compile(r" ?([^\w\s#.+-]) ?")
_UNIT_CELL: Final = re.compile(r"[\[(].*[\])]")


@dataclass(frozen=True, slots=True)
class Sample:
    """The first rows of a text file."""

    layout: TextLayout  # how the file is laid out
    # names, units: names of the columns, as far as the file has any, and the cells of a row of units below them
    names: tuple[str, ...]
    units: tuple[str, ...]
    by_name: bool  # whether a profile may name the columns so; otherwise it must number them
    rows: list[list[str]]  # cells
    # what lines before the table say, by key, lower case; the lines themselves where they say no key
    facts: Mapping[str, str]
    others: "tuple[Sample, ...]" = ()  # rows of other kinds that stand between them, or tables below
    sensor: str = ""  # sensor of the table by its title; empty where none says it

    @property
    def width(self) -> int:
        """Cells of a row."""
        return len(self.rows[0])

    @property
    def preamble(self) -> str:
        """What the lines before the table say, each fact in a line."""
        return "\n".join(f"{key}: {fact}" for key, fact in self.facts.items())

    def for_cells(self, words: Sequence[str]) -> tuple[str, ...]:
        """Names or units, one for each cell of a row; empty where the file has none."""
        return (*words, *[""] * self.width)[: self.width]

    @property
    def parts(self) -> list[ColumnName]:
        """Names of its columns taken apart, with their units."""
        return [*map(taken_apart, self.for_cells(self.names), self.for_cells(self.units))]

    def ref(self, column: int) -> int | str:
        """What a profile calls a column that is counted from 0: its name, or its number from 1."""
        name = self.names[column] if self.by_name else ""
        return name if name and self.names.count(name) == 1 else column + 1

    def cells(self, column: int) -> list[str]:
        """Cells of a column, counted from 0."""
        return [row[column].strip() for row in self.rows]

    def numbers(self, column: int) -> Floats:
        """Numbers of a column, counted from 0; NaN where a cell is none."""
        return np.array([_value(cell, self.layout.decimal, self.layout.thousands) for cell in self.cells(column)])


@dataclass(slots=True)
class _SniffedTable:
    separator: str
    decimal: str
    rows: list[list[str]] = field(default_factory=list)
    lines: list[int] = field(default_factory=list)  # where they stand, from 0
    readable: int = 0

    @property
    def score(self) -> tuple[int, int]:
        """Rows, then cells in them that are numbers, times or missing."""
        return (len(self.rows), self.readable)


def is_array(path: Path) -> bool:
    """Whether JSON is an array, as logs are; cards and settings are objects."""
    return text_bytes(path, READ).removeprefix(codecs.BOM_UTF8).lstrip().startswith(b"[")


def read_sample(path: Path) -> Sample:
    """First rows of a text file, and how it is laid out; DecodeError if no layout makes a table of it."""
    raw = text_bytes(path, READ)
    complete = len(raw) < READ
    text, encoding = decoded(raw)
    if are_objects(text) and (
        sample := _of_objects(text if complete else decode(text_bytes(path), encoding), encoding)
    ):
        return sample
    lines = text.split("\n")
    lines = lines if complete else lines[:-1]
    tried = lines[:TRIED]
    tables = [table for sep, decimal in _LAYOUTS if (table := _table(tried, sep, decimal)).rows]
    most = max((len(table.rows) for table in tables), default=0)
    named = []  # under a row of names, where only single cells of rows are words
    for table in (table for table in tables if len(table.rows) > most - FEWEST):
        names: tuple[str, ...] = ()
        with suppress(DecodeError):  # of cells in two units
            names = _headed(lines, table, "utf-8").names
        is_known = 2 * _known_names(names) >= len(names) and len({*names}) > len("xy")
        if is_known and 4 * table.readable > 3 * len(table.rows) * len(table.rows[0]):
            named.append(table)
    best = max(named or tables, key=lambda table: table.score, default=_SniffedTable(",", "."))
    if not named and (sample_of_values := _of_values(text, encoding)):
        return sample_of_values
    try:
        kinds = [] if named else _worded(lines, encoding)
    except DecodeError:
        if 2 * len(best.rows) < sum(map(bool, map(str.strip, tried))):  # a table may have what lines of words lack
            raise
        kinds = []
    if kinds:
        return replace(kinds[0], others=tuple(kinds[1:]))
    if len(best.rows) < FEWEST:
        first = next((line for line in lines if line.strip()), "")
        if sum(bool(re.search(r"\b0x[0-9A-Fa-f]+\b", line)) for line in tried) >= FEWEST:
            raise DecodeError(
                "its numbers are hexadecimal, and nothing says which of them are negative: write them as decimal "
                f"numbers, for sensors mostly as two's complement. The first line is {excerpt(first)}."
            )
        raise DecodeError(
            f"no separator makes a table of it: at least {FEWEST} rows of 2 or more numbers were expected, as in a CSV "
            f"or in lines like 'acc x=0.1 y=0.2', but the first line is {excerpt(first)}. Write a row for each sample. "
            "Numbers of one axis at rest are for 'plumbob allan', with --rate and --scale."
        )
    sample = _headed(lines, _table(lines, best.separator, best.decimal), encoding)
    sensors = {part.sensor for part in sample.parts} & set(QUANTITY_BY_TRIAD)
    if not complete and len(sensors) < 2:  # other sensors may have their table far below
        lines = decode(text_bytes(path), encoding).split("\n")
    return _sections(lines, best, encoding) or _of_channels(text, sample) or _of_kinds(lines, sample) or sample


def _sections(lines: Sequence[str], table: _SniffedTable, encoding: str) -> Sample | None:
    """Tables below each other, each under a row of names, of different sensors; None where there is but one."""
    starts: dict[int, tuple[tuple[str, ...], str]] = {}
    for i in range(len(lines)):
        if names := _row_of_names(lines, i, table):
            start = i
            while start > 0 and not _known_cells(
                _cells(lines[start - 1], table.separator, 0), table.separator, table.decimal
            ):
                start -= 1
            start = next(k for k in range(start, i + 1) if lines[k].strip())
            starts[start] = names, next(filter(None, map(named_sensor, reversed(lines[start:i]))), "")
    if len(starts) < 2 or len(set(starts.values())) < len(starts):
        return None
    samples: list[Sample] = []
    for start, end in pairwise((*starts, len(lines))):
        part = lines[start : min(end, start + ROWS)]
        sample = _headed(part, _table(part, table.separator, table.decimal), encoding)
        layout, marker = sample.layout, lines[start].strip()
        if layout.skip and start:
            count = [line.strip() for line in lines[: start + 1]].count(marker)
            layout = replace(layout, marker=marker, occurrence=count, skip=layout.skip - 1)
        else:
            layout = replace(layout, skip=start + layout.skip)
        layout = replace(layout, end=lines[end].strip() if end < len(lines) else "")
        facts = {**(samples[0].facts if samples else {}), **sample.facts}
        samples.append(replace(sample, layout=layout, sensor=starts[start][1], facts=facts))
    samples = [sample for sample in samples if len(sample.rows) >= FEWEST]
    return replace(samples[0], others=tuple(samples[1:])) if samples else None


def _row_of_names(lines: Sequence[str], row: int, table: _SniffedTable) -> tuple[str, ...]:
    """Names in a line above rows of as many numbers, with or without a row of units between; nothing in another."""
    line, signs = lines[row].lstrip("#%/ "), (table.separator, table.decimal)
    if not line.lstrip('"')[:1].isalpha() or _known_cells(_cells(line, table.separator, 0), *signs):
        return ()
    below = [_cells(line, table.separator, 0) for line in lines[row + 1 : row + 6] if line.strip()]
    below = below[1:] if below and _are_units(below[0]) else below
    counts = [len(cells) for cells in below[:FEWEST] if _known_cells(cells, *signs)]
    cells = _cells(line, table.separator, 0)
    names = _names(cells, replace(table, rows=below[:FEWEST])) if len(counts) == FEWEST else ()
    return names if 2 * _known_names(names) >= len(names) else ()


def _of_channels(text: str, sample: Sample) -> Sample | None:
    """First rows of a table with a row for each number, whose cells name its sensor and axis; None of another."""
    columns = [sample.cells(i) for i in range(sample.width)]
    values = [i for i in range(sample.width) if len(set(columns[i])) > 2 and np.isfinite(sample.numbers(i)).all()]
    clocks = [i for i, cells in enumerate(columns) if len(set(cells)) > 2 and _rises(cells, sample.layout.decimal)]
    values = [i for i in values if i not in clocks]
    values = [i for i in values if any(sample.numbers(i) % 1.0)] or values
    words = [i for i in range(sample.width) if i not in values and 1 < len(set(columns[i])) <= _MOST_CHANNELS]
    words = [i for i in words if i not in clocks and not any(map(_is_number, columns[i]))]
    parts = [taken_apart(channel(row)) for row in dict.fromkeys(zip(*(columns[i] for i in words), strict=True))]
    if len(values) != 1 or not clocks or {part.axis for part in parts if part.sensor} < set("xyz"):
        return None
    clocks.sort(key=lambda i: not (sample.names and taken_apart(sample.names[i]).is_time))
    clock = min(clocks, key=lambda i: abs(len(set(columns[i])) * len(parts) - len(columns[i])))  # whole rows
    refs = tuple(map(sample.ref, (clock, *words, values[0])))
    layout = replace(sample.layout, channels=refs, cells=())
    lines = channels_as_columns(text, layout)[0].split("\n")
    wide = _headed(lines, _table(lines, "\t", layout.decimal), layout.encoding)
    return replace(wide, layout=replace(layout, missing=wide.layout.missing), facts=sample.facts)


def _of_values(text: str, encoding: str) -> Sample | None:
    """First rows of lines that say one number of a channel among words each, behind a time; None of other lines."""
    lines = [line for line in text.split("\n")[:TRIED] if line.strip()]
    kinds: dict[str, list[list[str]]] = {}
    for line in lines:
        kinds.setdefault(all_words(line), []).append(among_words(line)[:-1])
    kinds = {word: rows for word, rows in kinds.items() if len(rows) >= FEWEST and len({*map(len, rows)}) == 1}
    columns = {word: [*zip(*rows, strict=True)] for word, rows in kinds.items()}
    varying = Counter(tuple(k for k, cells in enumerate(of) if len({*cells}) > 1) for of in columns.values())
    places = max(varying, key=lambda both: varying[both] * (len(both) == len("tv")), default=())
    if len(places) != len("tv") or varying[places] < len("xyz") or sum(map(len, kinds.values())) < 0.5 * len(lines):
        return None
    line = next(line for line in lines if all_words(line) in kinds)
    is_cell = re.search(r"[,;\t]\s*$", TOKEN.split(line)[places[1]])  # words between separators are cells
    if is_cell or not all(_rises([row[places[0]] for row in rows], ".") for rows in kinds.values()):
        return None
    layout = TextLayout(" ", encoding=encoding, names=False, words=True, channels=(places[0] + 1, places[1] + 1))
    wide = channels_as_columns(text, layout)[0].split("\n")
    sample = _headed(wide, _table(wide, "\t", "."), encoding)
    shared = set.intersection(*({*word.split()} for word in kinds))
    shared -= {word for word in shared if measured_in(word) or taken_apart(f"{word} x").sensor in QUANTITY_BY_TRIAD}
    names = [" ".join(word for word in name.split() if word not in shared) for name in sample.names]
    parts = [taken_apart(name) for name in names]
    if not any({*"xyz"} <= {part.axis for part in parts if part.sensor == sensor} for sensor in QUANTITY_BY_TRIAD):
        return None
    layout = replace(layout, missing=sample.layout.missing)
    return replace(sample, layout=layout, names=tuple(names), by_name=False, facts={})


def _of_kinds(lines: Sequence[str], sample: Sample) -> Sample | None:
    """Rows of several kinds by their first word, of which lines of comment give the names; None of other tables."""
    sign, kinds = sample.layout.separator, list[Sample]()
    comments = [_cells(line.lstrip("#%/ "), sign, 0) for line in lines[:TRIED] if line.startswith(_COMMENTS)]
    rows_of_all = [_cells(line, sign, 0) for line in lines] if len(comments) > 1 else []
    for word, cells in {cells[0].strip(): cells for cells in comments if len(cells) > len("xyz")}.items():
        rows = [row for row in rows_of_all if len(row) == len(cells) and row[0].strip() == word]
        layout = replace(sample.layout, skip=0, names=False, after_names=0, mark="", where=(1, word))
        if len(rows) >= FEWEST and 2 * _known_names(cells) >= len(cells) - 1:
            kinds.append(replace(sample, layout=layout, names=("", *cells[1:]), units=(), by_name=False, rows=rows))
    return replace(kinds[0], others=tuple(kinds[1:])) if len(kinds) > 1 else None


def _of_objects(text: str, encoding: str) -> Sample | None:
    """First rows of objects of JSON; None where objects in lines are damaged, and may be read as words."""
    try:
        lines = objects_as_rows(text).split("\n")[:-1]
    except DecodeError:
        if text.lstrip().startswith("{") and text.count("\n") >= FEWEST:
            return None
        raise
    table = _table(lines, "\t", ".")
    if len(table.rows) < FEWEST:
        raise DecodeError(f"no array in it holds {FEWEST} samples of 2 numbers; write an object for each sample.")
    sample = _headed(lines, table, encoding)
    return replace(sample, layout=replace(sample.layout, separator=JSON))


def _worded(lines: Sequence[str], encoding: str) -> list[Sample]:
    """Rows in which numbers stand among words or behind the name of a sentence, by these words, the commonest first."""
    lines = [line.strip() for line in titled("\n".join(lines)).split("\n") if line.strip()]
    bodies = [re.sub(r"^([$#!].*)\*[0-9A-Fa-f]{2}$", r"\1", line) for line in lines]
    tried = [_BESIDE_SIGNS.sub(r"\1", " ".join(TOKEN.sub("#", body).split())) for body in bodies[:TRIED]]
    counts = Counter(text for text in tried if text.count("#") > 1).most_common(_MOST_KINDS)
    kinds = [text for text, count in counts if 2 * count > counts[0][1] or text[0] in "$#!"]
    units_behind = {text.rpartition("#")[2].strip() for text in kinds}
    labelled = all(_is_among_words(text.split("#")) for text in kinds)
    labelled = labelled or (len(units_behind) == len(kinds) > 1 and all(map(measured_in, units_behind)))
    covered, several = sum(tried.count(text) for text in kinds), sum(text.count("#") > 1 for text in tried)
    if not kinds or not labelled or covered < max(0.5 * several, 0.25 * len(tried)):
        return []
    firsts = [bodies[tried.index(text)] for text in kinds]
    is_alone = sum(map(tried.count, kinds)) == len(tried) and len(kinds) == 1
    words_of = (lambda row: among_words(row)[-1], all_words)  # the latter where lines of several sensors begin alike
    for mark_of in words_of:
        marks, samples = [*map(mark_of, bodies)], list[Sample]()
        for body in firsts:
            mark, width = marks[bodies.index(body)], len(among_words(body))
            of_kind = [i for i, word in enumerate(marks) if word == mark]
            where = (width, mark) if mark and not is_alone else ()
            checked = all(lines[i] != bodies[i] for i in of_kind)
            layout = TextLayout(" ", encoding=encoding, names=False, words=True, where=where, checksum=checked)
            labels = ((), ()) if re.match(r"[$!]\w+,", body) else _labels(TOKEN.split(body))  # or words are cells
            names, units = _fields(among_words(body)[-1].strip("$#!"), width - 1, lines) or labels
            if "x" in names[names.index("z") + 1 if "z" in names else len(names) :]:
                raise DecodeError(f"a line holds several samples: {excerpt(body)}. Write a row for each sample.")
            rows = [row for i in of_kind if len(row := among_words(bodies[i])) == width]
            sensor = "" if any(names) else measured_in("".join(units[-1:]))
            sample = Sample(layout, names, units, by_name=False, rows=rows, facts={}, sensor=sensor)
            alike = [other for other in samples if other.layout == layout]
            if any((other.names, other.units) != (names, units) for other in alike):
                break
            samples += [] if alike or len(rows) < FEWEST else [sample]
        else:
            return [sample for sample in samples if sample.names] or samples
    raise DecodeError(f"lines of several sensors begin alike, as {excerpt(body)}. Write what they measure into each.")


def _fields(word: str, width: int, lines: Sequence[str]) -> tuple[tuple[str, ...], tuple[str, ...]] | None:
    """Names and units of a sentence's fields: those of `SENTENCES`, or of lines that name it and have no numbers."""
    said = [SENTENCES.get(word, []), *(line.split(f",{word},")[1].split(",") for line in lines if f",{word}," in line)]
    rows = [tuple(cells) for cells in said if len(cells) == width and not any(map(_is_number, cells))]
    return (rows[0], rows[1] if len(rows) > 1 else ()) if rows else None


def _is_among_words(gaps: Sequence[str]) -> bool:
    """Whether numbers have labels: two, one and a unit behind all, or a mark behind a first word or a time.

    Words between separators are cells.
    """
    labels = [gap for gap in gaps[:-1] if re.search(r"[^\W\d_]", gap) and not re.search(r"[,;\t]\s*$", gap)]
    labels += gaps[-1:] if is_unit(gaps[-1].strip()) else []
    mark = r"\s*[^\W\d].*[:=][\[({\s]*|.*->\s*|\s*[\[({][\[({\s]*|[$#!][^\W\d]\w*,"
    return len(labels) > 1 or any(re.fullmatch(mark, gap) for gap in gaps[:2])


def _labels(gaps: Sequence[str]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Names and units of numbers by the text before and behind them; a unit is of all axes that it ends."""
    log_level = re.fullmatch(r"\s*[EWIDV] \(", gaps[0])  # ms since the start [ESP-IDF, Logging library]
    words, units, axis = ["time ms" if log_level else label(gaps[0])], [""] * (len(gaps) - 1), 0
    for i, gap in enumerate(gaps[1:], 1):
        unit = re.match(r"\s*([^][\s,;|:={}()]++)(?![:=])", gap)  # behind a colon follows what a word names
        behind = unit is not None and is_unit(unit[1])
        if unit is not None and behind:
            for k in range(i - 1, max(-1, i - 4), -1):
                if units[k]:
                    break
                units[k] = unit[1]
                if not any(canonical(unit[1], kind) for kind in (*QUANTITY_BY_TRIAD.values(), Quantity.ANGLE)):
                    break  # of one number alone, as of a temperature
        rest = gap[unit.end() :] if unit is not None and behind else re.sub(r"^[^\W\d_]+(?=[\s,;|])", "", gap)
        words.append(label(rest))
    names: list[str] = []
    for i, (word, other) in enumerate(pairwise(words[:-1])):  # what a log writes before a name is of no number
        bare = " ".join(word.split()[-len(other.split()) :]) if other else word
        if (part := taken_apart(bare)).is_time or (part.sensor and part.base == taken_apart(other).base):
            words[i] = bare
        elif not i and not part.sensor and taken_apart(word.split()[-1] if word else "").is_time:
            words[i] = word.split()[-1]
    for i, word in enumerate(words[:-1]):
        ends = not any(words[i + 1 : i + 3]) and i + 3 < len(words)  # whether two numbers without a label follow
        axis = (0 if ends and not taken_apart(word).axis else len("xyz")) if word else axis + 1
        names.append(word or ("xyz"[axis] if any(names) and axis < 3 else ""))
    if sum(map(bool, words[:-1])) < 2:  # a word before all of them
        first = next((i for i, word in enumerate(words[:-1]) if word), 0)
        parts, count, sensor = words[first].split(), len(names) - first, named_sensor(words[first])
        if len(parts) == count and (not sensor or all(taken_apart(part).axis for part in parts)):
            names[first:] = parts
        elif not sensor or count != len("xyz"):
            names.clear()
    count = sum(map(bool, words[:-1]))
    of_a_log = 1 < count < 0.5 * len(names) and not _known_names(words[:-1])  # before plain numbers
    return () if of_a_log else tuple(names), tuple(units)


def decoded(raw: bytes) -> tuple[str, str]:
    """Text of the first bytes of a file, and its encoding: UTF-8, or the one in which most words are understood."""
    if raw.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return normal(raw.decode("utf-16", "ignore")), "utf-16"
    for encoding, zeros in (("utf-16-le", raw[1::2]), ("utf-16-be", raw[::2])):
        if 2 * zeros.count(0) > len(zeros) > 0:
            return normal(raw.decode(encoding, "ignore")), encoding
    texts: dict[str, str] = {}
    for encoding in ("utf-8", "gbk", "shift_jis", "cp1251", "latin-1"):
        with suppress(UnicodeDecodeError):
            texts[encoding] = normal(codecs.getincrementaldecoder(encoding)().decode(raw))
            if encoding == "utf-8":
                return texts[encoding], encoding

    def understood(name: str) -> int:
        """Words of the lines with other letters than English ones that name a sensor, time or a unit."""
        lines = [line for line in texts[name][:_NAMES_WITHIN].split("\n") if not line.isascii()]
        parts = [taken_apart(w) for line in lines for w in re.split("[,;\t]", line) if re.search(r"[^\W\d]", w)]
        return sum(bool(part.sensor) + part.is_time + is_unit(part.unit) for part in parts)

    encoding = max(texts, key=understood)
    return texts[encoding], encoding


def _table(lines: Sequence[str], separator: str, decimal: str) -> _SniffedTable:
    """Longest run of rows with as many cells, most of them numbers; comments and single bad lines do not end it."""
    best = run = _SniffedTable(separator, decimal)
    bad = 0
    for i, line in enumerate(lines):
        if not line.strip() or line.startswith(_COMMENTS):
            continue
        cells = _cells(line, separator, i + 1)
        count = _known_cells(cells, separator, decimal)
        if count and run.rows and len(cells) == len(run.rows[0]):
            bad = 0
        elif count and (not run.rows or len(run.rows) < FEWEST or bad >= FEWEST):
            run, bad = _SniffedTable(separator, decimal), 0
        else:
            bad += 1
            is_words = not any(map(_is_number, cells)) and run.rows and len(cells) == len(run.rows[0])
            if is_words and len(run.rows) < FEWEST:  # as a row of names
                run = _SniffedTable(separator, decimal)
            continue
        run.rows.append(cells)
        run.lines.append(i)
        run.readable += count
        best = max(best, run, key=lambda table: table.score)
    return best


def _cells(line: str, separator: str, number: int) -> list[str]:
    try:
        return split_vectors(line, separator, number)
    except DecodeError:
        return []


def _is_number(cell: str) -> bool:
    return NUMBER["."].fullmatch(cell.strip()) is not None


def _thousands(rows: Sequence[Sequence[str]], decimal: str) -> str:
    """What stands between groups of three digits, where one number proves it and none of its column tells against."""
    columns = zip(*rows, strict=False)
    said = [[c for c in map(str.strip, cells) if re.search(r"\d", c) and not is_clocklike(c)] for cells in columns]
    for sign in (sign for sign in ",.' " if sign != decimal):
        grouped_ones = [column for column in said if any(sign in cell for cell in column)]
        groups = [cell for column in grouped_ones for cell in column if sign in cell]
        others = [cell for column in grouped_ones for cell in column if NUMBER[decimal].fullmatch(cell)]
        proven = any(cell.count(sign) > 1 for cell in groups) or any(map(str.isdigit, others))
        proven = proven or any(decimal in cell for column in said for cell in column)
        proven = proven and not any(re.match(r"[-+]?\d{4}", cell) for cell in others)
        if groups and proven and all(map(grouped(sign, decimal).fullmatch, groups)):
            return sign
    return ""


def _known_cells(cells: Sequence[str], separator: str, decimal: str) -> int:
    """Cells that are numbers, times or missing, in a row of which at least half of what is said are; else 0."""
    if len(cells) < 2:
        return 0
    said = [cell.strip() for cell in cells if cell.strip()]
    number = NUMBER[decimal].fullmatch
    groups = (grouped(",", ".") if separator == "," else _GROUPED[decimal]).fullmatch
    numbers = sum((number(cell) or groups(cell)) is not None or _numbers_in(cell, decimal) for cell in said)
    readable = numbers + sum(cell in MISSING or is_clocklike(cell) for cell in said)
    is_row = numbers >= 1 and 2 * readable >= len(said) and readable + len(cells) - len(said) >= 2
    is_row = is_row or (separator != " " and numbers > 1 and 3 * readable >= len(said))  # a number among its names
    return readable + len(cells) - len(said) if is_row else 0


def _numbers_in(cell: str, decimal: str) -> int:
    """Numbers in a cell that holds a vector, where it is in brackets, or a number with its unit."""
    if numbers := vector(cell, decimal):
        return len(numbers) if cell[-1] in "])}" else 1
    text, unit = number_and_unit(cell)
    return bool(NUMBER[decimal].fullmatch(text)) and is_unit(unit)


def _forms(table: _SniffedTable, names: Sequence[str]) -> tuple[str, ...]:
    """What each cell of a row holds, as in `TextLayout.cells`; numbers without brackets are a vector of a sensor."""
    forms: list[str] = []
    for column, name in zip(zip(*table.rows[:TRIED], strict=True), (*names, *[""] * len(table.rows[0])), strict=False):
        said = [cell.strip() for cell in column if cell.strip() not in {*MISSING, "[]", "()"}]
        sizes = Counter(len(vector(cell, table.decimal)) for cell in said).most_common(1) or [(0, 0)]
        units = Counter(unit for number, unit in map(number_and_unit, said) if number).most_common(1) or [("", 0)]
        bracketed = any(cell[:1] in set('[({"xX') for cell in said) or bool(taken_apart(f"{name} x").sensor)
        is_vector = sizes[0][0] > 1 and sizes[0][1] > 0.5 * len(said) and bracketed
        has_unit = units[0][1] > 0.5 * len(said) and is_unit(units[0][0])
        words = None if forms or all(map(NUMBER[table.decimal].fullmatch, said)) else _WORDS_BEFORE.match(said[0])
        before, behind = (
            (words[1] or words[2]) if words else "",
            units[0][0] if re.fullmatch(r"[^\w\s#%]+", units[0][0]) else "",
        )
        bare = [cell.rpartition(before)[2].removesuffix(behind) for cell in said] if before else []
        bare = [cell.removesuffix(behind) for cell in said] if behind and not before else bare
        around = f"{before}#{behind}" if bare and all(map(_is_number, bare)) else ""
        forms.append(f"[{sizes[0][0]}]" if is_vector else units[0][0] if has_unit else around)
    is_split = any(re.match(r"[\[({].*[,; ]", cell) for row in table.rows[:TRIED] for cell in row)
    return tuple(forms) if any(forms) or is_split else ()


def _value(cell: str, decimal: str, thousands: str = "") -> float:
    cell = cell.replace(thousands, "") if thousands else cell
    return float(cell.replace(",", ".")) if NUMBER[decimal].fullmatch(cell) else float("nan")


def _headed(lines: Sequence[str], table: _SniffedTable, encoding: str) -> Sample:
    """Add names and units, and what the lines before them say."""
    before = [(i, line) for i, line in enumerate(lines[: table.lines[0]]) if re.search(r"\w", line)]
    before = [(i, line) for i, line in before if not re.fullmatch(r"\[[\w ]+\]\s*", line)]  # of a section
    if clock := _start_and_rate(lines):
        missing = _missing(table.rows)
        layout = TextLayout(table.separator, table.decimal, encoding, missing=missing, skip=2, names=False)
        rows = [row for i, row in zip(table.lines, table.rows, strict=True) if i > 1]
        return Sample(layout, (), (), by_name=False, rows=rows, facts=clock)
    bare = before[-1][1].lstrip("#%/ ") if before else ""
    if table.separator == " " and len(apart := bare.split(" ")) > len(table.rows[0]):
        rows = [lines[i].split(" ") for i in table.lines]
        if all(len(row) == len(apart) for row in rows):  # each blank separates, and cells are empty
            table = replace(table, separator=BLANK, rows=rows)
    width = len(table.rows[0])
    cells = [_cells(line.lstrip("#%/ "), table.separator, 0) for _, line in before]
    fits = [len(cells) > 1 and abs(len(row) - width) < len("xy") for row in cells]
    rows_of_units = [k for k, row in enumerate(cells) if fits[k] and _are_units(row)]
    others = [k for k in range(len(cells)) if k not in rows_of_units]
    named = [(_known_names({*names}), k, names) for k in others if (names := _names(cells[k], table))]
    _, place, names = max((row for row in named if row[0] > 1 or row[1] == others[-1]), default=(0, -1, ()))
    at, line = before[place] if names else (0, "")
    below = range(place + 1, len(cells))
    last = max((before[k][0] for k in below if not _is_number("".join(cells[k][:1]))), default=at)
    units = tuple(cells[max(rows_of_units)]) if rows_of_units else ()
    if names and (moved := len(names) - len(cells[place])):
        units = ("", *units) if moved > 0 else units[1:]
    full, by_name = names, bool(names) and [*names] == [cell.strip() for cell in cells[place]]
    for above in reversed(cells[:place] if by_name else ()):
        if (full := _under(above, names)) != names:
            break
    described = [fact for _, line in before for fact in _in_json(line)] if not names else []
    listed = [tuple(words) for words in described if isinstance(words, list) and len(words) == width]
    full = max(listed, key=_known_names, default=full)
    if _known_names({*full}) < len("xy"):
        full = _listed_above([line for _, line in before[: place if names else None]], names, table) or full
        full = full or _constant_words(table.rows)
    counts = [_value(cell.strip(), ".") for cell in table.rows[0] if cell.strip()]
    if names and min(counts) == max(counts) >= len(table.rows) - 1 > FEWEST:  # of samples, below the names
        last, table = table.lines[0], replace(table, rows=table.rows[1:], lines=table.lines[1:])
    bare = line.lstrip("#%/ ")
    marked = names and bare != line
    skip = at if names else table.lines[0] if any(not line.startswith(_COMMENTS) for _, line in before) else 0
    body = lines[skip + 1 if marked else skip :]
    layout = TextLayout(
        separator=table.separator,
        decimal=table.decimal,
        thousands=_thousands(table.rows, table.decimal),
        encoding=encoding,
        comment=next((sign for sign in _COMMENTS if any(row.startswith(sign) for row in body)), ""),
        missing=_missing(table.rows),
        skip=skip,
        names=bool(names),
        after_names=last - at if names else 0,
        mark=line[: len(line) - len(bare)] if marked else "",
    )
    preamble = [line for k, (_, line) in enumerate(before) if not names or k not in {place, *rows_of_units}]
    facts = {key: fact for said in described if isinstance(said, dict) for key, fact in said.items()}
    sample = Sample(layout, full, units, by_name and full == names, table.rows, facts or _facts(preamble))
    return _apart(sample, _forms(table, full), table.lines)


def _apart(sample: Sample, forms: tuple[str, ...], lines: Sequence[int]) -> Sample:
    """The same with each number of its cells in one of its own."""
    if not forms:
        return sample
    layout = replace(sample.layout, cells=forms)
    for name, form in zip(sample.names, forms, strict=False):
        if re.fullmatch(r"\[\d+\]", form) and (part := taken_apart(name)).axis in {*"xyz"} and part.sensor:
            raise DecodeError(f"a row holds several samples of an axis: {excerpt(name)}. Write a row for each sample.")
    rows = [cells_apart(row, layout, i + 1) for i, row in zip(lines, sample.rows, strict=True)]
    width = Counter(map(len, rows)).most_common(1)[0][0]
    beside = ["" if form.startswith("[") else form for form in forms]
    stated = [unit or form for unit, form in zip((*sample.units, *[""] * len(forms)), beside, strict=False)]
    units = tuple(re.sub(r"\[\d+\]$", "", unit) for unit in names_apart(stated, forms))
    names = names_apart(sample.names, (*forms, *[""] * len(sample.names)))
    return replace(sample, layout=layout, names=names, units=units, rows=[row for row in rows if len(row) == width])


def _listed_above(lines: Sequence[str], names: Sequence[str], table: _SniffedTable) -> tuple[str, ...]:
    """Names that stand in a line each above a table, with or without a line of the unit below each; or nothing."""
    columns = len([*filter(None, names)]) or len(table.rows[0])
    lines = [line for line in lines if (table.separator.strip() or "\n") not in line]  # others are facts
    listed: dict[tuple[str, ...], float] = {}
    for step, count in product((2, 1), (columns, columns - 1)):
        above = lines[-step * count :] if len(lines) >= step * count else []
        named, units = above[::step], above[1::2] if step > 1 else []
        understood = (_known_names(named) + sum(map(is_unit, units))) / max(1, len(above))
        is_list = count > 1 and understood >= 0.5 and (understood > 0.5 or bool(units))
        beside = [f"{name} [{unit}]" for name, unit in zip(named, units, strict=True)] if units else named
        listed[*([*names[:1], "time"][:1] * (columns - count)), *beside] = understood * is_list
    return max(listed, key=lambda some: (listed[some], len(some))) if any(listed.values()) else ()


def _constant_words(rows: Sequence[Sequence[str]]) -> tuple[str, ...]:
    """Names in cells before those of numbers, which are the same in all rows; nothing where they are not known."""
    constant = [cells[0].strip() if len({*cells}) == 1 else "" for cells in zip(*rows, strict=True)]
    words = ["" if _is_number(word) else word for word in constant]
    names = ["", *(word if not below else "" for word, below in pairwise(words))]
    return tuple(names) if _known_names({*names}) > len("xyz") else ()


def _start_and_rate(lines: Sequence[str]) -> dict[str, str]:
    """Start (Unix time) and sampling rate where the first two lines hold one number each, once or in each column."""
    first = [set(re.split(r"[,;\s]+", line.strip(",; \t"))) for line in lines[:FEWEST]]
    if len(first) < FEWEST or len(first[0]) + len(first[1]) > 2 or len(first[2]) == 1:
        return {}
    start, rate = (_value(cells.pop(), ".") for cells in first[:2])
    plausible = CENTURY[0] < start < CENTURY[1] and 0.0 < rate < CENTURY[0]
    return {"unix start": repr(start), "rate": f"{rate:g} Hz"} if plausible else {}


def _under(sensors: Sequence[str], axes: tuple[str, ...]) -> tuple[str, ...]:
    """Names of axes with their sensors, each of which stands in a row above its first axis; as they are otherwise."""
    bare = [bool(taken_apart(f"q {axis}").axis) and len(axis.strip()) == 1 for axis in axes]
    if len(sensors) != len(axes) or sum(bare) < len("xyz") or any(map(_is_number, sensors)):
        return axes
    names, above = [], ""
    for sensor, axis, is_bare in zip(sensors, axes, bare, strict=True):
        above = sensor.strip() or above
        names.append(f"{above} {axis}" if is_bare else axis or sensor)
    return tuple(names)


def _facts(lines: Sequence[str]) -> dict[str, str]:
    """What lines of keys and values say, as ``OutputRate:,60Hz`` and ``tscale,0.004``, and keys above numbers."""
    facts: dict[str, str] = {}
    for keys, below in pairwise(re.split(r"[,;\t]+", line.strip("#%/,;\t ")) for line in lines):
        if len(keys) == len(below) and all(map(_is_number, below)) and not any(map(_is_number, keys)):
            facts |= zip((key.strip().lower() for key in keys), below, strict=True)
    for line in lines:
        match = re.match(r"\W*([\w .()\[\]/-]+?)\s*[:=,]+[\s,]*(.*)", line.lstrip("#%/ ").strip())
        key, value = (match[1], match[2]) if match else (line.strip(), "")
        facts.setdefault(key.strip().lower(), re.sub(r"[,;\s]+", " ", value).strip())
    return facts


def _in_json(line: str) -> "list[list[str] | dict[str, str]]":
    """Lists of words, and facts, in a line of JSON that stands before a table."""
    if "{" not in line:
        return []
    try:
        flat = flat_cells("", json.loads(line.lstrip("#%/ ")))
    except (ValueError, DecodeError):
        return []
    lists: dict[str, list[str]] = {}
    for key, word in flat.items():
        lists.setdefault(re.sub(r"\[\d+\]$", "", key), []).append(word)
    return [*lists.values(), {key.rpartition(".")[2].lower(): word for key, word in flat.items() if key in lists}]


def _known_names(names: Iterable[str]) -> int:
    """How many names say a sensor, an axis or time."""
    parts = map(taken_apart, names)
    return sum(bool(part.axis in {*"xyzw"} or part.sensor or part.by_unit or part.is_time) for part in parts)


def _names(cells: Sequence[str], table: _SniffedTable) -> tuple[str, ...]:
    """Names of columns in a row before a table, moved by one where the columns that rise as time does say so."""
    names, width = tuple(_PRINTED.sub(r"\1", cell.strip()) for cell in cells), len(table.rows[0])
    short = width - len(names)
    if short == 1 and is_clocklike(table.rows[0][0]) and re.fullmatch(r" *(\d{3}|\d{6}) *", table.rows[0][1]):
        names, short = (names[0], "", *names[1:]), 0  # a comma stands before the parts of a second
    words = [name for name in names if re.search(r"[^\W\d]", name) and not _is_number(name)]
    may_miss = table.separator != " " or _is_number(table.rows[0][0])  # blanks may also part dates from clock times
    if abs(short) > may_miss or len(names) < 2 or 2 * len(words) < len([*filter(None, names)]):
        return ()
    if not short or not names[-1] or not any(row[-1].strip() for row in table.rows):
        return names
    parts = [taken_apart(name) for name in names[: len("xyz")]]
    clocks = {i for i, part in enumerate(parts) if part.is_time or part.is_counter}
    others = {i for i, part in enumerate(parts) if part.sensor or (part.axis and not part.base)}
    rising = {i for i in range(min(len("xyz"), width)) if _rises([row[i] for row in table.rows], table.decimal)}
    named = [moved for moved in (0, short) if {i + moved for i in clocks if i + moved >= 0} <= rising]
    named = [moved for moved in named if not {i + moved for i in others} & rising]
    first = {row[0].strip() for row in table.rows}
    named = [1] if short == len(first) == 1 and not _is_number(*first) else named  # a word before each row
    moved = named[0] if len(named) == 1 else -1 if short < 0 and _TITLE.fullmatch(names[0]) else None
    return {0: names, 1: ("", *names), -1: names[1:], None: ()}[moved]


_PRINTED: Final = re.compile(r'^.*%\w+\((\w+)\)"?')  # a name in its form, as 3-Space sensors write: %float(RawGyroX)
_TITLE: Final = re.compile(r"\W*(headers?|names?|columns?|fields?|channels?)\W*", re.IGNORECASE)


def _rises(cells: Sequence[str], decimal: str) -> bool:
    """Whether cells are clock times, or numbers that increase from row to row."""
    return all(map(is_clocklike, cells)) or rises(np.array([_value(cell.strip(), decimal) for cell in cells]))


def rises(numbers: Floats) -> bool:
    """Whether numbers go on as time does: they rise in most steps, however often they repeat or begin again."""
    finite = numbers[np.isfinite(numbers)]
    steps = np.diff(finite)
    is_whole = finite.size > (1.0 - LEFT_OUT_MOST) * numbers.size
    return bool(is_whole and np.sum(steps > 0.0) > 3.0 * np.sum(steps < 0.0))


def _are_units(cells: Sequence[str]) -> bool:
    """Whether a row is one of units: two known ones at least, and as many as there are other words; blanks are none."""
    words = [cell.strip() for cell in cells if cell.strip()]
    units = [word for word in words if _UNIT_CELL.fullmatch(word) or is_unit(word)]
    return len(units) > 1 and 2 * len(units) >= len(words) and not any(is_clocklike(w) or _is_number(w) for w in words)


def _missing(rows: Sequence[Sequence[str]]) -> tuple[str, ...]:
    counts = [Counter(cell.strip() for cell in column) for column in zip(*rows, strict=False)]
    said = [(column, sum(n for cell, n in column.items() if re.search(r"\d", cell))) for column in counts]
    markers = {
        cell
        for column, numbers in said
        for cell, n in column.items()
        if cell in MISSING or (1 < n < numbers and len(cell) <= len("undefined") and not re.search(r"\d", cell))
    }
    for column in counts:  # nines alone that are more than twice as large as all others stand for none
        nines = [*filter(_NINES.fullmatch, column)]
        values = {other: abs(_value(other, "," if "," in other else ".")) for other in column} if nines else {}
        for cell in nines:
            others = [value for other, value in values.items() if other != cell and np.isfinite(value)]
            markers |= {cell} if len(others) >= FEWEST and values[cell] > 2.0 * max(others) else set()
    return tuple(dict.fromkeys((*TextLayout(separator=",").missing, *sorted(markers))))


_NINES: Final = re.compile(r"[-+]?9{3,}([.,]9*|[.,]0*)?|[-+]?99[.,]99+")
