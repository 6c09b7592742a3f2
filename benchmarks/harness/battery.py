"""Group F9: what a contender makes of odd arguments, given as a sample or to its constructor."""

import math
import subprocess
import sys
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, Final

import numpy as np

from benchmarks.harness.contender import Construction, Contender, Running, is_clear
from benchmarks.harness.fault_scene import USUAL, Row, record
from plumbob.core.check import Floats
from plumbob.core.errors import ParameterError

VECTOR: Final = np.array([0.5, -1.25, 9.75])

"""m/s²; half-precision numbers hold it exactly, so that every way to write it must give the same bits."""

WHOLE: Final = np.array([1.0, -2.0, 9.0])

ABSENT: Final = np.full(3, math.nan)


@dataclass(frozen=True, slots=True)
class ApiCase:
    """One object.

    Attributes
    ----------
    name : str
        As in the tables.
    given : object
        What is handed over in place of a float64 array of shape (3,).
    means : ndarray (3,) or None
        The numbers that it stands for; None where it cannot mean three numbers.
    """

    name: str
    given: Any
    means: Floats | None


def _read_only() -> Floats:
    array = VECTOR.copy()
    array.flags.writeable = False
    return array


def _shapes() -> list[ApiCase]:
    return [
        ApiCase("shape (0,)", np.empty(0), None),
        ApiCase("shape (2,)", VECTOR[:2].copy(), None),
        ApiCase("shape (4,)", np.append(VECTOR, 1.0), None),
        ApiCase("shape (1, 3)", VECTOR[np.newaxis].copy(), None),
        ApiCase("shape (3, 1)", VECTOR[:, np.newaxis].copy(), None),
        ApiCase("numpy matrix", np.ones((1, 3)).view(np.matrix), None),
        ApiCase("nested list", [VECTOR.tolist()], None),
        ApiCase("empty list", [], None),
    ]


def _layouts() -> list[ApiCase]:
    spread = np.zeros(6)
    spread[::2] = VECTOR
    return [
        ApiCase("negative stride", VECTOR[::-1].copy()[::-1], VECTOR),
        ApiCase("every second of six", spread[::2], VECTOR),
        ApiCase("column of a Fortran table", np.asfortranarray(np.column_stack([VECTOR, VECTOR]))[:, 0], VECTOR),
        ApiCase("read-only", _read_only(), VECTOR),
        ApiCase("memoryview", VECTOR.copy().data, VECTOR),
        ApiCase("list", VECTOR.tolist(), VECTOR),
        ApiCase("tuple", tuple(VECTOR.tolist()), VECTOR),
    ]


def _types() -> list[ApiCase]:
    return [
        ApiCase("int64", WHOLE.astype(np.int64), WHOLE),
        ApiCase("float32", VECTOR.astype(np.float32), VECTOR),
        ApiCase("float16", VECTOR.astype(np.float16), VECTOR),
        ApiCase("big-endian", VECTOR.astype(">f8"), VECTOR),
        ApiCase("object", VECTOR.astype(object), VECTOR),
        ApiCase("complex", VECTOR.astype(complex), None),
        ApiCase("bool", np.array([False, False, True]), None),
        ApiCase("datetime64", np.arange(3).astype("datetime64[s]"), None),
        ApiCase("structured", np.zeros(3, dtype=[("x", "f8"), ("y", "f8")]), None),
        ApiCase("masked", np.ma.MaskedArray(VECTOR, mask=[False, True, False]), None),
        ApiCase("list of str", [str(v) for v in VECTOR.tolist()], None),
        ApiCase("str", "0.5 -1.25 9.75", None),
        ApiCase("NaN", math.nan, None),
        ApiCase("None", None, None),
    ]


API_CASES: Final[tuple[ApiCase, ...]] = (*_shapes(), *_layouts(), *_types())

_WARM, _AFTER = 10, 10  # samples before and after the odd one

_TRIED = 100  # samples that a contender must get through after an odd construction

_SECONDS = 60.0  # for a construction in a process of its own


class ApiVerdict(StrEnum):
    """What became of an argument."""

    ACCEPTED = "accepted"
    CLEAR_ERROR = "clear error"
    SILENT = "accepted silently"
    UNCLEAR = "unclear error"
    KILLED = "process killed"

    @property
    def good(self) -> bool:
        """True where the caller got what was meant, or was told."""
        return self in (ApiVerdict.ACCEPTED, ApiVerdict.CLEAR_ERROR)


