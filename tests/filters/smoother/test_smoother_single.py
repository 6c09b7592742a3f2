"""Single samples without a lag: the bits of the stream, and between two keyframes hardly any work."""

import numpy as np
import pytest

import plumbob
from plumbob import ImuData, ImuMeta, ImuSample
from plumbob.core import flags
from plumbob.core._jit import jit_disabled
from plumbob.core.errors import ParameterError, ShapeError
from plumbob.filters.smoother import FixedLag
from tests.helpers.hand_motion import by_hand

slow = pytest.mark.skipif(jit_disabled(), reason="minutes in plain Python, whose bits are the same")

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


CASES = ("plain", "slow field", "held field", "missing", "stuck", "beyond", "gap")


@slow
@pytest.mark.parametrize("case", CASES)
def test_it_gives_the_bits_of_the_stream(case):
    h = by_hand(8.0, seed=1, rest=((3.0, 6.0),))
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


def test_between_keyframes_samples_wait():
    """Of five samples at 100 Hz four are no keyframe, 49 ms apart."""
    h = by_hand(4.0, seed=1)
    stream, taken = FixedLag(frame="ENU"), []
    stream.take = None
    whole, stream._take = stream._take, lambda data: taken.append(len(data)) or whole(data)
    for i in range(h.t.size):
        stream.update(ImuSample(round(h.t[i] * 1e9), h.gyr[i], h.acc[i], h.mag[i]))
    assert sum(taken) > h.t.size - 5
    assert len(taken) < 0.3 * h.t.size
    stream.reset()


def test_time_that_does_not_run_on_is_flagged_until_it_is_clear_that_the_clock_was_set_back():
    h = by_hand(2.0, seed=1)
    stream, ns = FixedLag(frame="ENU"), [round(t * 1e9) for t in h.t]
    for i in range(100):
        stream.update(ImuSample(ns[i], h.gyr[i], h.acc[i], h.mag[i]))
    before = stream.q_nb
    assert stream.update(ImuSample(ns[99], h.gyr[100], h.acc[100], h.mag[100])) & flags.TIME_FAULT
    assert (stream.q_nb == before).all()
    late = [stream.update(ImuSample(ns[i] - 10**15, h.gyr[i], h.acc[i], h.mag[i])) for i in range(100, 106)]
    assert [bool(word & flags.TIME_FAULT) for word in late] == [True, True, False, False, False, False]
    stream.reset()


def test_before_the_first_sample_and_after_a_reset_it_is_at_its_start():
    start = np.array([0.6, 0.0, 0.0, 0.8])
    stream = plumbob.FixedLag(frame="NED", init=start)
    h = by_hand(1.0, seed=1)
    rows, first = list(zip(h.t, h.gyr, h.acc, h.mag, strict=True)), []
    for _ in range(2):
        assert (stream.q_nb == start).all()
        assert (stream.bias_b == 0.0).all()
        assert np.diag(stream.cov_b) == pytest.approx([np.radians(1.0) ** 2] * 3)
        first.append([stream.update(ImuSample(round(t * 1e9), *v)) for t, *v in rows])
        stream.reset()
    assert first[0] == first[1]


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
