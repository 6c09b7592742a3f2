"""Cards: the round trip, and everything that a file may say instead."""

import json
from dataclasses import fields, is_dataclass

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis.extra import numpy as hnp

from plumbob.core.errors import CalibrationError, DecodeError, ShapeError
from plumbob.data.cards import CalibrationCard, Mount, NoiseCard, Quality, TriadCalibration, TriadNoise

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


def full(**changes):
    """A triad in which every field says something."""
    spread = np.diag(np.linspace(1e-6, 1e-4, 12))
    everything = {
        "unit_in": "rad/s", "unit_out": "rad/s", "bias_per_k": [[1e-4, 0, -2e-4], [1e-6, 2e-6, 0]], "temp_ref_c": 30.0,
        "residual_rms": 1e-3, "g_sensitivity": 1e-4 * np.arange(9.0).reshape(3, 3), "temp_span_c": (10.0, 40.0),
        "covariance": spread, "bias_per_k_sd": [[1e-5] * 3, [1e-7] * 3], "g_sensitivity_sd": np.full((3, 3), 1e-5),
        "reference": 9.81, "method": "rate table", "date": "2026-11-20",
        "quality": Quality(grade="good", samples=120, outliers=3, regions=17, condition=12.5, tilt_sd=1e-3,
                           heading_sd=2e-3, tilt_range=0.8, scale_sd=4e-5),
        "remarks": ("it stood aslant.",),
    }  # fmt: skip
    return triad(**everything | changes)


def assert_same_bits(ours, theirs):
    assert type(ours) is type(theirs)
    if is_dataclass(ours):
        for f in fields(ours):
            assert_same_bits(getattr(ours, f.name), getattr(theirs, f.name))
    elif isinstance(ours, np.ndarray):
        assert (ours.shape, ours.tobytes()) == (theirs.shape, theirs.tobytes())
    else:
        assert ours == theirs


def numbers(shape, size=1e3):
    return hnp.arrays(float, shape, elements=st.floats(-size, size))


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
def test_round_trip_keeps_every_bit(tmp_path, data):
    order = data.draw(st.integers(1, 4))
    size = st.none() | st.floats(0.0, 1e3)
    made = full(
        matrix=np.eye(3) + data.draw(numbers((3, 3), 0.2)),
        bias=data.draw(numbers(3, 99.0)),
        bias_per_k=data.draw(numbers((order, 3))),
        bias_per_k_sd=np.abs(data.draw(numbers((order, 3)))),
        temp_ref_c=data.draw(st.floats(-40, 85)),
        temp_span_c=tuple(sorted(data.draw(st.tuples(st.floats(-40, 85), st.floats(-40, 85))))),
        residual_rms=data.draw(size),
        reference=data.draw(st.none() | st.floats(1e-3, 1e3)),
        g_sensitivity=data.draw(numbers((3, 3))),
        g_sensitivity_sd=np.abs(data.draw(numbers((3, 3)))),
        covariance=(half := data.draw(numbers((12, 12), 1.0))) @ half.T,
        method=data.draw(st.text(max_size=20)),
        remarks=tuple(data.draw(st.lists(st.text(max_size=20), max_size=3))),
        quality=Quality(
            grade=data.draw(st.sampled_from(["good", "fair", "poor"])),
            samples=data.draw(st.integers(0, 10**7)),
            outliers=data.draw(st.integers(0, 99)),
            regions=data.draw(st.none() | st.integers(0, 18)),
            condition=data.draw(size),
            tilt_sd=data.draw(size),
            heading_sd=data.draw(size),
            tilt_range=data.draw(size),
            scale_sd=data.draw(size),
        ),
    )
    turn = data.draw(numbers(4, 1.0).filter(lambda q: np.linalg.norm(q) > 0.1))
    mount = Mount(turn / np.linalg.norm(turn), sd=np.abs(data.draw(numbers(3))), method="hung", date="2026-11-19",
                  remarks=["heading is that of the case."])  # fmt: skip
    assert mount.remarks == ("heading is that of the case.",)
    card = calibration(device="Gerät µ-7", gyr=made, mag=triad(), mount=mount, software="plumbob 0")
    card.save(tmp_path / "card.json", overwrite=True)
    assert_same_bits(card, CalibrationCard.load(tmp_path / "card.json"))


VERSION_1 = """{
  "kind": "plumbob calibration card", "format_version": 1,
  "device": "unit 7", "date": "2026-01-31", "method": "six faces",
  "gyr": {
    "matrix": [[1.0, 0.0, 0.0], [0.0, 1.5, 0.0], [0.0, 0.0, 1.0]], "bias": [0.1, 0.2, 0.3],
    "unit_in": "rad/s", "unit_out": "rad/s", "bias_per_k": [0.001, 0.0, -0.002], "temp_ref_c": 20.0,
    "residual_rms": null
  },
  "acc": null, "mag": null
}
"""


