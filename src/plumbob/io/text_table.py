"""Numbers of a text file: fast with Arrow, and line by line where Arrow refuses, so that an error names its cell."""

from collections.abc import Sequence
from dataclasses import dataclass
from decimal import Decimal, InvalidOperation
from typing import Any, Final

import numpy as np

from plumbob.check import Floats
from plumbob.errors import DecodeError, excerpt
from plumbob.io.profile import ColumnRef, Layout
from plumbob.io.text_body import Body
from plumbob.io.text_head import decode, find_head, is_idle, split_row

_EXACT = (30, 9)  # digits, and digits after the point, of a decimal that keeps nanoseconds since 1970
_LARGEST: Final = Decimal(10) ** 20


@dataclass(frozen=True, slots=True)
class Table:
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
    """

    columns: dict[ColumnRef, Floats]
    zero: Decimal
    rows: int
    notes: tuple[str, ...]


def read_table(raw: bytes, layout: Layout, refs: Sequence[ColumnRef], exact: ColumnRef | None = None) -> Table:
    """Read columns of a text file.

    Parameters
    ----------
    raw : bytes
        The file.
    layout : Layout
        How it is laid out.
    refs : sequence of int or str
        The columns.
    exact : int or str, optional
        One of them that is read as decimal numbers and returned less its first value.

    Raises
    ------
    DecodeError
        If the layout does not fit, or a cell is no number; the message names line, column and text.
    """
    text = decode(raw, layout.encoding)
    head = find_head(text, layout)
    body = Body(raw, text, head.start, text.rfind("\n") + 1, head.line)
    line, first = next(((line, row) for line, row in body.rows() if not is_idle(row, layout.comment)), (0, ""))
    if not first:
        raise DecodeError("there is no whole row of numbers; check the profile's [header].")
    width = len(split_row(first, layout.separator, line))
    places = {ref: place_of(ref, head.names, width, layout) for ref in refs}
    _refuse_shared(places)
    columns, zero = _fast(body, layout, width, places, exact) or _slow(body, layout, width, places, exact)
    rows = next(iter(columns.values())).size
    _refuse_rows(rows, layout.rows)
    return Table(columns, zero, rows, body.remark())


def _refuse_rows(found: int, declared: int | None) -> None:
    if declared is not None and found != declared:
        raise DecodeError(
            f"there are {found} whole rows of numbers, but the profile says rows = {declared}; the file is cut or "
            "another one. If it is meant so, correct the profile."
        )


def place_of(ref: ColumnRef, names: tuple[str, ...], width: int, layout: Layout) -> int:
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


def _fast(
    body: Body, layout: Layout, width: int, places: dict[ColumnRef, int], exact: ColumnRef | None
) -> tuple[dict[ColumnRef, Floats], Decimal] | None:
    import pyarrow as pa
    from pyarrow import csv

    names = [str(i) for i in range(width)]
    types = {str(p): pa.decimal128(*_EXACT) if ref == exact else pa.float64() for ref, p in places.items()}
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
    return _collected({ref: table.column(str(p)) for ref, p in places.items()}, exact)


def _collected(found: dict[ColumnRef, Any], exact: ColumnRef | None) -> tuple[dict[ColumnRef, Floats], Decimal] | None:
    import pyarrow as pa
    import pyarrow.compute as pc

    zero = Decimal(0)
    if exact is not None:
        first = found[exact][0]
        if not first.is_valid:
            return None
        zero = first.as_py()
        found = found | {exact: pc.subtract(found[exact], first).cast(pa.float64())}
    return {ref: np.asarray(column.to_numpy(), dtype=np.float64) for ref, column in found.items()}, zero


def _slow(
    body: Body, layout: Layout, width: int, places: dict[ColumnRef, int], exact: ColumnRef | None
) -> tuple[dict[ColumnRef, Floats], Decimal]:
    cells: dict[ColumnRef, list[float]] = {ref: [] for ref in places}
    stamps: list[Decimal] = []
    for line, row in body.rows():
        if is_idle(row, layout.comment):
            continue
        found = split_row(row, layout.separator, line)
        if len(found) != width:
            raise DecodeError(
                f"line {line} has {len(found)} cells, but the first row of numbers has {width}: {excerpt(row)}; "
                "correct the line, or the separator in the profile."
            )
        for ref, place in places.items():
            if ref == exact:
                stamps.append(_decimal(found[place], line, ref, layout))
            else:
                cells[ref].append(_number(found[place], line, ref, layout))
    zero = stamps[0] if stamps else Decimal(0)
    if exact is not None:
        cells[exact] = [float(stamp - zero) for stamp in stamps]
    return {ref: np.array(values, dtype=np.float64) for ref, values in cells.items()}, zero


def _number(cell: str, line: int, ref: ColumnRef, layout: Layout) -> float:
    if cell.strip() in layout.missing:
        return float("nan")
    try:
        return float(_plain(cell, layout))
    except ValueError:
        raise _no_number(cell, line, ref, layout) from None


def _decimal(cell: str, line: int, ref: ColumnRef, layout: Layout) -> Decimal:
    try:
        value = Decimal(_plain(cell, layout))
        if not abs(value) < _LARGEST:
            raise ValueError(cell)
    except (ValueError, InvalidOperation):
        raise _no_number(cell, line, ref, layout) from None
    return value


def _plain(cell: str, layout: Layout) -> str:
    """Number with a point; raises ValueError where Python would take what no logger means."""
    if "_" in cell or not cell.isascii() or (layout.decimal == "," and "." in cell):
        raise ValueError(cell)
    return cell.replace(",", ".") if layout.decimal == "," else cell


def _no_number(cell: str, line: int, ref: ColumnRef, layout: Layout) -> DecodeError:
    other = "," if layout.decimal == "." else "."
    advice = f"declare decimal = '{other}'" if other in cell else "correct it, or add it to 'missing' in the profile"
    return DecodeError(
        f"line {line}, column {ref!r}: {excerpt(cell)} is not a number with decimal '{layout.decimal}'; {advice}."
    )
