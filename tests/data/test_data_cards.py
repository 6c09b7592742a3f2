"""Cards: the round trip, and everything that a file may say instead."""

import json
from dataclasses import fields, is_dataclass

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import HealthCheck, given
from hypothesis.extra import numpy as hnp

from plumbob.core.errors import CalibrationError, DecodeError, ShapeError
from plumbob.data.cards import CalibrationCard, Mount, NoiseCard, Quality, TriadCalibration, TriadNoise
from tests.helpers import beside, examples

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


@examples(0.3, suppress_health_check=[HealthCheck.function_scoped_fixture])
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
    assert list(map(str, mount.remarks)) == ["heading is that of the case."]
    card = calibration(device="Gerät µ-7", gyr=made, mag=triad(), mount=mount, software="plumbob 0")
    card.save(tmp_path / "card.json", overwrite=True)
    assert_same_bits(card, CalibrationCard.load(tmp_path / "card.json"))


VERSION_1 = beside(__file__, "card_version_1.json")


def test_a_file_of_version_1_and_a_noise_card_are_read(tmp_path):
    (tmp_path / "card.json").write_text(VERSION_1)
    card = CalibrationCard.load(tmp_path / "card.json")
    assert (card.name, list(card.parts)) == ("unit 7 2026-01-31 (six faces)", ["gyr"])
    assert card.gyr.matrix.diagonal().tolist() == [1.0, 1.5, 1.0]
    assert card.gyr.bias_per_k.tolist() == [[0.001, 0.0, -0.002]]  # the linear term of a polynomial now
    assert (card.gyr.temp_ref_c, card.gyr.temp_span_c) == (20.0, None)
    assert not card.gyr.g_sensitivity.any()
    assert [card.gyr.covariance, card.gyr.bias_sd, card.gyr.matrix_sd, card.gyr.quality] == [None] * 4
    assert card.text().startswith('{\n  "kind": "plumbob calibration card",\n  "format_version": 2,')
    text = calibration(device="Gerät").text()
    assert json.loads(text)["acc"]["matrix"] == MATRIX and text.isascii() and text.endswith("}\n")
    noise().save(str(tmp_path / "noise.json"))
    back = NoiseCard.load(str(tmp_path / "noise.json"))
    assert (back.device, back.source, back.acc, back.mag) == ("unit 7", "data sheet", None, None)
    assert np.array_equal(back.gyr.n_rpsd, noise().gyr.n_rpsd)


def test_standard_deviations_are_the_roots_of_the_covariance_and_arrays_are_frozen():
    covariance = np.diag(np.arange(12.0) ** 2)
    covariance[4, 5] = covariance[5, 4] = 1.0
    made = triad(covariance=covariance)
    assert made.bias_sd.tolist() == [0.0, 1.0, 2.0]
    assert made.matrix_sd.tolist() == [[3.0, 4.0, 5.0], [6.0, 7.0, 8.0], [9.0, 10.0, 11.0]]
    matrix = np.array(MATRIX)
    made = triad(matrix=matrix)
    matrix[0, 0] = 5.0
    assert made.matrix[0, 0] == 1.01
    with pytest.raises(ValueError, match="read-only"):
        made.matrix[0, 0] = 5.0


class TestParts:
    MOUNT = Mount([1.0, 0.0, 0.0, 0.0], method="hung")

    def test_a_card_has_the_parts_that_were_calibrated_is_taken_apart_and_renewed(self):
        card = calibration(gyr=full(), mount=self.MOUNT)
        assert list(card.parts) == ["gyr", "acc", "mount"]
        assert list(calibration(acc=None).parts) == []
        rest = card.without("mount", "gyr", "mag")
        assert list(rest.parts) == ["acc"]
        assert rest.acc is card.acc
        assert (rest.device, rest.date) == (card.device, card.date)
        old = calibration(gyr=full(), mag=triad(method="ellipsoid"), software="plumbob 0")
        new = calibration(date="2027-01-01", acc=None, gyr=full(bias=[9.0, 9.0, 9.0], method="at rest"),
                          mount=self.MOUNT, software="plumbob 1")  # fmt: skip
        both = old.merged(new)
        assert (both.acc, both.mag) == (old.acc, old.mag)
        assert (both.gyr, both.mount) == (new.gyr, new.mount)
        assert (both.date, both.software) == ("2027-01-01", "plumbob 1")
        assert (both.method, both.gyr.date) == ("at rest; ellipsoid; hung", "2026-11-20")
        with pytest.raises(CalibrationError, match="the card is of device 'unit 7', but the new one is of 'unit 8'"):
            calibration().merged(calibration(device="unit 8"))


