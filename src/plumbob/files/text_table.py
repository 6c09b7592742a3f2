"""Numbers of a text file: fast with Arrow, and line by line where Arrow refuses, so that an error names its cell."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from decimal import Decimal, InvalidOperation
from itertools import islice
from typing import Any, Final

import numpy as np

from plumbob.core.check import Floats
from plumbob.core.errors import DecodeError, excerpt
from plumbob.files.arrow import column_numbers
from plumbob.files.columns import FORM, is_clocklike
from plumbob.files.profile import ColumnRef, TextLayout
from plumbob.files.text_head import NumericBody, decode, find_head, is_idle, split_row

_EXACT = (30, 9)  # digits, and digits after the point, of a decimal that keeps nanoseconds since 1970
_LARGEST: Final = Decimal(10) ** 20
_Read = tuple[dict[ColumnRef, Floats], dict[ColumnRef, list[str]], Decimal]


@dataclass(frozen=True, slots=True)
class TextTable:
    """Columns of numbers.

    Attributes
    ----------
    columns : dict
        A vector (N,) for each column asked for; NaN where missing.
    zero : Decimal
        What was taken from the exact column, so that its differences keep every digit; 0 without one.
    rows : int
        N.
    notes : tuple of str
        What was left out.
    texts : dict
        Cells of the columns that are not numbers.
    line_of : callable
        Number of the line of a row that counts from 0.
    """

    columns: dict[ColumnRef, Floats]
    zero: Decimal
    rows: int
    notes: tuple[str, ...]
    texts: dict[ColumnRef, list[str]]
    line_of: Callable[[int], int]


@dataclass(frozen=True, slots=True)
class _Wanted:
    """Places of the columns among the cells of a row, and how they are read."""

    places: dict[ColumnRef, int]
    exact: ColumnRef | None
    texts: Sequence[ColumnRef]


def read_table(
    raw: bytes,
    layout: TextLayout,
    refs: Sequence[ColumnRef],
    exact: ColumnRef | None = None,
    texts: Sequence[ColumnRef] = (),
) -> TextTable:
    """Read columns of a text file.

    Parameters
    ----------
    raw : bytes
        The file.
    layout : TextLayout
        How it is laid out.
    refs : sequence of int or str
        The columns.
    exact : int or str, optional
        One of them that is read as decimal numbers and returned less its first value.
    texts : sequence of int or str
        Those of them that are not numbers.

    Raises
    ------
    DecodeError
        If the layout does not fit, or a cell is not a number; the message names line, column and text.
    """
    text = decode(raw, layout.encoding)
    head = find_head(text, layout)
    body = NumericBody(raw, text, head.start, text.rfind("\n") + 1, head.line)
    line, first = next(((line, row) for line, row in body.rows() if not is_idle(row, layout.comment)), (0, ""))
    if not first:
        raise DecodeError("there is no whole row of numbers; check the profile's [header].")
    width = len(split_row(first, layout.separator, line))
    places = {ref: column_index(ref, head.names, width, layout) for ref in refs}
    _refuse_shared(places)
    wanted = _Wanted(places, exact, texts)
    columns, words, zero = _fast(body, layout, width, wanted) or _slow(body, layout, width, wanted)
    rows = len(next(iter((columns | words).values())))
    _refuse_rows(rows, layout.rows)
    return TextTable(columns, zero, rows, body.remark(), words, lambda row: _line_number(body, layout, row))


def _line_number(body: NumericBody, layout: TextLayout, row: int) -> int:
    return next(islice((line for line, text in body.rows() if not is_idle(text, layout.comment)), row, None))


def _refuse_rows(rows: int, declared: int | None) -> None:
    if declared is not None and rows != declared:
        raise DecodeError(
            f"there are {rows} whole rows of numbers, but the profile says rows = {declared}; the file is cut or "
            "another one. If it is meant so, correct the profile."
        )


def column_index(ref: ColumnRef, names: tuple[str, ...], width: int, layout: TextLayout) -> int:
    """Index of a column among the `width` cells of a row; DecodeError where it is not one of them."""
    if isinstance(ref, str):
        if names.count(ref) != 1:
            how = "twice or more" if ref in names else "nowhere"
            listed = excerpt(", ".join(names), 200) if names else "none, as header.names = false"
            raise DecodeError(f"the column {excerpt(ref)} is {how} in the row of names ({listed}); use its number.")
        ref = names.index(ref) + 1
    if ref > width:
        raise DecodeError(
            f"column {ref} is declared, but a row has {width} cells with the separator {layout.separator!r}; check "
            "separator and [header] in the profile."
        )
    return ref - 1


def _refuse_shared(places: dict[ColumnRef, int]) -> None:
    for ref, place in places.items():
        other = next(r for r, p in places.items() if p == place)
        if other != ref:
            raise DecodeError(f"{other!r} and {ref!r} are the same column; each column has one meaning.")


def _fast(body: NumericBody, layout: TextLayout, width: int, wanted: _Wanted) -> _Read | None:
    import pyarrow as pa
    from pyarrow import csv

    names = [str(i) for i in range(width)]
    types: dict[str, Any] = {str(p): pa.float64() for p in wanted.places.values()}
    types |= {str(wanted.places[ref]): pa.string() for ref in wanted.texts}
    if wanted.exact is not None:
        types[str(wanted.places[wanted.exact])] = pa.decimal128(*_EXACT)
    try:
        source: Any = pa.BufferReader(pa.py_buffer(body.packed(layout)))
        table = csv.read_csv(
            source,
            read_options=csv.ReadOptions(column_names=names),
            parse_options=csv.ParseOptions(delimiter=layout.separator),
            convert_options=csv.ConvertOptions(
                column_types=types,
                include_columns=list(types),
                null_values=list(layout.missing),
                decimal_point=layout.decimal,
            ),
        )
    except (pa.ArrowException, OSError, ValueError):
        return None
    arrays: dict[ColumnRef, Any] = {ref: table.column(str(p)) for ref, p in wanted.places.items()}
    texts = {ref: arrays.pop(ref).to_pylist() for ref in wanted.texts}
    numbers = _collected(arrays, wanted.exact)
    return None if numbers is None else (numbers[0], texts, numbers[1])


def _collected(arrays: dict[ColumnRef, Any], exact: ColumnRef | None) -> tuple[dict[ColumnRef, Floats], Decimal] | None:
    import pyarrow as pa
    import pyarrow.compute as pc

    zero = Decimal(0)
    if exact is not None:
        first = arrays[exact][0]
        if not first.is_valid:
            return None
        zero = first.as_py()
        arrays = arrays | {exact: pc.subtract(arrays[exact], first).cast(pa.float64())}
    return {ref: np.asarray(column_numbers(column), dtype=np.float64) for ref, column in arrays.items()}, zero


def _slow(body: NumericBody, layout: TextLayout, width: int, wanted: _Wanted) -> _Read:
    cells: dict[ColumnRef, list[float]] = {ref: [] for ref in wanted.places if ref not in wanted.texts}
    texts: dict[ColumnRef, list[str]] = {ref: [] for ref in wanted.texts}
    stamps: list[Decimal] = []
    for line, row in body.rows():
        if is_idle(row, layout.comment):
            continue
        words = split_row(row, layout.separator, line)
        if len(words) != width:
            raise DecodeError(
                f"line {line} has {len(words)} cells, but the first row of numbers has {width}: {excerpt(row)}; "
                "correct the line, or the separator in the profile."
            )
        for ref, place in wanted.places.items():
            if ref in texts:
                texts[ref].append(words[place])
            elif ref == wanted.exact:
                stamps.append(_decimal(words[place], line, ref, layout))
            else:
                cells[ref].append(_number(words[place], line, ref, layout))
    zero = stamps[0] if stamps else Decimal(0)
    if wanted.exact is not None:
        cells[wanted.exact] = [float(stamp - zero) for stamp in stamps]
    return {ref: np.array(values, dtype=np.float64) for ref, values in cells.items()}, texts, zero


def _number(cell: str, line: int, ref: ColumnRef, layout: TextLayout) -> float:
    if cell.strip() in layout.missing:
        return float("nan")
    try:
        return float(_plain(cell, layout))
    except ValueError:
        raise _no_number(cell, line, ref, layout) from None


def _decimal(cell: str, line: int, ref: ColumnRef, layout: TextLayout) -> Decimal:
    try:
        value = Decimal(_plain(cell, layout))
        if not abs(value) < _LARGEST:
            raise ValueError(cell)
    except (ValueError, InvalidOperation):
        raise _no_number(cell, line, ref, layout) from None
    return value


def _plain(cell: str, layout: TextLayout) -> str:
    """Number with a point; raises ValueError where Python would take what no logger means."""
    if "_" in cell or not cell.isascii() or (layout.decimal == "," and "." in cell):
        raise ValueError(cell)
    return cell.replace(",", ".") if layout.decimal == "," else cell


def _no_number(cell: str, line: int, ref: ColumnRef, layout: TextLayout) -> DecodeError:
    other = "," if layout.decimal == "." else "."
    if is_clocklike(cell):
        advice = f'it looks like a date or clock time: declare [time] format = "{FORM}" for the column of time'
    else:
        advice = (
            f"declare decimal = '{other}'" if other in cell else "correct it, or add it to 'missing' in the profile"
        )
    return DecodeError(
        f"line {line}, column {ref!r}: {excerpt(cell)} is not a number with decimal '{layout.decimal}'; {advice}."
    )
