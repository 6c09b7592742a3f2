"""Single samples without a lag: the bits of the stream, and between two keyframes hardly any work."""

import numpy as np
import pytest

import plumbob
from plumbob import FixedLag, ImuData, ImuMeta, ImuSample, flags
from plumbob.core.errors import ParameterError, ShapeError
from plumbob.filters.smoother.live import Live
from tests.helpers import slow_as_python
from tests.helpers.hand_motion import by_hand

META = ImuMeta(declination=0.05, calibration="by hand", gyr_range=30.0)


def odd(h, name):
    """Arrays of a recording with what streams bring."""
    gyr, acc, mag = h.gyr.copy(), h.acc.copy(), h.mag.copy()
    if name == "slow field":
        mag[np.arange(len(mag)) % 5 != 0] = np.nan
    elif name == "held field":
        mag = mag[np.arange(len(mag)) // 7 * 7]
    elif name == "missing":
        gyr[300:303], acc[420:430], mag[500:600] = np.nan, np.nan, np.nan
    elif name == "stuck":
        gyr[300:350], acc[400:460] = gyr[300], acc[400]
    elif name == "beyond":
        gyr[300], acc[400], mag[500, 1] = 31.0, 4000.0, np.nan
    return gyr, acc, mag


@slow_as_python
@pytest.mark.parametrize("case", ["slow field", "held field", "missing", "stuck", "beyond", "gap"])
def test_it_gives_the_bits_of_the_stream(case):
    h = by_hand(6.5, seed=1, rest=((3.0, 6.0),))
    h = h.rows((h.t < 4.0) | (h.t > 4.6)) if case == "gap" else h
    gyr, acc, mag = odd(h, case)
    t_ns = np.round(h.t * 1e9).astype(np.int64)
    parts, single = (FixedLag(frame="NED", meta=META, init="10deg,0deg,90deg") for _ in range(2))
    known = np.zeros(t_ns.size, dtype=np.uint32)
    track = parts.take(ImuData.live(t_ns, {"gyr": gyr, "acc": acc, "mag": mag}, flags=known, meta=META))
    parts.finish()
    for i, time in enumerate(t_ns.tolist()):
        sample = ImuSample(10**18 + time, gyr[i], acc[i], mag[i])  # any clock
        assert single.update(sample) == track.flags[i], i
        assert (single.q_nb == track.q_nb[i]).all(), i
        assert (single.bias_b == track.bias_b[i]).all(), i
        if i % 37 == 0:  # asking for the covariance takes what waits
            assert (single.cov_b == track.cov_b[i]).all(), i
    single.reset()


def test_between_keyframes_samples_wait(monkeypatch):
    """Of ten samples at 100 Hz nine are no keyframe, 99 ms apart."""
    h, taken, take = by_hand(4.0, seed=1), [], Live.take
    monkeypatch.setattr(Live, "take", lambda self, data: taken.append(len(data)) or take(self, data))
    stream = FixedLag(frame="ENU")
    for sample in h.imu().samples():
        stream.update(sample)
    assert sum(taken) > h.t.size - 10 and len(taken) < 0.2 * h.t.size
    stream.reset()


def test_time_that_does_not_run_on_is_flagged_until_it_is_clear_that_the_clock_was_set_back():
    stream, ahead = FixedLag(frame="ENU"), list(by_hand(2.0, seed=1).imu().samples())
    for sample in ahead[:100]:
        stream.update(sample)
    before = stream.q_nb
    assert stream.update(ImuSample.packed(ahead[99].t_ns, ahead[100].values)) & flags.TIME_FAULT
    assert (stream.q_nb == before).all()
    late = [stream.update(ImuSample.packed(s.t_ns - 10**15, s.values)) for s in ahead[100:106]]
    assert [bool(word & flags.TIME_FAULT) for word in late] == [True, True, False, False, False, False]
    stream.reset()


def test_before_the_first_sample_and_after_a_reset_it_is_at_its_start():
    start = np.array([0.6, 0.0, 0.0, 0.8])
    stream, words = plumbob.FixedLag(frame="NED", init=start), []
    for _ in range(2):
        assert (stream.q_nb == start).all() and (stream.bias_b == 0.0).all()
        assert np.diag(stream.cov_b) == pytest.approx([np.radians(1.0) ** 2] * 3)
        words.append([stream.update(sample) for sample in by_hand(1.0, seed=1).imu().samples()])
        stream.reset()
    assert words[0] == words[1]


def test_what_cannot_be_is_refused_in_words():
    with pytest.raises(ParameterError, match=r"update gives the attitude at once, but lag is 5 s\. Leave lag out"):
        FixedLag(frame="ENU", params={"lag": "5s"}).update(ImuSample(0))
    stream = FixedLag(frame="ENU")
    with pytest.raises(ShapeError, match="update takes an ImuSample, but got dict"):
        stream.update({})
    with pytest.raises(ParameterError, match=r"update takes the samples of this stream\. Call reset\(\)"):
        stream.take(by_hand(1.0).imu())
    stream.reset()
    stream.take(by_hand(1.0).imu())
    stream.finish()