def quality(**change):
    return Quality(**{"grade": "good", "samples": 1} | change)


def mount(**change):
    return Mount(**{"q_bs": [1.0, 0.0, 0.0, 0.0]} | change)


def triad_noise(**change):
    return TriadNoise(**{"n_rpsd": [1.0] * 3, "b": [1.0] * 3, "k_rpsd": [1.0] * 3} | change)


SINGULAR = [np.zeros((3, 3)), np.ones((3, 3)), np.diag([1, 1, 1e-4])]
SKEW = np.diag([1.0] + 11 * [0.0]) + 1e-9 * np.eye(12, k=1)
REFUSED = [
    (triad, {"matrix": np.eye(2)}, r"matrix must be finite and of shape \(3, 3\)"),
    *((triad, {"matrix": matrix}, "matrix is singular") for matrix in SINGULAR),
    (triad, {"matrix": np.diag([1, 1, -1])}, r"left-handed.*Declare the axes in the profile"),
    (triad, {"matrix": np.eye(3)[[1, 0, 2]]}, "matrix is left-handed"),
    (triad, {"matrix": 10.1 * np.eye(3)}, "gains from 0.1 to 10, not 10.1 to 10.1"),
    (triad, {"matrix": np.diag([1, 1, 0.09])}, "gains from 0.1 to 10, not 0.09 to 1:"),
    (triad, {"bias": [0.0, 0.0, np.inf]}, "bias must be finite"),
    (triad, {"bias": [0.0, -20001.0, 0.0]}, "bias must be within ±20000 m/s2"),
    (triad, {"unit_in": "rad/s", "bias": [101.0, 0.0, 0.0]}, "bias must be within ±100 rad/s"),
    (triad, {"unit_in": "uT", "bias": [0.0, 0.0, 1.1e5]}, "bias must be within ±100000 uT"),
    (triad, {"bias_per_k": np.nan}, "bias_per_k must be finite"),
    (triad, {"bias_per_k": np.zeros((2, 2))}, r"bias_per_k must be finite and of shape \(K, 3\)"),
    (triad, {"bias_per_k_sd": [0.0, 0.0, 0.0]}, r"bias_per_k_sd must be finite and of shape \(1, 3\)"),
    (triad, {"bias_per_k_sd": [[0.0, -1.0, 0.0]]}, "bias_per_k_sd must not be negative"),
    (triad, {"temp_ref_c": "25"}, "temp_ref_c must be a finite number, but it is '25'"),
    (triad, {"temp_ref_c": True}, "temp_ref_c"),
    (triad, {"temp_span_c": (40.0, 10.0)}, "lowest and highest temperature, but it is .40.0, 10.0."),
    (triad, {"temp_span_c": (10.0, np.nan)}, "temp_span_c must be finite"),
    (triad, {"g_sensitivity": np.zeros(3)}, r"g_sensitivity must be finite and of shape \(3, 3\)"),
    (triad, {"g_sensitivity_sd": np.zeros((2, 3))}, "g_sensitivity_sd must be finite and of shape"),
    (triad, {"g_sensitivity_sd": -np.eye(3)}, "g_sensitivity_sd must not be negative"),
    (triad, {"covariance": np.eye(9)}, r"covariance must be finite and of shape \(12, 12\)"),
    (triad, {"covariance": -np.eye(12)}, "covariance must not be negative"),
    (triad, {"covariance": np.eye(12) + 1e-5 * np.eye(12, k=1)}, r"symmetric, but entries \(0, 1\)"),
    (triad, {"covariance": SKEW}, "must be symmetric"),
    (triad, {"residual_rms": -1.0}, "residual_rms must not be negative, but it is -1"),
    (triad, {"reference": "g"}, "reference must be a finite number, but it is 'g'"),
    (triad, {"reference": 0.0}, "reference must be above zero"),
    (triad, {"quality": "good"}, "quality must be a Quality or None"),
    *((triad, {"remarks": bad}, "remarks must be a sequence of findings") for bad in ("one", [1], None)),
    *((triad, {name: bad}, f"{name} must be text") for name, bad in (("unit_in", 0), ("method", None), ("date", 3))),
    *((calibration, {name: 3}, f"{name} must be text") for name in ("device", "date", "method", "software")),
    *((calibration, {name: noise().gyr}, f"{name} must be a") for name in ("acc", "gyr", "mount")),
    *((make, {"date": "2026-11-21 or so"}, "date must be ISO 8601, as 2026-11-21") for make in (triad, calibration)),
    (quality, {"grade": "great"}, "grade must be one of good, fair, poor, but it is 'great'"),
    (quality, {"samples": -1}, "samples must be a whole number ≥ 0, but it is -1"),
    *((quality, {n: 3.0}, f"{n} must be a whole number") for n in ("samples", "outliers", "regions")),
    *((quality, {"outliers": bad}, "outliers must be a whole number") for bad in (True, "all")),
    *(
        (quality, {n: np.nan}, f"{n} must be a finite")
        for n in ["condition", "tilt_sd", "heading_sd", "tilt_range", "scale_sd"]
    ),
    *((quality, {"tilt_sd": bad}, "tilt_sd must be a finite number") for bad in ("1", np.inf, True)),
    (quality, {"tilt_sd": -1e-3}, "tilt_sd must not be negative, but it is -0.001"),
    (mount, {"q_bs": [1.0, 0.0, 0.0]}, r"q_bs must be finite and of shape \(4,\)"),
    (mount, {"sd": [0.1, 0.1]}, r"sd must be finite and of shape \(3,\)"),
    (mount, {"sd": [0.1, -0.1, 0.1]}, "sd must not be negative, but it is"),
    (mount, {"method": 3}, "method must be text"),
    (mount, {"date": "soon"}, "date must be ISO 8601"),
    (mount, {"remarks": {}}, "remarks must be a sequence of findings"),
    *((triad_noise, {"b": bad}, "b must be three finite numbers ≥ 0") for bad in ([1, -1, 1], [np.nan] * 3, [1, 1], 1)),
    *(
        (triad_noise, {"n_interval": bad}, "n_interval must be")
        for bad in ([[0.0] * 3], [[2.0] * 3, [1.0] * 3], [[-1.0] * 3, [1.0] * 3], [[np.nan] * 3] * 2)
    ),
]
NO_NUMBERS = [(triad, {"bias": "none"}, "bias must hold real numbers"), (mount, {"q_bs": [1.0, 0.1, 0, 0]}, "q_bs")]


