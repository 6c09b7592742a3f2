"""What the server makes of samples: Allan deviation, guided calibrations and their cards, lines of text."""

import time

import numpy as np
import pytest
from websockets.sync.client import connect

from plumbob import AttitudeTrack, CalibrationCard, ImuData, ImuMeta, calibrate, flags
from plumbob.live.sinks import track_lines
from plumbob.rotations import Frame, North, quat_from_rotvec, quat_multiply, quat_rotate
from plumbob.viewer.derived import Allan, FedSamples
from plumbob.viewer.pipe import PipeMessage
from tests.helpers.feeding import Asking, Body, asked, hello, serving

BODY = Body(100.0)
RATE = 100.0


def still(count):
    """A unit at rest: gyr, acc, mag and temperature with white noise."""
    noise = np.random.default_rng(3).normal(size=(count, 9)) * np.repeat([0.002, 0.02, 0.1], 3)
    mean = np.concatenate(([0.01, -0.02, 0.005], [0.0, 0.0, 9.80665], [20.0, 5.0, -40.0]))
    return np.column_stack((mean + noise, np.full(count, 25.0)))


def turned(count):
    """A unit that is turned through all attitudes, whose magnetometer has an offset and unequal axes."""
    rng = np.random.default_rng(5)
    t = np.arange(count) / RATE
    # Turned slowly about z of the navigation frame, faster about a level axis: the field comes from everywhere.
    about_z = quat_from_rotvec(np.outer(0.31 * t, [0.0, 0.0, 1.0]))
    q = quat_multiply(about_z, quat_from_rotvec(np.outer(0.9 * t, [1.0, 0.0, 0.0])))
    q_bn = q * [1.0, -1.0, -1.0, -1.0]
    field = quat_rotate(q_bn, np.array([0.0, 20.0, -43.0]))
    mag = field * [1.05, 0.97, 1.01] + [12.0, -7.0, 3.0] + 0.1 * rng.normal(size=(count, 3))
    acc = quat_rotate(q_bn, np.array([0.0, 0.0, 9.80665])) + 0.02 * rng.normal(size=(count, 3))
    rate = quat_rotate(q_bn, np.array([0.0, 0.0, 0.31])) + [0.9, 0.0, 0.0]
    return np.column_stack((rate, acc, mag, np.full(count, 25.0)))


def feed(served, sensed, first=0, size=50):
    for k in range(0, len(sensed), size):
        some = sensed[k : k + size]
        batch = BODY.batch(first + k, len(some))
        served.feed.write(PipeMessage("batch", batch.content, {**batch.arrays, "sensed": some}))


def overlapping(x, n):
    """Overlapping Allan deviation of rates at one averaging factor, by its definition [Riley2008, eq. 10]."""
    theta = np.concatenate(([0.0], np.cumsum(x - x.mean())))
    d = theta[2 * n :] - 2.0 * theta[n:-n] + theta[: -2 * n]
    return np.sqrt(np.sum(d**2) / (2.0 * n**2 * d.size))


def test_the_curve_is_the_allan_deviation_of_all_samples_in_the_units_of_the_columns(tmp_path):
    sensed = still(9000)
    with serving(folder=tmp_path) as served, connect(served.socket_url()) as line:
        served.feed.say("hello", hello())
        feed(served, sensed[:2900])
        asking = Asking(line)
        for k in range(2900, 9000):  # a curve comes with samples
            feed(served, sensed[k : k + 1], first=k)
            asking.next()
            curves = [one for one in asking.texts("allan") if one["duration"] > 28.0]
            if curves:
                break
            time.sleep(0.01)
    curve = curves[0]
    assert set(curve["deviation"]) == {f"{name}.{axis}" for name in ("gyr", "acc") for axis in "xyz"}
    count = round(curve["duration"] * RATE) + 1
    for i, name in enumerate(curve["deviation"]):
        factor = 180.0 / np.pi if name.startswith("gyr") else 1.0
        for tau, dev in zip(curve["tau"], curve["deviation"][name], strict=True):
            expected = factor * overlapping(sensed[:count, i], round(tau * RATE))
            assert dev == pytest.approx(expected, rel=1e-9)


def part(first, sensed, **words):
    found = np.zeros(len(sensed), dtype=np.uint32)
    for row, word in words.get("flags", {}).items():
        found[row] = word
    return FedSamples((first + np.arange(len(sensed))) / RATE, found, sensed)


def test_the_allan_deviation_begins_again_behind_a_gap_and_behind_a_sample_that_is_missing():
    allan, sensed = Allan(), still(400)
    allan.take(part(0, sensed[:200]))
    assert allan.curve().duration == pytest.approx(1.99)
    allan.take(part(200, sensed[200:300], flags={40: flags.GAP}))
    assert allan.curve().duration == pytest.approx(0.59)
    allan.take(part(300, sensed[300:350], flags={0: flags.GAP}))
    assert allan.curve().duration == pytest.approx(0.49)
    broken = sensed[350:].copy()
    broken[20, 1] = np.nan
    allan.take(part(350, broken))
    assert allan.curve().duration == pytest.approx(0.28)
    allan.reset()
    assert allan.curve() is None
    sensed[:, 3:9] = np.nan  # a unit with no accelerometer has a curve of its gyroscope
    allan.take(part(400, sensed[:100]))
    assert set(allan.curve().deviation) == {"gyr.x", "gyr.y", "gyr.z"}


