"""What names of columns say, in the words of loggers that are in use."""

from email.utils import parsedate_to_datetime

import pytest

from plumbob.core.units import Quantity
from plumbob.files.column_names import taken_apart
from plumbob.files.columns import is_stamp, stamps_ns
from tests.helpers import beside

# name, cell of a row of units, sensor, axis, unit by our name, whose; of what is no triad only what it is
NAMES = [[*map(str.strip, line.split("|"))][:5] for line in beside(__file__, "column_names.txt").splitlines()]


@pytest.mark.parametrize("row", NAMES, ids=" ".join)
def test_a_name_says_sensor_axis_and_unit_or_time_or_a_counter(row):
    name, unit, sensor, *more = row
    column = taken_apart(name, unit)
    kind = {"gyr": Quantity.RATE, "acc": Quantity.ACCELERATION, "mag": Quantity.FIELD}.get(sensor)
    assert (column.is_time, column.is_counter) == (sensor == "time", sensor == "counter")
    assert column.sensor == sensor or column.is_time or column.is_counter
    assert more in ([], [column.axis, "" if kind is None else column.unit_as(kind)])


@pytest.mark.parametrize("form", ["q{}", "Quat_{}", "orientation.{}", "quaternion[{}]", "field.orientation.{}"])
def test_components_of_a_quaternion(form):
    assert "".join(taken_apart(form.format(letter)).quaternion for letter in "wxyz") == "wxyz"


def test_dates_in_words_are_the_moments_that_the_library_reads():
    """As C's asctime, Java's Date, ``date`` and e-mail write 1640207386 s since 1970, read by `email.utils` too."""
    moment = "Wed, 22 Dec 2021 21:09:46 +0000"
    forms = ["Wed Dec 22 21:09:46 2021", "Wed Dec 22 21:09:46 UTC 2021", "Thu Dec 23 00:09:46 GMT+03:00 2021", moment,
             "Wed, 22 Dec 2021 21:09:46 GMT", "Dec 22, 2021, 9:09:46 PM", "Dec 22 2021 21:09:46"]  # fmt: skip
    utc = 1_000_000_000 * int(parsedate_to_datetime(moment).timestamp())
    assert {stamps_ns([form], None)[0][0] for form in forms} == {utc}
    assert stamps_ns(["13. März 2024 12:30:45 CET", "14. März 2024 06:30:45 EST"], None) == (
        [1710329445 * 10**9, 1710415845 * 10**9],
        True,
    )
    assert stamps_ns(["5/13/2024 12:30:45", "5/12/2024 12:30:45"], 0)[0] == [1715603445 * 10**9, 1715517045 * 10**9]
    assert not any(map(is_stamp, ("Wed Foo 22 21:09:46 2021", "walking")))
