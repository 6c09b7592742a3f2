"""Per-sample flags: one vocabulary for decoders, recordings, filters, reports and the live view.

Plain integers, because kernels, Parquet columns and C structs all hold them. A flag never replaces a value: nothing is
lost, and who reads the sample decides.
"""

import typing
from typing import Final

if typing.TYPE_CHECKING:
    from collections.abc import Iterable

    import numpy as np
    from numpy.typing import NDArray

GYR_ABSENT: Final = 1 << 0
ACC_ABSENT: Final = 1 << 1
MAG_ABSENT: Final = 1 << 2
GYR_CLIPPED: Final = 1 << 3
ACC_CLIPPED: Final = 1 << 4
MAG_CLIPPED: Final = 1 << 5
GYR_INVALID: Final = 1 << 6
ACC_INVALID: Final = 1 << 7
MAG_INVALID: Final = 1 << 8
GAP: Final = 1 << 9
TIME_FAULT: Final = 1 << 10
ACC_GATED: Final = 1 << 11
MAG_GATED: Final = 1 << 12
GYR_HELD: Final = 1 << 13
NOT_CONVERGED: Final = 1 << 14
HEADING_FREE: Final = 1 << 15
GYR_STUCK: Final = 1 << 16
ACC_STUCK: Final = 1 << 17
MAG_STUCK: Final = 1 << 18
AT_REST: Final = 1 << 19
INCONSISTENT: Final = 1 << 20
FIELD_UNKNOWN: Final = 1 << 21
UNIT_SUSPECT: Final = 1 << 22
UNIT_EXCLUDED: Final = 1 << 23
CANNOT_ISOLATE: Final = 1 << 24

MEANING: Final[dict[int, tuple[str, str]]] = {
    GYR_ABSENT: ("gyr-absent", "no gyroscope value in this sample"),
    ACC_ABSENT: ("acc-absent", "no accelerometer value in this sample"),
    MAG_ABSENT: ("mag-absent", "no magnetometer value in this sample"),
    GYR_CLIPPED: ("gyr-clipped", "a gyroscope axis is at the end of its range"),
    ACC_CLIPPED: ("acc-clipped", "an accelerometer axis is at the end of its range"),
    MAG_CLIPPED: ("mag-clipped", "a magnetometer axis is at the end of its range"),
    GYR_INVALID: ("gyr-invalid", "a gyroscope value is infinite or impossible"),
    ACC_INVALID: ("acc-invalid", "an accelerometer value is infinite or impossible"),
    MAG_INVALID: ("mag-invalid", "a magnetometer value is infinite or impossible"),
    GAP: ("gap", "samples are missing before this one"),
    TIME_FAULT: ("time-fault", "the time step is zero, negative or not finite; the sample was not used"),
    ACC_GATED: ("acc-gated", "the filter did not use the accelerometer"),
    MAG_GATED: ("mag-gated", "the filter did not use the magnetometer"),
    GYR_HELD: ("gyr-held", "the filter turned on with the last good rate, or with none"),
    NOT_CONVERGED: ("not-converged", "nothing has shown yet, or not yet again, that the attitude is right"),
    GYR_STUCK: ("gyr-stuck", "the gyroscope, or an axis of it, says the same for longer than noise allows"),
    ACC_STUCK: ("acc-stuck", "the accelerometer, or an axis of it, says the same for longer than noise allows"),
    MAG_STUCK: ("mag-stuck", "the magnetometer, or an axis of it, says the same for longer than noise allows"),
    AT_REST: ("at-rest", "the filter takes the unit to be at rest"),
    INCONSISTENT: ("inconsistent", "the sensors contradict each other more than their noise explains"),
    HEADING_FREE: ("heading-free", "no magnetometer has set the heading; it counts from where it began"),
    FIELD_UNKNOWN: ("field-unknown", "the unit has not turned in the field that gives the heading, or none was found"),
    UNIT_SUSPECT: ("unit-suspect", "a unit of the array deviates from the others by more than noise explains"),
    UNIT_EXCLUDED: ("unit-excluded", "a unit of the array is left out: it is dead, or it contradicts the others"),
    CANNOT_ISOLATE: ("cannot-isolate", "units of the array contradict each other, and nothing says which one is wrong"),
}


def names(flags: int) -> tuple[str, ...]:
    """Names of the flags that are set, in order of their bits."""
    return tuple(name for bit, (name, _) in MEANING.items() if flags & bit)


def of_names(names: "Iterable[str]") -> int:
    """Flags with these names set; KeyError, of the name, where one is unknown."""
    bits = {name: bit for bit, (name, _) in MEANING.items()}
    return sum(bits[name] for name in dict.fromkeys(names))


def counts(words: "NDArray[np.uint32]") -> dict[str, int]:
    """How many samples carry each flag that occurs, by name, in order of the bits."""
    present = int(words.max(initial=0)).bit_length()
    tally = {name: int(((words & bit) != 0).sum()) for bit, (name, _) in MEANING.items() if bit >> present == 0}
    return {name: count for name, count in tally.items() if count}