def test_a_file_of_version_1_is_read(tmp_path):
    (tmp_path / "card.json").write_text(VERSION_1)
    card = CalibrationCard.load(tmp_path / "card.json")
    assert (card.name, list(card.parts)) == ("unit 7 2026-01-31 (six faces)", ["gyr"])
    assert card.gyr.matrix.diagonal().tolist() == [1.0, 1.5, 1.0]
    assert card.gyr.bias_per_k.tolist() == [[0.001, 0.0, -0.002]]  # the linear term of a polynomial now
    assert (card.gyr.temp_ref_c, card.gyr.temp_span_c) == (20.0, None)
    assert not card.gyr.g_sensitivity.any()
    assert [card.gyr.covariance, card.gyr.bias_sd, card.gyr.matrix_sd, card.gyr.quality] == [None] * 4
    assert card.text().startswith('{\n  "kind": "plumbob calibration card",\n  "format_version": 2,')


def test_standard_deviations_are_the_roots_of_the_covariance():
    covariance = np.diag(np.arange(12.0) ** 2)
    covariance[4, 5] = covariance[5, 4] = 1.0
    made = triad(covariance=covariance)
    assert made.bias_sd.tolist() == [0.0, 1.0, 2.0]
    assert made.matrix_sd.tolist() == [[3.0, 4.0, 5.0], [6.0, 7.0, 8.0], [9.0, 10.0, 11.0]]


class TestParts:
    MOUNT = Mount([1.0, 0.0, 0.0, 0.0], method="hung")

    def test_a_card_has_the_parts_that_were_calibrated(self):
        assert list(calibration(gyr=full(), mount=self.MOUNT).parts) == ["gyr", "acc", "mount"]
        assert list(calibration(acc=None).parts) == []

    def test_without(self):
        card = calibration(gyr=full(), mount=self.MOUNT)
        left = card.without("mount", "gyr", "mag")
        assert list(left.parts) == ["acc"]
        assert left.acc is card.acc
        assert (left.device, left.date) == (card.device, card.date)

    def test_a_newer_card_adds_and_replaces(self):
        old = calibration(gyr=full(), mag=triad(method="ellipsoid"), software="plumbob 0")
        new = calibration(date="2027-01-01", acc=None, gyr=full(bias=[9.0, 9.0, 9.0], method="at rest"),
                          mount=self.MOUNT, software="plumbob 1")  # fmt: skip
        both = old.merged(new)
        assert (both.acc, both.mag) == (old.acc, old.mag)
        assert (both.gyr, both.mount) == (new.gyr, new.mount)
        assert (both.date, both.software) == ("2027-01-01", "plumbob 1")
        assert both.method == "at rest; ellipsoid; hung"
        assert both.gyr.date == "2026-11-20"

    def test_a_card_of_another_unit_is_not_merged(self):
        with pytest.raises(CalibrationError, match="the card is of device 'unit 7', but the new one is of 'unit 8'"):
            calibration().merged(calibration(device="unit 8"))


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
    assert content["format_version"] == 2
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
        ({"method": None}, CalibrationError, "method must be a text"),
        ({"date": 2026}, CalibrationError, "date must be a text"),
        ({"bias_per_k": np.zeros((2, 2))}, CalibrationError, r"bias_per_k must be finite and of shape \(K, 3\)"),
        ({"bias_per_k": 0.1}, CalibrationError, r"bias_per_k must be finite and of shape \(K, 3\)"),
        ({"g_sensitivity": np.zeros(3)}, CalibrationError, r"g_sensitivity must be finite and of shape \(3, 3\)"),
        ({"g_sensitivity": np.full((3, 3), np.inf)}, CalibrationError, "g_sensitivity must be finite"),
        ({"temp_span_c": (40.0, 10.0)}, CalibrationError, "lowest and highest temperature, but it is .40.0, 10.0."),
        ({"temp_span_c": (10.0, np.nan)}, CalibrationError, "temp_span_c must be finite"),
        ({"temp_span_c": 10.0}, CalibrationError, "temp_span_c must be finite and of shape"),
        ({"covariance": np.eye(9)}, CalibrationError, r"covariance must be finite and of shape \(12, 12\)"),
        ({"covariance": -np.eye(12)}, CalibrationError, "covariance must not be negative"),
        ({"bias_per_k_sd": [0.0, 0.0, 0.0]}, CalibrationError, r"bias_per_k_sd must be finite and of shape \(1, 3\)"),
        ({"bias_per_k_sd": [[0.0, -1.0, 0.0]]}, CalibrationError, "bias_per_k_sd must not be negative"),
        ({"g_sensitivity_sd": np.zeros((2, 3))}, CalibrationError, "g_sensitivity_sd must be finite and of shape"),
        ({"g_sensitivity_sd": -np.eye(3)}, CalibrationError, "g_sensitivity_sd must not be negative"),
        ({"reference": "g"}, CalibrationError, "reference must be a finite number, but it is 'g'"),
        ({"quality": "good"}, CalibrationError, "quality must be a Quality or None"),
        ({"remarks": "one"}, CalibrationError, "remarks must be a list of texts, but it is 'one'"),
        ({"remarks": [1]}, CalibrationError, "remarks must be a list of texts"),
        ({"remarks": None}, CalibrationError, "remarks must be a list of texts"),
        ({"matrix": np.diag([1, 1, -1])}, CalibrationError, r"left-handed.*Declare the axes in the profile"),
        ({"matrix": np.eye(3)[[1, 0, 2]]}, CalibrationError, "matrix is left-handed"),
        ({"matrix": -np.eye(3)}, CalibrationError, "matrix is left-handed"),
        ({"matrix": 10.1 * np.eye(3)}, CalibrationError, "gains from 0.1 to 10, not 10.1 to 10.1"),
        ({"matrix": np.diag([1, 1, 0.09])}, CalibrationError, "gains from 0.1 to 10, not 0.09 to 1:"),
        ({"bias": [0.0, -20001.0, 0.0]}, CalibrationError, "bias must be within ±20000 m/s2"),
        ({"unit_in": "rad/s", "bias": [101.0, 0.0, 0.0]}, CalibrationError, "bias must be within ±100 rad/s"),
        ({"unit_in": "uT", "bias": [0.0, 0.0, 1.1e5]}, CalibrationError, "bias must be within ±100000 uT"),
        ({"reference": -3.0}, CalibrationError, "reference must not be negative, but it is -3"),
        ({"reference": 0.0}, CalibrationError, "reference must be above zero"),
        ({"residual_rms": -1.0}, CalibrationError, "residual_rms must not be negative, but it is -1"),
        ({"covariance": np.eye(12) + 1e-5 * np.eye(12, k=1)}, CalibrationError, r"symmetric, but entries \(0, 1\)"),
        ({"covariance": np.diag([1.0] + 11 * [0.0]) + 1e-9 * np.eye(12, k=1)}, CalibrationError, "must be symmetric"),
        ({"date": "yesterday"}, CalibrationError, "date must be ISO 8601, as 2026-11-21, but it is 'yesterday'"),
    ],
)
def test_refused_triads(change, error, says):
    with pytest.raises(error, match=says):
        triad(**change)


