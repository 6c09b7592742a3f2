"""Cards: the round trip, and everything that a file may say instead."""

import json

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis.extra import numpy as hnp

from plumbob.cards import CalibrationCard, NoiseCard, TriadCalibration, TriadNoise
from plumbob.errors import CalibrationError, DecodeError, ShapeError

MATRIX = [[1.01, 0.02, -0.03], [0.0, 0.98, 0.01], [0.004, -0.005, 1.02]]


def triad(**changes):
    return TriadCalibration(
        **({"matrix": MATRIX, "bias": [0.1, -0.2, 0.3], "unit_in": "m/s2", "unit_out": "m/s2"} | changes)
    )


def calibration(**changes):
    return CalibrationCard(
        **({"device": "unit 7", "date": "2026-11-21", "method": "six faces", "acc": triad()} | changes)
    )


def noise():
    return NoiseCard("unit 7", "data sheet", gyr=TriadNoise([1e-4, 2e-4, 3e-4], [1e-5] * 3, [0.0] * 3))


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    hnp.arrays(float, (3, 3), elements=st.floats(-0.2, 0.2)),
    hnp.arrays(float, 3, elements=st.floats(-1e3, 1e3)),
    st.floats(-40, 85),
)
def test_round_trip_keeps_every_bit(tmp_path, skew, bias, temp):
    card = calibration(
        device="Gerät µ-7", gyr=triad(matrix=np.eye(3) + skew, bias=bias, bias_per_k=bias / 7, temp_ref_c=temp),
        mag=triad(residual_rms=0.1),
    )  # fmt: skip
    card.save(tmp_path / "card.json")
    back = CalibrationCard.load(tmp_path / "card.json")
    assert (back.device, back.date, back.method, back.name) == (card.device, card.date, card.method, card.name)
    for name in ("gyr", "acc", "mag"):
        ours, theirs = getattr(card, name), getattr(back, name)
        for array in ("matrix", "bias", "bias_per_k"):
            assert getattr(ours, array).tobytes() == getattr(theirs, array).tobytes()
        assert (ours.unit_in, ours.temp_ref_c, ours.residual_rms) == (
            theirs.unit_in,
            theirs.temp_ref_c,
            theirs.residual_rms,
        )


def test_noise_round_trip(tmp_path):
    noise().save(tmp_path / "noise.json")
    back = NoiseCard.load(tmp_path / "noise.json")
    assert (back.device, back.source, back.acc, back.mag) == ("unit 7", "data sheet", None, None)
    assert np.array_equal(back.gyr.n_rpsd, noise().gyr.n_rpsd)


def test_paths_may_be_text(tmp_path):
    calibration().save(str(tmp_path / "card.json"))
    assert CalibrationCard.load(str(tmp_path / "card.json")).device == "unit 7"


def test_the_file_is_readable_json(tmp_path):
    calibration().save(tmp_path / "card.json")
    text = (tmp_path / "card.json").read_bytes()
    content = json.loads(text)
    assert content["kind"] == "plumbob calibration card"
    assert content["format_version"] == 1
    assert content["acc"]["matrix"] == MATRIX
    assert text.isascii()
    assert text.endswith(b"}\n")


def test_frozen(tmp_path):
    matrix = np.array(MATRIX)
    made = triad(matrix=matrix)
    matrix[0, 0] = 5.0
    assert made.matrix[0, 0] == 1.01
    with pytest.raises(ValueError, match="read-only"):
        made.matrix[0, 0] = 5.0


@pytest.mark.parametrize(
    ("change", "error", "says"),
    [
        ({"matrix": np.eye(2)}, CalibrationError, r"matrix must be finite and of shape \(3, 3\)"),
        ({"matrix": np.full((3, 3), np.nan)}, CalibrationError, "matrix must be finite"),
        ({"matrix": np.zeros((3, 3))}, CalibrationError, "matrix is singular"),
        ({"matrix": np.ones((3, 3))}, CalibrationError, "matrix is singular"),
        ({"matrix": np.diag([1, 1, 1e-4])}, CalibrationError, "matrix is singular or nearly so"),
        ({"bias": [0.0, 0.0]}, CalibrationError, "bias must be finite"),
        ({"bias": [0.0, 0.0, np.inf]}, CalibrationError, "bias must be finite"),
        ({"bias": "none"}, ShapeError, "bias must hold real numbers"),
        ({"bias_per_k": np.nan}, CalibrationError, "bias_per_k must be finite"),
        ({"temp_ref_c": np.nan}, CalibrationError, "temp_ref_c must be a finite number"),
        ({"temp_ref_c": "25"}, CalibrationError, "temp_ref_c must be a finite number, but it is '25'"),
        ({"temp_ref_c": True}, CalibrationError, "temp_ref_c"),
        ({"residual_rms": np.inf}, CalibrationError, "residual_rms must be a finite number"),
        ({"unit_in": None}, CalibrationError, "unit_in must be a text"),
    ],
)
def test_refused_triads(change, error, says):
    with pytest.raises(error, match=says):
        triad(**change)


@pytest.mark.parametrize(
    "change", [{"device": None}, {"date": 20261121}, {"method": b"x"}, {"acc": {}}, {"gyr": noise().gyr}]
)
def test_refused_cards(change):
    with pytest.raises(CalibrationError, match=f"{next(iter(change))} must be a"):
        calibration(**change)


