"""One tree of errors."""

import inspect
import re

import pytest

from plumbob.core import errors

NO_VALUES = {errors.PlumbobError, errors.MissingExtraError, errors.LineError}
TREE = [c for _, c in inspect.getmembers(errors, inspect.isclass) if not issubclass(c, Warning)]


@pytest.mark.parametrize("error", TREE)
def test_all_descend_from_one_and_say_what_they_are(error):
    assert issubclass(error, errors.PlumbobError)
    assert re.match(r"[A-Z].*\.$", error.__doc__, re.DOTALL)


@pytest.mark.parametrize("error", [e for e in TREE if e not in NO_VALUES])
def test_bad_values_are_value_errors_too(error):
    """Who does not know this project catches ValueError."""
    assert issubclass(error, ValueError)


def test_a_line_that_cannot_be_opened_is_an_error_of_the_system():
    assert issubclass(errors.LineError, OSError)


def test_a_missing_extra_is_an_import_error():
    assert issubclass(errors.MissingExtraError, ImportError)