@pytest.mark.parametrize(
    ("error", "make", "change", "says"),
    [*((CalibrationError, *row) for row in REFUSED), *((ShapeError, *row) for row in NO_NUMBERS)],
)
def test_refused(error, make, change, says):
    with pytest.raises(error, match=says):
        make(**change)


def test_what_is_just_right_is_taken():
    for date in ("", "2026-11-21", "2026-11-21T12:30:00+00:00"):
        assert triad(date=date).date == calibration(date=date).date == date
    covariance = np.eye(12) + 1e-3
    covariance[0, 1] += 1e-9  # asymmetric by rounding
    assert np.array_equal(triad(covariance=covariance).covariance, covariance)


@pytest.mark.parametrize(("change", "found"), [
    ({"matrix": np.eye(3)}, False),
    ({"matrix": np.eye(3), "covariance": np.diag([1.0] * 3 + [0.0] * 9)}, False),
    ({"matrix": np.eye(3), "covariance": np.eye(12)}, True),
    ({"matrix": MATRIX}, True),
])  # fmt: skip
def test_an_identity_without_variance_was_not_found(change, found):
    assert triad(**change).matrix_found is found


def edited(change):
    """What makes one text of a card of another."""
    return lambda text: json.dumps(change(json.loads(text)))


def without(name):
    return edited(lambda card: {key: value for key, value in card.items() if key != name})