@pytest.mark.parametrize("date", ["", "2026-11-21", "2026-11-21T12:30:00+00:00"])
def test_dates_are_iso_8601_or_not_known(date):
    assert triad(date=date).date == calibration(date=date).date == date
    with pytest.raises(CalibrationError, match="date must be ISO 8601"):
        calibration(date=f"{date} or so")


def test_a_covariance_may_be_asymmetric_by_rounding():
    covariance = np.eye(12) + 1e-3
    covariance[0, 1] += 1e-9
    assert np.array_equal(triad(covariance=covariance).covariance, covariance)


@pytest.mark.parametrize(
    ("change", "found"),
    [
        ({"matrix": np.eye(3)}, False),
        ({"matrix": np.eye(3), "covariance": np.diag([1.0] * 3 + [0.0] * 9)}, False),
        ({"matrix": np.eye(3), "covariance": np.eye(12)}, True),
        ({"matrix": MATRIX}, True),
    ],
)
def test_an_identity_without_variance_was_not_found(change, found):
    assert triad(**change).matrix_found is found


@pytest.mark.parametrize(
    "change",
    [
        {"device": None}, {"date": 20261121}, {"method": b"x"}, {"software": 1}, {"acc": {}}, {"gyr": noise().gyr},
        {"mount": [1.0, 0.0, 0.0, 0.0]},
    ],
)  # fmt: skip
def test_refused_cards(change):
    with pytest.raises(CalibrationError, match=f"{next(iter(change))} must be a"):
        calibration(**change)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"grade": "great"}, "grade must be one of good, fair, poor, but it is 'great'"),
        ({"samples": -1}, "samples must be a whole number ≥ 0, but it is -1"),
        ({"samples": 3.0}, "samples must be a whole number"),
        ({"outliers": True}, "outliers must be a whole number"),
        ({"regions": "all"}, "regions must be a whole number"),
        ({"condition": np.nan}, "condition must be a finite number"),
        ({"tilt_sd": "1"}, "tilt_sd must be a finite number"),
        ({"heading_sd": np.inf}, "heading_sd must be a finite number"),
        ({"tilt_range": True}, "tilt_range must be a finite number"),
        ({"scale_sd": np.nan}, "scale_sd must be a finite number"),
        ({"tilt_sd": -1e-3}, "tilt_sd must not be negative, but it is -0.001"),
    ],
)
def test_refused_qualities(change, says):
    with pytest.raises(CalibrationError, match=says):
        Quality(**{"grade": "good", "samples": 1} | change)


