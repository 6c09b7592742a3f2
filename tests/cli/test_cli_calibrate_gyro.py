"""plumbob calibrate gyro and temperature on files."""

import numpy as np
import pytest

from plumbob import CalibrationCard, ImuData, ImuMeta, apply_card, files
from plumbob.core.constants import G0
from plumbob.core.units import dps, from_si, to_dps
from plumbob.data.cards import TriadCalibration
from tests.helpers import beside
from tests.helpers.commandline import answer, ok, plumbob, refused
from tests.helpers.gyro_sessions import ferraris, hand
from tests.helpers.real_data import DATA, needs

SESSION = DATA / "ferraris" / "annotated_session.csv"
PROFILE = beside(__file__, "counts.profile.toml")


def recording(path, session, **more):
    meta = ImuMeta(device="unit 7", gyr_range=more.pop("gyr_range", None))
    return files.write(path, ImuData(t=session.t, gyr=session.gyr, acc=session.acc, meta=meta, **more))


@pytest.fixture(scope="module")
def captures(tmp_path_factory):
    """A capture by hand, its 20 s of rest alone with temperature, a Ferraris session, a card of the accelerometer."""
    folder = tmp_path_factory.mktemp("gyro")
    session = hand(1)
    recording(folder / "hand.parquet", session)
    still = session._replace(**{name: getattr(session, name)[:1000] for name in ("t", "gyr", "acc")})
    recording(folder / "still.parquet", still, temp_c=np.full(1000, 30.0))
    recording(folder / "ferraris.parquet", ferraris(1))
    acc = TriadCalibration(np.eye(3), np.zeros(3), "m/s2", "m/s2", method="acc known")
    CalibrationCard(device="unit 7", date="2024-01-01", method="acc known", acc=acc).save(folder / "acc.json")
    return folder


def refusal(*words):
    """Reasons of a refusal as JSON; exit code 1."""
    found = answer("calibrate", *words, code=1)
    assert found["card"] is None
    return [reason["kind"] for reason in found["refused"]]


def test_rest_gives_the_bias_and_hand_motion_scale_and_axes_beside_the_accelerometer_of_the_card(captures, tmp_path):
    ok("calibrate", "gyro", captures / "still.parquet", "--out", tmp_path / "card.json")
    gyr = CalibrationCard.load(tmp_path / "card.json").gyr
    assert (np.abs(gyr.bias - hand(1).bias) <= 5.0 * gyr.bias_sd).all()
    assert (gyr.matrix == np.eye(3)).all() and gyr.temp_ref_c == pytest.approx(30.0)
    assert "UNCALIBRATED" in ok("calibrate", "gyro", captures / "hand.parquet").stdout
    words = ("--calibration", captures / "acc.json", "--out", tmp_path / "hand.json")
    found = answer("calibrate gyro", captures / "hand.parquet", *words)
    assert not any("UNCALIBRATED" in remark for remark in found["remarks"]["gyr"])
    card = CalibrationCard.load(tmp_path / "hand.json")
    assert card.acc.method == "acc known"
    assert (np.abs(card.gyr.matrix - hand(1).matrix) <= 5.0 * card.gyr.matrix_sd).all()


def test_a_ferraris_session_whose_parts_are_found_or_told(captures, tmp_path):
    session = ferraris(1)
    spans = [f"{name},{session.t[p.start]:.3f},{session.t[p.stop]:.3f}" for name, p in session.parts.items()]
    (tmp_path / "parts.csv").write_text("\n".join(["part,from_s,to_s", *spans]) + "\n")
    words = ("calibrate", "gyro", captures / "ferraris.parquet", "--method", "ferraris")
    ok(*words, "--out", tmp_path / "found.json")
    ok(*words, "--parts", tmp_path / "parts.csv", "--out", tmp_path / "told.json")
    for name in ("found.json", "told.json"):
        card = CalibrationCard.load(tmp_path / name)
        assert (np.abs(card.gyr.matrix - session.matrix) <= 4.0 * card.gyr.matrix_sd).all()
        assert (np.abs(card.acc.matrix - np.eye(3)) <= 5.0 * card.acc.matrix_sd).all()
    assert "no turn" in plumbob(*words, "--to", "13s").stderr


@needs("ferraris/annotated_session.csv")
def test_the_real_ferraris_session_in_one_command(tmp_path):
    (tmp_path / "p.toml").write_text(PROFILE)
    words = ("calibrate", "gyro", SESSION, "--profile", tmp_path / "p.toml", "--method", "ferraris")
    ok(*words, "--part-column", "part", "--out", tmp_path / "card.json")
    card = CalibrationCard.load(tmp_path / "card.json")
    # imucal 2.6.0, see test_calibration_ferraris.py: b_a in counts of 1/2048 g, b_g in counts of 1/16.384 °/s
    assert from_si(card.acc.bias, "g") * 2048.0 == pytest.approx(
        [-6.018868019671572, -48.287874016760156, -28.96636637224333]
    )
    counts = [1.960686204431737, -4.472837741243746, -3.6511794138670477]
    assert to_dps(card.gyr.bias) * 16.384 == pytest.approx(counts)
    assert "nowhere" in refused(*words, "--part-column", "section")


