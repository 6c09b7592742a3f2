"""A block that a transport sends twice is taken once: by every filter, and by the smoother on a stream."""

import numpy as np
import pytest

from plumbob import Filter, FixedLag, Frame, ImuData, ImuMeta, flags
from plumbob.core.time import REMEMBERED, Repeats
from plumbob.rotations import quat_angle
from tests.helpers.motion import consistent

N, AT = 1500, 700
DATA, TRUTH = consistent(N, amplitude=1.5)


def sent(count, times=1, changed=0.0):
    """Rows of the stream with a block that comes again, as parts of a stream are; the copies may say something else."""
    rows = np.insert(np.arange(N), [AT + count] * (count * times), np.tile(np.arange(AT, AT + count), times))
    again = np.zeros(rows.size, dtype=bool)
    again[AT + count : AT + count * (1 + times)] = True
    triads = {name: getattr(DATA, name)[rows] + changed * again[:, np.newaxis] for name in ("gyr", "acc", "mag")}
    none = np.zeros(rows.size, dtype=np.uint32)
    return ImuData.live(DATA.t_ns[rows], triads, flags=none, meta=ImuMeta(calibration="none needed")), again


@pytest.mark.parametrize(
    ("count", "times"), [(1, 1), (1, 3), (2, 1), (5, 3), (50, 1), (REMEMBERED, 1), (REMEMBERED, 3)]
)
@pytest.mark.parametrize("name", ["mekf", "vqf", "integrate"])
def test_a_filter_goes_on_as_if_nothing_had_come(name, count, times):
    stream, again = sent(count, times)
    once = Filter(name, frame=Frame.ENU, init=TRUTH[0]).process(sent(0)[0], look=False)
    whole, single = (Filter(name, frame=Frame.ENU, init=TRUTH[0]) for _ in range(2))
    track = whole.process(stream, look=False)
    assert track.flags.tolist() == [single.update(sample) for sample in stream.samples()]
    assert ((track.flags & flags.TIME_FAULT) != 0).tolist() == again.tolist()
    np.testing.assert_array_equal(track.q_nb[~again], once.q_nb)
    np.testing.assert_array_equal(single.q_nb, once.q_nb[-1])


def test_a_clock_that_is_set_back_is_followed_as_before():
    """The same times with other values: the third sample is taken, which would be the 53rd of a block sent twice."""
    stream, _ = sent(50, changed=1e-6)
    track = Filter("integrate", frame=Frame.ENU, init=TRUTH[0]).process(stream, look=False)
    assert np.count_nonzero(track.flags & flags.TIME_FAULT) == 2
    assert quat_angle(track.q_nb[-1], TRUTH[-1]) > 0.1  # 0.5 s at up to 1.5 rad/s
    stream, _ = sent(10)
    first = Filter("vqf", frame=Frame.ENU)
    first.process(stream[: AT + 10], look=False)
    words = Filter.restore(first.save()).process(stream[AT + 10 : AT + 20], look=False).flags
    assert (words & flags.TIME_FAULT).all()


@pytest.mark.parametrize(("lag", "size"), [("0 s", 1), ("0 s", N), ("1 s", 7)])
def test_the_smoother_leaves_it_out(lag, size):
    """The same attitudes to the bit, and none for the copies."""
    tracks = []
    for stream in (sent(50, 2)[0][400:1200], sent(0)[0][400:1100]):
        smoother = FixedLag(frame=Frame.ENU, params={"lag": lag})
        parts = [smoother.take(part) for part in stream.chunks(size)] + [smoother.finish()]
        tracks.append([np.concatenate([getattr(p, of) for p in parts if p is not None]) for of in ("t", "q_nb")])
    for with_copies, once in zip(*tracks, strict=True):
        np.testing.assert_array_equal(with_copies, once)


def test_the_smoother_leaves_it_out_sample_by_sample():
    stream, again = (of[400:1100] for of in sent(50))
    with_copies, once = FixedLag(frame=Frame.ENU), FixedLag(frame=Frame.ENU)
    words = np.array([with_copies.update(sample) for sample in stream.samples()])
    for sample in sent(0)[0][400:1050].samples():
        once.update(sample)
    np.testing.assert_array_equal((words & flags.TIME_FAULT) != 0, again)
    np.testing.assert_array_equal(with_copies.q_nb, once.q_nb)


def test_rows_are_known_again_for_a_while_and_bit_by_bit():
    """The same values at another time are no repeat."""
    rows = np.column_stack((np.arange(300.0), np.full(300, np.nan)))
    repeats = Repeats()
    assert repeats.fresh(rows).all() and not repeats.fresh(rows[-REMEMBERED:]).any()
    assert repeats.fresh(rows[:1]).all() and repeats.fresh([[np.nextafter(rows[-1, 0], 1e9), np.nan]]).all()
    assert repeats.fresh(-rows[-1:]).all()
    assert Repeats().fresh(np.column_stack((np.arange(1000.0), np.ones((1000, 9))))).all()
