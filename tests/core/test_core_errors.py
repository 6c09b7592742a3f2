"""One tree of errors."""

import inspect
import re

import pytest

from plumbob.core import errors

NO_VALUES = {errors.PlumbobError: Exception, errors.MissingExtraError: ImportError, errors.LineError: OSError}
TREE = [
    c for _, c in inspect.getmembers(errors, inspect.isclass) if issubclass(c, Exception) and not issubclass(c, Warning)
]


@pytest.mark.parametrize("error", TREE)
def test_all_descend_from_one_say_what_they_are_and_are_one_of_pythons_own(error):
    """Who does not know this project catches ValueError."""
    assert issubclass(error, errors.PlumbobError) and issubclass(error, NO_VALUES.get(error, ValueError))
    assert re.match(r"[A-Z].*\.$", error.__doc__, re.DOTALL)