@pytest.mark.parametrize(
    ("change", "error", "says"),
    [
        ({"q_bs": [1.0, 0.0, 0.0]}, CalibrationError, r"q_bs must be finite and of shape \(4,\)"),
        ({"q_bs": [1.0, 0.1, 0.0, 0.0]}, ShapeError, "q_bs"),
        ({"q_bs": [np.nan, 0.0, 0.0, 0.0]}, CalibrationError, "q_bs must be finite"),
        ({"sd": [0.1, 0.1]}, CalibrationError, r"sd must be finite and of shape \(3,\)"),
        ({"sd": [0.1, -0.1, 0.1]}, CalibrationError, "sd must not be negative, but it is"),
        ({"method": 3}, CalibrationError, "method must be a text"),
        ({"date": None}, CalibrationError, "date must be a text"),
        ({"date": "soon"}, CalibrationError, "date must be ISO 8601"),
        ({"remarks": {}}, CalibrationError, "remarks must be a list of texts"),
    ],
)
def test_refused_mounts(change, error, says):
    with pytest.raises(error, match=says):
        Mount(**{"q_bs": [1.0, 0.0, 0.0, 0.0]} | change)


@pytest.mark.parametrize("bad", [[1.0, -1.0, 1.0], [np.nan] * 3, [1.0, 1.0], 1.0, [np.inf] * 3])
def test_refused_noise(bad):
    with pytest.raises(CalibrationError, match="b must be three finite numbers ≥ 0"):
        TriadNoise([1.0] * 3, bad, [1.0] * 3)


@pytest.mark.parametrize("bad", [[[0.0] * 3], [[2.0] * 3, [1.0] * 3], [[-1.0] * 3, [1.0] * 3], [[np.nan] * 3] * 2])
def test_refused_intervals_of_noise(bad):
    with pytest.raises(CalibrationError, match="n_interval must be"):
        TriadNoise([1.0] * 3, [1.0] * 3, [1.0] * 3, n_interval=bad)


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
        path.unlink()
        noise().save(path)
        self.refused(path, "is not a plumbob calibration card")

    @pytest.mark.parametrize("version", [0, 3, "1", None, [1], True])
    def test_version(self, path, version):
        self.edited(
            path, lambda c: c | {"format_version": version}, "has format_version .* but this program reads up to 2"
        )

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
            ("acc", {"quality": {"grade": "good"}}, "Quality is incomplete or wrong.*'samples'"),
            ("acc", {"quality": {"grade": "good", "samples": 3, "mark": 1}}, r"Quality has no \['mark'\]"),
            ("acc", {"quality": 3}, "Quality has no 3"),
            ("acc", {"covariance": [[1.0]]}, "covariance must be finite and of shape"),
            ("acc", {"temp_span_c": [40, 10]}, "temp_span_c must be lowest and highest"),
            ("acc", {"remarks": "sea"}, "remarks must be a list of texts"),
            ("acc", {"matrix": [[0, 1, 0], [1, 0, 0], [0, 0, 1]]}, "left-handed"),
            (None, {"date": "yesterday"}, "date must be ISO 8601"),
            (None, {"mount": {"q_bs": [2, 0, 0, 0]}}, "Mount is incomplete or wrong.*q_bs"),
            (None, {"mount": {"sd": [0, 0, 0]}}, "Mount is incomplete or wrong.*'q_bs'"),
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
        with pytest.raises(DecodeError, match=r"none\.json does not exist; check the path"):
            CalibrationCard.load(path.with_name("none.json"))

    @settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
    @given(st.data())
    def test_any_damage_is_a_decode_error_or_harmless(self, path, data):
        path.unlink(missing_ok=True)  # the last one, if its kind was damaged, would not be written over
        calibration(acc=full(), mount=Mount([1.0, 0.0, 0.0, 0.0], sd=[0.1] * 3)).save(path, overwrite=True)
        text = bytearray(path.read_bytes())
        for _ in range(data.draw(st.integers(1, 4))):
            text[data.draw(st.integers(0, len(text) - 1))] = data.draw(st.integers(0, 255))
        path.write_bytes(text)
        try:
            card = CalibrationCard.load(path)
        except DecodeError:
            return
        for name in ("matrix", "bias", "bias_per_k", "g_sensitivity", "covariance", "temp_span_c"):
            assert np.isfinite(getattr(card.acc, name)).all()
        assert np.isfinite(card.acc.temp_ref_c)
        assert abs(np.linalg.norm(card.mount.q_bs) - 1.0) < 1e-3