def test_a_guided_calibration_makes_the_card_that_a_recording_of_it_would_make(tmp_path):
    sensed = turned(6000)
    with asked(commands=True, folder=tmp_path) as (served, asking):
        assert "cannot be calibrated" in asking.ask("calibrate", name="mount")["text"]
        assert asking.ask("calibrate", name="mag")["ok"]
        assert "End that first" in asking.ask("calibrate", name="gyro")["text"]
        feed(served, sensed[:5900])
        guides = []
        deadline = time.monotonic() + 60.0
        for k in range(5900, 6000):
            feed(served, sensed[k : k + 1], first=k)
            time.sleep(0.01)
        while time.monotonic() < deadline and not (guides and guides[-1]["elapsed"] > 58.0):
            guides.append(asking.text(lambda one: one["type"] == "guide"))
        assert asking.state()["guide"] == "mag"
        answer = asking.ask("calibrate-end")
        assert answer["ok"], answer
        assert asking.state(lambda one: one["guide"] is None)
    last = guides[-1]
    assert sum(last["filled"]) >= 15 and last["share"] == pytest.approx(sum(last["filled"]) / 18)
    assert len(last["cloud"]) <= 400
    np.testing.assert_allclose(np.linalg.norm(last["cloud"], axis=1), 1.0, atol=2e-3)
    (path,) = tmp_path.glob("B-7-mag-*.card.json")
    assert answer["text"] == f"The card is {path}."
    card = CalibrationCard.load(path)
    t, triads = np.arange(6000) / RATE, {"gyr": sensed[:, :3], "acc": sensed[:, 3:6], "mag": sensed[:, 6:9]}
    imu = ImuData(t=t, **triads, temp_c=sensed[:, 9], meta=ImuMeta(device="B-7"))
    expected = calibrate(imu, "mag").card
    np.testing.assert_array_equal(card.mag.bias, expected.mag.bias)
    np.testing.assert_array_equal(card.mag.matrix, expected.mag.matrix)
    np.testing.assert_allclose(card.mag.bias, [12.0, -7.0, 3.0], atol=0.5)


def test_the_cards_so_far_is_completed_in_a_new_file(tmp_path):
    imu = ImuData(t=np.arange(6000) / RATE, mag=turned(6000)[:, 6:9], meta=ImuMeta(device="B-7"))
    before = tmp_path / "before.json"
    calibrate(imu, "mag").save(before)
    kept = before.read_bytes()
    with asked(commands=True, folder=tmp_path, card=str(before)) as (served, asking):
        assert asking.ask("calibrate", name="gyro")["ok"]
        feed(served, still(3000))
        answer = asking.ask("calibrate-end")
        assert answer["ok"], answer
        assert "card" not in asking.texts("hello")[0]
    (path,) = tmp_path.glob("B-7-gyro-*.card.json")
    assert set(CalibrationCard.load(path).parts) == {"mag", "gyr"}
    assert before.read_bytes() == kept


def test_a_capture_that_is_not_enough_or_whose_time_begins_again_makes_no_card_and_says_why(tmp_path):
    with asked(commands=True, folder=tmp_path, device="made-up") as (served, asking):
        assert asking.ask("calibrate", name="accel")["ok"]
        assert "nothing to calibrate" in asking.ask("calibrate-end")["text"]
        assert asking.ask("calibrate", name="accel")["ok"]
        feed(served, still(500))
        assert "which unit" in asking.ask("calibrate-end")["text"]  # it is called like its format
        assert asking.ask("calibrate", name="accel", text="B-7")["ok"]
        feed(served, still(500), first=500)
        assert not asking.ask("calibrate-end")["ok"]
        guide = asking.text(lambda one: one["type"] == "guide" and one["refused"])
        assert len(guide["refused"]) >= 1 and guide["card"] is None
        assert asking.ask("calibrate", name="gyro")["ok"] and asking.ask("calibrate-cancel")["ok"]
        assert "Nothing is being calibrated" in asking.ask("calibrate-cancel")["text"]
    assert list(tmp_path.glob("*.card.json")) == []
    with asked(commands=True, folder=tmp_path) as (served, asking):
        assert asking.ask("calibrate", name="gyro")["ok"]
        served.feed.say("reset")
        asking.text(lambda one: "given up" in one.get("text", ""))
        assert not asking.ask("calibrate-end")["ok"] and asking.ask("allan-reset")["ok"]
        asking.text(lambda one: one.get("text") == "allan-reset: The Allan deviation begins again.")


def test_lines_are_those_that_a_text_recording_would_have(tmp_path):
    with asked(folder=tmp_path) as (served, asking):
        asking.tick()
        served.play(BODY, 0, 300, size=7)
        asking.state(lambda one: one["t"] == 2.99)
        asking.state()
        lines = [text for one in asking.texts("lines") for text in one["lines"]]
    k = np.arange(0.0, 300.0, 5.0)  # 20 a second of 100
    track = AttitudeTrack(t=k / RATE, q_nb=BODY.attitude(k), frame=Frame.ENU, north=North.FREE)
    assert lines == [text.removesuffix("\n") for text in track_lines(track, head=False)]