@pytest.mark.parametrize("bad", [[1.0, -1.0, 1.0], [np.nan] * 3, [1.0, 1.0], 1.0, [np.inf] * 3])
def test_refused_noise(bad):
    with pytest.raises(CalibrationError, match="b must be three finite numbers ≥ 0"):
        TriadNoise([1.0] * 3, bad, [1.0] * 3)


class TestFiles:
    @pytest.fixture
    def path(self, tmp_path):
        calibration().save(tmp_path / "card.json")
        return tmp_path / "card.json"

    def refused(self, path, says, cls=CalibrationCard):
        with pytest.raises(DecodeError, match=says) as error:
            cls.load(path)
        assert str(path) in str(error.value)

    def test_cut_at_every_byte(self, path):
        whole = path.read_bytes()
        for length in range(len(whole) - 2):  # without the last brace it is no card; without the newline it is
            path.write_bytes(whole[:length])
            self.refused(path, "is not a plumbob calibration card")

    @pytest.mark.parametrize(
        "content",
        [
            b"",
            b"\x00\xff\xfe",
            b"\xef\xbb\xbf{}",
            b"[]",
            b"null",
            b"3",
            b'"card"',
            b"{",
            b"[" * 100_000,
            b"{}",
            b'{"kind": 1}',
        ],
    )
    def test_something_else(self, path, content):
        path.write_bytes(content)
        self.refused(path, "is not a plumbob calibration card")

    def test_the_other_kind_of_card(self, path):
        self.refused(path, "is not a plumbob noise card: its 'kind' says otherwise", NoiseCard)
        noise().save(path)
        self.refused(path, "is not a plumbob calibration card")

    @pytest.mark.parametrize("version", [0, 2, "1", None, [1]])
    def test_version(self, path, version):
        self.edited(path, lambda c: c | {"format_version": version}, "has format_version .* but this program reads 1")

    def test_missing_version(self, path):
        self.edited(path, lambda c: {k: v for k, v in c.items() if k != "format_version"}, "format_version None")

    @pytest.mark.parametrize(
        ("where", "edit", "says"),
        [
            (None, {"colour": "red"}, r"CalibrationCard has no \['colour'\]; known are"),
            (None, {"device": None}, "device must be a text"),
            (None, {"device": ["unit 7"]}, "device must be a text"),
            (None, {"acc": "none"}, "TriadCalibration has no none"),
            (None, {"acc": False}, "TriadCalibration has no False"),
            (None, {"acc": []}, r"TriadCalibration has no \[\]"),
            ("acc", {"gain": 1}, r"TriadCalibration has no \['gain'\]"),
            ("acc", {"matrix": None}, "matrix"),
            ("acc", {"matrix": [[1, 0, 0], [0, 1]]}, "matrix must be an array of numbers"),
            ("acc", {"matrix": [["1", "0", "0"]] * 3}, "matrix must hold real numbers"),
            ("acc", {"matrix": {"0": 1}}, "matrix"),
            ("acc", {"bias": [0, 0, 10**400]}, "bias"),
            ("acc", {"temp_ref_c": 10**400}, "incomplete or wrong"),
            ("acc", {"temp_ref_c": None}, "temp_ref_c"),
            ("acc", {"residual_rms": "small"}, "residual_rms"),
            ("acc", {"unit_in": 3}, "unit_in"),
        ],
    )
    def test_wrong_content(self, path, where, edit, says):
        change = (lambda c: c | edit) if where is None else (lambda c: c | {where: c[where] | edit})
        self.edited(path, change, says)

    @pytest.mark.parametrize("name", ["device", "date", "method"])
    def test_incomplete(self, path, name):
        self.edited(path, lambda c: {k: v for k, v in c.items() if k != name}, f"incomplete or wrong.*'{name}'")

    def edited(self, path, change, says):
        path.write_text(json.dumps(change(json.loads(path.read_text()))))
        self.refused(path, says)

    @pytest.mark.parametrize("number", ["NaN", "Infinity", "-Infinity", "1e999", "-1e999"])
    @pytest.mark.parametrize("key", ["temp_ref_c", "bias", "residual_rms"])
    def test_no_number(self, path, number, key):
        content = json.loads(path.read_text())
        content["acc"][key] = "HERE" if key != "bias" else [0, 0, "HERE"]
        path.write_text(json.dumps(content).replace('"HERE"', number))
        self.refused(path, "is not a number in JSON|finite")

    def test_a_key_that_stands_twice(self, path):
        path.write_text(path.read_text().replace('"device"', '"device": "unit 8",\n  "device"'))
        self.refused(path, "a key stands twice among .*device")

    def test_no_file(self, path):
        with pytest.raises(FileNotFoundError):
            CalibrationCard.load(path.with_name("none.json"))

    @settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
    @given(st.data())
    def test_any_damage_is_a_decode_error_or_harmless(self, path, data):
        calibration().save(path)
        text = bytearray(path.read_bytes())
        for _ in range(data.draw(st.integers(1, 4))):
            text[data.draw(st.integers(0, len(text) - 1))] = data.draw(st.integers(0, 255))
        path.write_bytes(text)
        try:
            card = CalibrationCard.load(path)
        except DecodeError:
            return
        assert np.isfinite(card.acc.matrix).all()
        assert np.isfinite(card.acc.temp_ref_c)
