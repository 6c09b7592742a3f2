"""The vocabulary of flags."""

import numpy as np

from plumbob.core import flags

BITS = {name: value for name, value in vars(flags).items() if name.isupper() and name != "MEANING"}


def test_each_flag_is_one_bit_of_32_and_has_its_name_and_a_meaning():
    assert sorted(BITS.values()) == sorted(flags.MEANING)
    assert len(set(BITS.values())) == len(BITS)
    for name, value in BITS.items():
        assert value.bit_count() == 1
        assert value < 2**32
        assert flags.MEANING[value][0] == name.lower().replace("_", "-")
        assert flags.MEANING[value][1]
    # Bits never move: recordings on disk hold these numbers, and a new flag takes a new bit.
    assert [flags.MEANING[1 << i][0] for i in range(16)] == [
        "gyr-absent", "acc-absent", "mag-absent", "gyr-clipped", "acc-clipped", "mag-clipped",
        "gyr-invalid", "acc-invalid", "mag-invalid", "gap", "time-fault", "acc-gated", "mag-gated", "gyr-held",
        "not-converged", "heading-free",
    ]  # fmt: skip
    assert (flags.names(0), flags.names(flags.GAP | flags.GYR_ABSENT)) == ((), ("gyr-absent", "gap"))
    assert len(flags.names(0xFFFF)) == 16
    words = np.array([flags.GAP, flags.GAP | flags.GYR_ABSENT, 0], dtype=np.uint32)
    assert (flags.counts(words), flags.counts(words[2:])) == ({"gyr-absent": 1, "gap": 2}, {})
