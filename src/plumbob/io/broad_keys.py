"""What a BROAD trial must hold, in whichever container, checked before its numbers are read."""

from collections.abc import Iterable
from typing import Final

from plumbob.errors import DecodeError

SHAPES: Final[dict[str, tuple[int, ...]]] = {
    "imu_gyr": (3,),
    "imu_acc": (3,),
    "imu_mag": (3,),
    "opt_quat": (4,),
    "movement": (),
}
"""Shape of one row of each array; `sampling_rate` is a single number besides."""

RATE: Final = "sampling_rate"
MAX_ROWS: Final = 1_000_000
"""Rows beyond which a file is refused: the longest trial has 60 000, and a container can claim any number."""


def require_keys(found: Iterable[str]) -> None:
    """Refuse a container without the keys of a trial."""
    missing = [key for key in (*SHAPES, RATE) if key not in set(found)]
    if missing:
        raise DecodeError(
            f"it is no BROAD trial: {', '.join(missing)} missing; export other data as CSV and describe that with a "
            "profile."
        )


def require_shapes(shapes: dict[str, tuple[int, ...]]) -> None:
    """Refuse arrays that do not belong together, or claim too many rows."""
    rows = max(shapes["imu_gyr"][:1], default=0)
    if not 1 <= rows <= MAX_ROWS:
        raise DecodeError(f"imu_gyr claims {rows} rows, but a trial has 1 to {MAX_ROWS}.")
    for key, row in SHAPES.items():
        if shapes[key] != (rows, *row):
            raise DecodeError(f"{key} must have shape {(rows, *row)}, but it has {shapes[key]}.")
