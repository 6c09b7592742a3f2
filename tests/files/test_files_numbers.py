"""Files of bare numbers: text in every dialect that is taken, raw values, .npy, and what is refused."""

import numpy as np
import pytest

from plumbob.core.errors import DecodeError, ParameterError
from plumbob.files import numbers as plain_numbers
from plumbob.files import open_numbers, read
from tests.helpers.io_samples import refused
from tests.helpers.real_data import DATA, needs

L3GD20 = DATA / "static_l3gd20" / "gyro2_x.txt"
TABLE = np.random.default_rng(1).normal(size=(200, 3)).round(6)
DIALECTS = {
    **{repr(sep): "\n".join(sep.join(map(str, row)) for row in TABLE) + "\n" for sep in (" ", "\t", ",", ", ")},
    "columns of equal width": "\n".join("".join(f"{value:>14}" for value in row) for row in TABLE) + "\n",
    "semicolons at the end too": "\n".join(";".join(map(str, row)) + ";" for row in TABLE) + "\n",
    "line ends of Windows": "\r\n".join(" ".join(map(str, row)) for row in TABLE) + "\r\n",
    "comments and blank lines": "# a b c\n\n% more\n"
    + "\n \n".join(" ".join(map(str, row)) + "\n# x" for row in TABLE)
    + "\n",
    "signs": "\n".join(" ".join(f"{value:+}" for value in row) for row in TABLE) + "\n",
    "byte order mark": "\ufeff" + "\n".join(" ".join(map(str, row)) for row in TABLE) + "\n",
}


@pytest.fixture
def text(tmp_path):
    def written(content, **declared):
        path = tmp_path / "a.txt"
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return open_numbers(path, **declared)

    return written


@pytest.fixture
def small_chunks(monkeypatch):
    """So that every text here is cut at many places."""
    monkeypatch.setattr("plumbob.files.arrow.AT_ONCE", 97)
    monkeypatch.setattr("plumbob.files.numbers.READ", 97)


@pytest.mark.parametrize("dialect", DIALECTS)
@pytest.mark.parametrize("chunk", [1 << 20, 97])
def test_dialects_in_one_chunk_or_many(text, monkeypatch, dialect, chunk):
    monkeypatch.setattr("plumbob.files.arrow.AT_ONCE", chunk)
    numbers = text(DIALECTS[dialect])
    assert numbers.columns == 3
    assert numbers.notes == ()
    assert np.array_equal(numbers.read(), TABLE)
    assert (len(list(numbers.blocks())) > 20) == (chunk == 97)


@pytest.mark.parametrize("separator", [" ", "\t", ", ", " ; ", "  "])
@pytest.mark.parametrize("end", ["\n", " ", "\r\n"])
def test_one_line_is_one_column(text, separator, end, small_chunks):
    numbers = text(separator.join(map(str, TABLE.ravel())) + end)
    assert np.array_equal(numbers.read(), TABLE.reshape(-1, 1))
    assert np.array_equal(text(separator.join(map(str, TABLE.ravel())) + end, columns=3).read(), TABLE)
    assert numbers.notes == ()


def test_progress_ends_at_the_size_and_numbers_are_the_same_when_they_are_read_again(text, small_chunks):
    for content, declared, expected in (
        ("1\n-2.5e3\nnan\n", {}, [[1.0], [-2500.0], [np.nan]]),
        ("1,5\n1,6\n", {"columns": 2}, [[1.0, 5.0], [1.0, 6.0]]),
    ):
        numbers = text(content, **declared)
        for _ in range(2):
            assert np.array_equal(numbers.read(), expected, equal_nan=True)
    told = []
    numbers = text(DIALECTS["' '"])
    rows = sum(len(block) for block in numbers.blocks(told.append))
    assert rows == 200
    assert told == sorted(told)
    assert told[-1] == numbers.size == numbers.path.stat().st_size
    assert text("1 2\n3 4\n5 6").read().size == 6  # a last line without an end is a line
    for content, size, code in (("1.1\n1.2\n1", 2, "reading.last_line_cut"), ("1 2 3", 2, "reading.last_number_cut")):
        assert text(content).read().size == size
        assert [note.code for note in text(content).notes] == [code]


def npy(array, cut=0):
    """Maker of an array in a file, which may be cut at its end."""

    def put(folder):
        np.save(folder / "a.npy", array, allow_pickle=True)
        raw = (folder / "a.npy").read_bytes()
        (folder / "a.npy").write_bytes(raw[: len(raw) - cut])
        return folder / "a.npy"

    return put


