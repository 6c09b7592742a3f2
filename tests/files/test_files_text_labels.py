"""Names of parts: a column beside the numbers, and tables of spans."""

import pytest

from plumbob.files import parse_profile, read
from plumbob.files.text import read_labels, read_spans
from tests.helpers.io_samples import refused

PROFILE = parse_profile(
    'separator = ","\ncomment = "#"\n[header]\nnames = true\n[time]\nrate = "100 Hz"\n'
    '[gyr]\ncolumns = ["x", "y", "z"]\nunit = "rad/s"\n'
)
TEXT = 'part,x,y,z\nrest,0,0,0\n# a remark\n"turn, slow",1,0,0\n,2,0,0\nrest,3,0,0\ncut,4'


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text(TEXT)
    return path


def test_each_sample_has_the_label_of_its_row(file):
    labels = read_labels(file, "part", PROFILE)
    assert labels == ["rest", "turn, slow", "", "rest"]  # the comment is no row, the cut last line no sample
    assert len(labels) == len(read(file, profile=PROFILE).imu)
    assert read_labels(file, 1, PROFILE) == labels
    refused(read_labels, file, "section", PROFILE, match="'section' is nowhere in the row of names")


def test_spans(tmp_path):
    path = tmp_path / "parts.csv"
    path.write_text("part,from_s,to_s\nx_p,1,2.5\nx_a,3,4\n")
    assert read_spans(path) == {"x_p": (1.0, 2.5), "x_a": (3.0, 4.0)}


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("a,b,c\n", "first line must be part,from_s,to_s"),
        ("", "first line must be part,from_s,to_s"),
        ("part,from_s,to_s\nx_p,1\n", "line 2: 'x_p,1' is not a name and two numbers"),
        ("part,from_s,to_s\nx_p,1,1\n", "a span needs a length"),
        ("part,from_s,to_s\nx_p,nan,1\n", "a span needs a length"),
        ("part,from_s,to_s\nx_p,1,2\nx_p,3,4\n", "line 3: 'x_p' comes twice"),
    ],
)
def test_a_table_that_is_none_is_refused(tmp_path, text, told):
    path = tmp_path / "parts.csv"
    path.write_text(text)
    refused(read_spans, path, match=told)