@dataclass(frozen=True, slots=True)
class Battery:
    """Verdict by argument."""

    verdicts: dict[str, ApiVerdict]

    def count(self, verdict: ApiVerdict) -> int:
        """How many ended so."""
        return sum(v is verdict for v in self.verdicts.values())

    @property
    def good(self) -> int:
        """How many were accepted and right, or refused clearly."""
        return sum(v.good for v in self.verdicts.values())

    def summary(self) -> dict[str, str]:
        """Ready for JSON."""
        return {name: str(verdict) for name, verdict in self.verdicts.items()}


def run_battery(contender: Contender) -> Battery:
    """Give a contender every odd argument."""
    with contender.quiet():
        objects = {f"sample: {case.name}": _try_object(contender, case) for case in API_CASES}
        built = {f"construct: {c.name}": _try_construction(contender, c) for c in contender.constructions()}
    return Battery(objects | built)


def _try_object(contender: Contender, case: ApiCase) -> ApiVerdict:
    """An accepted object must leave the same bits as what it means, a refused one those of a sample never given."""
    means = ABSENT if case.given is None and contender.none_is_absent else case.means
    try:
        found = _after(contender, [case.given])
    except _RefusedError as refused:
        unchanged = refused.later is not None and _same(refused.later, _after(contender, []))
        return ApiVerdict.CLEAR_ERROR if is_clear(refused.error) and unchanged else ApiVerdict.UNCLEAR
    if means is None or not _same(found, _after(contender, [means.copy()])):
        return ApiVerdict.SILENT
    return ApiVerdict.ACCEPTED


class _RefusedError(Exception):
    """An object was refused with `error`; `later` is the attitude after more good samples, None if they failed too."""

    def __init__(self, error: Exception, later: Floats | None) -> None:
        super().__init__(str(error))
        self.error, self.later = error, later


def _after(contender: Contender, odd: list[Any]) -> Floats:
    """Attitude after good samples, an odd one or none, and good ones again."""
    running = contender.start()
    rows = list(record(USUAL, _WARM + 1 + _AFTER).rows())
    for row in rows[:_WARM]:
        running.take(row)
    _, gyr, _, mag, _ = rows[_WARM]
    for given in odd:
        try:
            running.give(gyr, given, mag)
        except Exception as error:
            raise _RefusedError(error, _try_end(running, rows[_WARM + 1 :])) from error
    return _end(running, rows[_WARM + 1 :])


def _end(running: Running, rows: list[Row]) -> Floats:
    for row in rows:
        running.take(row)
    return np.array(running.attitude(), dtype=np.float64)


def _try_end(running: Running, rows: list[Row]) -> Floats | None:
    try:
        return _end(running, rows)
    except Exception:
        return None


def _same(a: Floats, b: Floats) -> bool:
    return np.array_equal(a, b, equal_nan=True)


def _try_construction(contender: Contender, construction: Construction) -> ApiVerdict:
    if contender.can_kill:
        return _in_a_process(contender.name, construction.name)
    return construct(contender, construction)


def construct(contender: Contender, construction: Construction) -> ApiVerdict:
    """Build, and feed good samples; what cannot be meant must be refused, and what can must work."""
    try:
        running = construction.make()
    except Exception as error:
        return ApiVerdict.CLEAR_ERROR if is_clear(error) else ApiVerdict.UNCLEAR
    if not construction.sensible:
        return ApiVerdict.SILENT
    end = _try_end(running, list(record(USUAL, _TRIED).rows()))
    works = end is not None and bool(np.isfinite(end).all())
    return ApiVerdict.ACCEPTED if works else ApiVerdict.SILENT


def _in_a_process(contender: str, construction: str) -> ApiVerdict:
    code = f"from benchmarks.harness.battery import child; child({contender!r}, {construction!r})"
    words = [sys.executable, "-c", code]
    try:
        done = subprocess.run(words, capture_output=True, text=True, check=False, timeout=_SECONDS)
    except subprocess.TimeoutExpired:
        return ApiVerdict.UNCLEAR
    if done.returncode not in (0, 1):  # a failed assertion in C; Python itself would leave with 1
        return ApiVerdict.KILLED
    return ApiVerdict(done.stdout.strip()) if done.returncode == 0 else ApiVerdict.UNCLEAR


def child(contender: str, construction: str) -> None:
    """Print the verdict on one construction of a peer; this process may die of it."""
    from benchmarks.harness.peers import peers

    for peer in peers(contender.partition(".")[0])[0]:
        for one in peer.constructions():
            if (peer.name, one.name) == (contender, construction):
                sys.stdout.write(construct(peer, one))
                return
    raise ParameterError(f"there is no construction '{construction}' of '{contender}'.")