WIDE = np.zeros((2000, 3))
WIDE[3, 0], WIDE[4, 0] = np.inf, np.nan  # others' business
NO_NPY = [np.zeros((2, 5)), np.zeros((4, 2, 2)), np.zeros(3, complex), np.zeros(3, bool), np.array(["a"])]
BAD = [  # content, what is declared, what is said
    ("7", {}, "holds no complete row"),
    ("1,,3,4\n", {}, "line 1, value 2: '' is not a number"),
    ("1,2,3\n4,,6\n", {}, "line 2, column 2: '' is not a number"),
    ("# only\n", {}, "holds no number"),
    ("1 2\n3 oops\n5 6\n", {}, r"line 2, column 2: 'oops' is not a number"),
    ("1 2\n\n# c\n3 1_0\n5 6\n", {}, r"line 4, column 2: '1_0' is not"),
    ("1 2\n3\n5 6\n", {}, r"line 2 has 1 cells, but most rows of numbers have 2: '3'"),
    ("#\n1 2\n3 4\n5 6 7\n", {}, r"line 4 has 3 cells, but most rows of numbers have 2"),
    ("1,5;2,5\n1,6;2,6\n", {}, "the commas may be decimal"),
    ("1,5 2,5\n1,6 2,6\n", {}, "'5 2' is not a number.*decimal commas needs a profile"),
    ("1,5\n1,6\n", {}, "may be two whole numbers or one with a decimal comma; declare columns = 2"),
    (b"\xff\xfe1\x00\n\x00x\x00\n\x00", {}, "line 2, column 1: 'x' is not a number"),
    ("1 2\n3 4\n", {"columns": 3}, "line 1 has 2 numbers, but 3 columns are declared"),
    ("1 2 3 4 5\n", {"columns": 3}, "5 numbers do not fill rows of 3 columns"),
    ("1\n2\n", {"columns": 0}, "at least 1", ParameterError),
    # behind the first chunk
    ("1.25 2.5\n" * 100 + "3 x\n", {}, "line 101, column 2: 'x'"),
    ("1.25 " * 100 + "x ", {}, "line 1, value 101: 'x'"),
    ("1.25 " * 100 + "\n1 2\n", {}, "more than 97 bytes, but others follow it"),
    # raw values are never guessed
    (bytes(20), {"kind": "double", "columns": 1}, "must be one of npy, text, f32.*'double'", ParameterError),
    (bytes(20), {"kind": "f32"}, "declare the columns", ParameterError),
    (bytes(20), {"kind": "f32", "columns": 2}, "a.txt: its 20 bytes are 2 rows of 2 f32 values and 4 bytes more"),
    (b"", {"kind": "f32", "columns": 2}, "is empty"),
    # .npy
    *((npy(array), {}, "fewer rows|must hold one array of real numbers") for array in NO_NPY),
    (npy(np.array([{}], dtype=object)), {}, r"not a \.npy file of numbers"),
    (npy(np.zeros((50, 2))), {"columns": 3}, "rows have 2 values, but 3"),
    (npy(np.zeros((50, 2)), cut=8), {}, "it is cut"),
    # squares of what no sensor gives overflow, and LAPACK says so on standard output
    (npy(np.vstack([WIDE, [0, 1e300, 0]])), {}, r"row 2001, column 2 is 1e\+300, but no sensor"),
    (npy(np.vstack([WIDE, [-2e30, 0, 0]])), {}, r"row 2001, column 1 is -2e\+30, but no sensor"),
]


@pytest.mark.parametrize("case", BAD, ids=range(len(BAD)))
def test_what_is_no_number_is_named_by_its_place(tmp_path, small_chunks, case):
    content, declared, match, error = (*case, DecodeError)[:4]
    path = content(tmp_path) if callable(content) else tmp_path / "a.txt"
    if not callable(content):
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
    name = path.name if error is DecodeError else ""
    refused(lambda: open_numbers(path, **declared).read(), match=match, error=error, name=name)


@needs("static_l3gd20/gyro2_x.txt")
def test_a_real_record_on_one_line_of_2_mb():
    numbers = open_numbers(L3GD20)
    values = numbers.read()
    assert values.shape == (len(L3GD20.read_bytes().split()), 1)
    assert np.array_equal(values[:3, 0], [1.2425, 1.46125, 1.0675])  # as the file begins
    assert values[-1, 0] == 0.63  # and ends


@pytest.mark.parametrize("kind", plain_numbers.RAW)
def test_raw_values(tmp_path, kind, small_chunks):
    table = np.arange(60).reshape(20, 3)
    path = tmp_path / f"a.{kind}"
    table.astype(plain_numbers.RAW[kind]).tofile(path)
    assert np.array_equal(open_numbers(path, columns=3).read(), table)
    path.rename(tmp_path / "a.bin")
    told = []
    numbers = open_numbers(tmp_path / "a.bin", kind=kind, columns=1)
    assert np.array_equal(np.concatenate(list(numbers.blocks(told.append))), table.reshape(-1, 1))
    assert told[-1] == numbers.size


@pytest.mark.parametrize("dtype", ["f4", "f8", ">f8", "i2", "u1"])
@pytest.mark.parametrize("order", ["C", "F"])
def test_npy(tmp_path, dtype, order):
    table = np.asarray(np.arange(60).reshape(20, 3), dtype=dtype, order=order)
    np.save(tmp_path / "a.npy", table)
    numbers = open_numbers(tmp_path / "a.npy")
    assert np.array_equal(numbers.read(), table)
    np.save(tmp_path / "a.npy", table[:, 0])
    assert np.array_equal(open_numbers(tmp_path / "a.npy", columns=1).read(), table[:, :1])


def test_a_large_file_comes_in_blocks_and_one_that_shrinks_is_noticed(tmp_path):
    table, path = np.arange(1.0, 900_001.0).reshape(-1, 3), tmp_path / "a.f64"
    table.tofile(path)
    numbers = open_numbers(path, columns=3)
    blocks = list(numbers.blocks())
    assert len(blocks) > 1
    assert np.array_equal(np.concatenate(blocks), table)
    path.write_bytes(bytes(48))
    refused(numbers.read, match="ends after 48 bytes")


def test_the_two_doors_point_to_each_other(tmp_path):
    path = tmp_path / "a.txt"
    path.write_text("1 2 3\n4 5 6\n")
    refused(read, path, match="Plain numbers of a unit at rest are for 'plumbob allan', with --rate and --scale")
    np.save(tmp_path / "a.npy", np.zeros(3))
    refused(read, tmp_path / "a.npy", match="Plain numbers of a unit at rest are for 'plumbob allan'")
    path = path.rename(tmp_path / "a.bin")
    refused(open_numbers, path, columns=1, match="'.bin' does not say what numbers it holds", error=ParameterError)