def acc(**change):
    return edited(lambda card: card | {"acc": card["acc"] | change})


def top(**change):
    return edited(lambda card: card | change)


def spelled(number, edit):
    return lambda text: edit(text).replace('"HERE"', number)


CONTENT = [
    *((top(format_version=bad), "has format_version .* reads up to 2") for bad in (0, 3, "1", None, [1], True)),
    (without("format_version"), "format_version None"),
    *((without(name), f"incomplete or wrong.*'{name}'") for name in ("device", "date", "method")),
    (top(colour="red"), r"CalibrationCard has no \['colour'\]; known:"),
    (top(device=None), "device must be text"),
    (top(acc="none"), "TriadCalibration has no none"),
    (top(acc=[]), r"TriadCalibration has no \[\]"),
    (acc(gain=1), r"TriadCalibration has no \['gain'\]"),
    (acc(matrix=[[1, 0, 0], [0, 1]]), "matrix must be an array of numbers"),
    (acc(matrix=[["1", "0", "0"]] * 3), "matrix must hold real numbers"),
    (acc(matrix={"0": 1}), "matrix"),
    (acc(matrix=[[0, 1, 0], [1, 0, 0], [0, 0, 1]]), "left-handed"),
    (acc(bias=[0, 0, 10**400]), "bias"),
    (acc(temp_ref_c=10**400), "incomplete or wrong"),
    (acc(temp_ref_c=None), "temp_ref_c"),
    (acc(quality={"grade": "good"}), "Quality is incomplete or wrong.*'samples'"),
    (acc(quality={"grade": "good", "samples": 3, "mark": 1}), r"Quality has no \['mark'\]"),
    (acc(quality=3), "Quality has no 3"),
    (top(mount={"q_bs": [2, 0, 0, 0]}), "Mount is incomplete or wrong.*q_bs"),
    (top(mount={"sd": [0, 0, 0]}), "Mount is incomplete or wrong.*'q_bs'"),
    *(
        (spelled(number, edit), "is not a number in JSON")
        for number in ("NaN", "Infinity", "-Infinity", "1e999", "-1e999")
        for edit in (acc(temp_ref_c="HERE"), acc(bias=[0, 0, "HERE"]))
    ),
    (lambda text: text.replace('"device"', '"device": "unit 8",\n  "device"'), "a key occurs twice among .*device"),
]
NO_CARDS = [b"", *b'[] null 3 "card" { {} {"kind":1} \x00\xff\xfe \xef\xbb\xbf{}'.split(), b"[" * 100_000]


class TestFiles:
    @pytest.fixture
    def path(self, tmp_path):
        calibration().save(tmp_path / "card.json")
        return tmp_path / "card.json"

    def refused(self, path, says, cls=CalibrationCard):
        with pytest.raises(DecodeError, match=says) as error:
            cls.load(path)
        assert str(path) in str(error.value)

    def test_what_is_no_card_is_refused(self, path):
        self.refused(path, "is not a plumbob noise card: its 'kind' says otherwise", NoiseCard)
        self.refused(path.with_name("none.json"), r"none\.json does not exist; check the path")
        card = path.read_bytes()
        cut = [card[:length] for length in range(0, len(card) - 2, 7)]  # without the newline alone it would be one
        for content in (*NO_CARDS, noise().text().encode(), *cut):
            path.write_bytes(content)
            self.refused(path, "is not a plumbob calibration card")

    @pytest.mark.parametrize(("change", "says"), CONTENT)
    def test_wrong_content_is_refused(self, path, change, says):
        path.write_text(change(path.read_text()))
        self.refused(path, says)

    @examples(0.5, suppress_health_check=[HealthCheck.function_scoped_fixture])
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
        assert np.isfinite(card.acc.temp_ref_c) and abs(np.linalg.norm(card.mount.q_bs) - 1.0) < 1e-3
