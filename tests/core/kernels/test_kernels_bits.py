"""Every kernel in C gives the bits of the Python that it is made of."""

import pytest

from plumbob.core import kernels
from tests.helpers import in_the_other_mode, is_plain

pytestmark = pytest.mark.skipif(is_plain(), reason="there is no C here")

LEAST = 0.85  # the others are compared as whole runs by the tests of their rooms


def test_c_gives_the_bits_of_python():
    made = "from tests.helpers.kernel_bits import everything; given = everything()"
    found = in_the_other_mode(made)
    assert [line for _, differ in found.values() for line in differ] == []
    counts = {key: count for some, _ in found.values() for key, count in some.items()}
    assert all(hasattr(kernels.extension(), key) for key in counts)
    never = [key for key, count in counts.items() if not count]
    assert len(never) <= (1.0 - LEAST) * len(counts), never