def test_a_soak_keeps_the_matrix_of_the_card(captures, tmp_path):
    rng = np.random.default_rng(2)
    t = np.arange(12_000) / 10.0
    temp_c = 35.0 - 10.0 * np.cos(2.0 * np.pi * t / t[-1])
    slope = dps(np.array([0.1, -0.05, 0.02]))
    gyr = np.outer(temp_c - 25.0, slope) + dps(0.03) * rng.standard_normal((t.size, 3))
    soak = hand(1)._replace(t=t, gyr=gyr, acc=np.tile([0.0, 0.0, G0], (t.size, 1)))
    recording(tmp_path / "soak.parquet", soak, temp_c=temp_c)
    ok("calibrate", "gyro", captures / "hand.parquet", "--out", tmp_path / "hand.json")
    words = ("--calibration", tmp_path / "hand.json", "--out", tmp_path / "both.json")
    ok("calibrate", "temperature", tmp_path / "soak.parquet", *words)
    by_hand, both = (CalibrationCard.load(tmp_path / name).gyr for name in ("hand.json", "both.json"))
    assert (both.matrix == by_hand.matrix).all()
    assert (np.abs(both.bias_per_k[0] - slope) <= 5.0 * both.bias_per_k_sd[0]).all()
    assert refusal("temperature", captures / "still.parquet") == ["no-temperature", "too-few"]


def test_the_trackball_preset_says_that_nothing_was_measured(captures, tmp_path):
    words = ("calibrate", "gyro", captures / "still.parquet", "--preset", "trackball")
    assert "ASSUMED, NOT MEASURED" in ok(*words, "--out", tmp_path / "card.json").stdout
    gyr = CalibrationCard.load(tmp_path / "card.json").gyr
    assert to_dps(gyr.bias_per_k[0]) == pytest.approx(0.1)  # °/s per °C and, below, °/s per g [Chen2013]
    assert to_dps(gyr.g_sensitivity) * G0 == pytest.approx(0.1 * np.eye(3))
    # At 30 °C and 1 g along z, the paper's figures explain 0.5 °/s on every axis, and 0.1 °/s more on z.
    assert np.abs(to_dps(gyr.bias - hand(1).bias) + [0.5, 0.5, 0.6]).max() < 0.02
    at_rest = apply_card(CalibrationCard.load(tmp_path / "card.json"), files.read(captures / "still.parquet").imu).gyr
    assert np.abs(at_rest.mean(axis=0)).max() < dps(1e-3)  # the fit leaves out a part of a block: 4 of 1000 samples
    assert "record temp_c too" in refused("calibrate", "gyro", captures / "hand.parquet", "--preset", "trackball")


def test_captures_that_are_none_leave_no_card(tmp_path):
    session, out = hand(1), tmp_path / "card.json"
    rng = np.random.default_rng(0)
    recording(tmp_path / "shaken.parquet", session._replace(acc=session.acc + rng.normal(0.0, 3.0, session.acc.shape)))
    clipped = session._replace(gyr=np.clip(session.gyr, -dps(80.0), dps(80.0)))
    recording(tmp_path / "clipped.parquet", clipped, gyr_range=float(dps(80.0)))
    (tmp_path / "degrees.toml").write_text(
        PROFILE.replace("204.8", "50").replace("deg/s", "rad/s").replace("counts", "#")
    )
    table = np.hstack((from_si(session.acc, "g"), to_dps(session.gyr)))
    names = "acc_x,acc_y,acc_z,gyr_x,gyr_y,gyr_z"
    np.savetxt(tmp_path / "degrees.csv", table, delimiter=",", header=names, comments="")
    assert refusal("gyro", tmp_path / "shaken.parquet", "--out", out) == ["not-still"]
    assert refusal("gyro", tmp_path / "clipped.parquet", "--out", out)[0] == "clipping"
    assert "If the source holds °/s" in refused("calibrate", "gyro", tmp_path / "degrees.csv", "--out", out)
    assert not out.exists()


def test_a_gyroscope_is_refused_without_its_accelerometer_against_it_and_where_a_field_sees_it_turn(captures, tmp_path):
    session = hand(1)
    recording(tmp_path / "turned.parquet", session._replace(gyr=-session.gyr))
    assert refusal("gyro", tmp_path / "turned.parquet") == ["implausible"]
    told = ok("calibrate", "accel", tmp_path / "turned.parquet").stderr
    assert "note: turned.parquet: gyroscope: it turns against the accelerometer" in told
    assert ok("calibrate", "accel", captures / "hand.parquet").stderr == ""
    files.write(tmp_path / "gyro.parquet", ImuData(t=session.t, gyr=session.gyr, meta=ImuMeta(device="unit 7")))
    why = refused("calibrate", "gyro", tmp_path / "gyro.parquet", "--method", "hand")
    assert "against the accelerometer, and there is no acc" in why
    rng = np.random.default_rng(0)
    t = np.arange(3000) / 100.0
    gyr, acc = dps(0.1) * rng.standard_normal((2, t.size, 3)) + [[[0.0, 0.0, dps(3.0)]], [[0.0, 0.0, -G0]]]
    mag = np.stack((25.0 * np.cos(dps(3.0) * t), -25.0 * np.sin(dps(3.0) * t), np.full(t.size, 43.3)), axis=1)
    imu = ImuData(t=t, gyr=gyr, acc=acc, mag=mag + rng.normal(size=mag.shape), meta=ImuMeta(device="unit 7"))
    file = files.write(tmp_path / "turning.parquet", imu)
    kinds = [refusal("gyro", file, *words) for words in ((), ("--method", "rest"), ("--preset", "trackball"))]
    assert kinds == [["not-still"]] * 3
