"""A log in Flash: pages that are programmed, sectors that must be erased before, written round and round."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from plumbob.core.errors import ParameterError, ShapeError
from plumbob.core.text import FactsText
from plumbob.protocols.ring import BLANK

Bytes = NDArray[np.uint8]

YEAR_S: Final = 365.25 * 86400.0


class FlashLog(FactsText):
    """Ring of records in a NOR Flash chip, emulated to the byte; by default of 1 MiB, as Winbond's W25Q80.

    Records are gathered in memory until they fill a page, which is then programmed. With the last page of a sector the
    next sector is erased, so that a blank page is always ready and no call waits for an erasure; of a full ring that
    costs its oldest sector. No record lies across two pages: where one is torn, the others are sound. `erases` counts
    the wear of each sector; `lost` are `written` records that were erased again.
    """

    def __init__(self, *, size: int = 1 << 20, sector: int = 4096, page: int = 256, record: int = 32) -> None:
        if not (0 < record <= page <= sector and sector % page == 0 and size % sector == 0 and size >= 2 * sector):
            raise ParameterError(
                "a log needs records that fit a page, pages that fill a sector, and two sectors or more that fill the "
                f"chip, but they have {record}, {page}, {sector} and {size} bytes."
            )
        self.record, self.page = record, page
        self.per_page = page // record
        self.pages = sector // page
        self._cells: Bytes = np.full((size // page, page), BLANK, dtype=np.uint8)
        self._buffer = bytearray()
        self._next = 0
        self._held = np.zeros(size // sector, dtype=np.int64)
        self.erases: NDArray[np.int64] = np.zeros(size // sector, dtype=np.int64)
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
        return len(self._buffer) // self.record

    def life_years(self, rate: float = 20.0, cycles: int = 100_000) -> float:
        """Years until every sector was erased so often, at that many records per second."""
        return cycles * self.capacity / rate / YEAR_S

    def write(self, records: bytes | Bytes) -> None:
        """Take records: bytes one behind the other, or rows (N, record)."""
        data = records if isinstance(records, bytes) else np.asarray(records, dtype=np.uint8).tobytes()
        if len(data) % self.record:
            raise ShapeError(f"a log takes records of {self.record} bytes, but {len(data)} bytes are not a multiple.")
        self._buffer += data
        used = self.per_page * self.record
        waiting = np.frombuffer(bytes(self._buffer), dtype=np.uint8)
        rows = waiting[: waiting.size // used * used].reshape(-1, used)
        while len(rows):
            count = min(len(rows), self.pages - self._next % self.pages)
            self._cells[self._next : self._next + count, :used] = rows[:count]
            self._advance(count, count * self.per_page)
            rows = rows[count:]
        self._buffer = self._buffer[len(self._buffer) // used * used :]

    def cut(self, programmed: int) -> None:
        """Lose power when `programmed` bytes of what waits in memory are there; the rest is gone.

        The next start finds that the page is not blank, and goes on behind it.
        """
        torn = np.frombuffer(bytes(self._buffer[:programmed]), dtype=np.uint8)
        self._cells[self._next, : torn.size] = torn
        self._buffer = bytearray()
        if torn.size:
            self._advance(1, torn.size // self.record)

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
