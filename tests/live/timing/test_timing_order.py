"""Any frames, in any pieces: the same bits, times that never fall, counts that add up."""

import functools
from itertools import pairwise
from types import FunctionType

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given

from plumbob.core.flags import TIME_FAULT
from plumbob.core.time import quantile
from plumbob.live.timing.spec import Counter, TimeSpec
from plumbob.live.timing.timebase import TimeBase, stamp_frames
from tests.helpers import examples, is_plain
from tests.helpers.clock_samples import START_NS, Frames, frames, hold, ticks, without

SPECS = {
    "frames": TimeSpec(frames=Counter(8), rate=100.0), "frames-down": TimeSpec(frames=Counter(4, down=True)),
    "host": TimeSpec(rate=100.0, frame_bytes=26), "unknown": TimeSpec(),
    "clock": TimeSpec(clock=Counter(32, 1000), frames=Counter(8)),
    "short": TimeSpec(clock=Counter(16, 790, down=True), rate=100.0),
}  # fmt: skip
COLUMNS = ("t_ns", "step", "flags", "lost", "kind")


def said(spec, f):
    counts = {} if spec.clock is None else {"clock": ticks(f, spec.clock, 20.0)}
    if spec.frames is not None:
        counts["frames"] = (-f.index if spec.frames.down else f.index) % spec.frames.modulus
    return counts


@functools.cache
def troubled():
    """Bunches, stalls, losses, a double, a swap and a restart."""
    f = frames(3000, 100.0, 60.0, 16.0, stalls=0.5)
    f = f._replace(t_ns=START_NS + hold(f.t_ns - START_NS, 8e9, 3e9).astype(np.int64))
    f = without(f, np.random.default_rng(3).random(3000) < 0.03)
    f = without(f, slice(1200, 1500))
    order = np.insert(np.arange(f.index.size), 400, 399)
    order[[600, 601]] = order[[601, 600]]
    f = Frames(np.maximum.accumulate(f.t_ns[order]), 26 * np.arange(order.size), f.index[order], f.made_ns[order])
    later = np.arange(order.size) >= 1800
    return f._replace(index=f.index - later * 1700, t_ns=f.t_ns + later * 2 * 10**9)


def pieces(spec, f, cuts=(), reopen=()):
    base, stamps, counts = TimeBase(spec), [], said(spec, f)
    for a, b in pairwise([0, *sorted(cuts), f.t_ns.size]):
        if a in reopen:
            base.reopened(int(f.t_ns[a]))
        stamps.append(base.stamp(f.t_ns[a:b], f.place[a:b], **{name: c[a:b] for name, c in counts.items()}))
    return base.report(), {name: np.concatenate([getattr(part, name) for part in stamps]) for name in COLUMNS}


def assert_same(a, b):
    for name in COLUMNS:
        assert np.array_equal(a[1][name], b[1][name]), name
    assert repr(a[0]) == repr(b[0])  # not ==, because of nan


@pytest.mark.parametrize("name", SPECS)
class TestPieces:
    @given(cuts=st.lists(st.integers(0, 2600), max_size=20))
    @examples(0.02 if is_plain() else 0.2)
    def test_any_cut_gives_the_same_bits(self, name, cuts):
        f = troubled()
        cuts = [cut for cut in cuts if cut <= f.t_ns.size]
        assert_same(pieces(SPECS[name], f, [1000], {1000}), pieces(SPECS[name], f, [*cuts, 1000], {1000}))

    def test_one_by_one_and_nothing_depends_on_what_comes_later(self, name):
        f = troubled()
        start = Frames(*(column[:1000] for column in f))
        whole, begun = pieces(SPECS[name], f)[1], pieces(SPECS[name], start)
        assert_same(begun, pieces(SPECS[name], start, range(1, 1000)))
        for column in COLUMNS:
            assert np.array_equal(whole[column][:1000], begun[1][column])

    @pytest.mark.skipif(is_plain(), reason="there is no other")
    def test_plain_python_gives_the_same_bits(self, name, monkeypatch):
        f = Frames(*(column[700:1600] for column in troubled()))
        compiled = pieces(SPECS[name], f)
        monkeypatch.setattr("plumbob.live.timing.timebase.stamp_frames", plain(stamp_frames))
        monkeypatch.setattr("plumbob.data.recording.quantile", plain(quantile))
        assert_same(compiled, pieces(SPECS[name], f))


def plain(kernel):
    func = kernel.py_func
    names = dict(func.__globals__)
    for name in func.__code__.co_names:
        if hasattr(names.get(name), "py_func"):
            names[name] = plain(names[name])
    return FunctionType(func.__code__, names, func.__name__, func.__defaults__)


@given(
    steps=st.lists(
        st.tuples(
            st.integers(0, 2**62),  # of the counters
            st.sampled_from([0, 0, 0, 1, 1_000, 10**6, 10**7, 10**9, 10**11, -(10**9)]),  # of the host's clock
            st.integers(0, 100),  # of the place
            st.booleans(),
        ),
        max_size=120,
    ),
    name=st.sampled_from(sorted(SPECS)),
)
@examples(1.0)
def test_whatever_comes_times_do_not_fall_and_counts_add_up(steps, name):
    spec = SPECS[name]
    base, host, place, count, stamps = TimeBase(spec), 10**15, 0, 0, []
    counters = {key: getattr(spec, key) for key in ("clock", "frames") if getattr(spec, key) is not None}
    for jump, pause, further, wild in steps:
        host, place, count = host + pause, place + further, jump if wild else count + 1
        counts = {key: np.array([count % counter.modulus]) for key, counter in counters.items()}
        stamps.append(base.stamp(np.array([host]), np.array([place]), **counts))
    t, words, lost = ([int(getattr(part, key)[0]) for part in stamps] for key in ("t_ns", "flags", "lost"))
    used = [a for a, word in zip(t, words, strict=True) if not word & TIME_FAULT]
    assert all(count >= 0 for count in lost)
    assert all(b >= a for a, b in pairwise(t)) and all(b > a for a, b in pairwise(used))
    report = base.report()
    assert (report.frames, report.lost) == (len(steps), sum(lost))
    assert report.duplicates + report.late + report.ahead + report.unsure == len(t) - len(used)


@given(
    bits=st.sampled_from([8, 16, 32]),
    down=st.booleans(),
    losses=st.lists(st.tuples(st.integers(20, 60), st.integers(1, 700)), max_size=8),
    start=st.integers(0, 2**32),
)
@examples(0.6)
def test_a_counter_is_unwrapped_whatever_is_lost(bits, down, losses, start):
    """Losses need not be a whole number of turns, for those take patience; all else is known at once."""
    modulus = 1 << bits
    total = [0]
    for run, many in losses:
        total += [total[-1] + k + 1 for k in range(run)]
        total[-1] += many + (1 if (many + 1) % modulus == 1 else 0)
    total = np.array(total + [total[-1] + k + 1 for k in range(20)])
    f = frames(int(total[-1]) + 1, 100.0, -40.0)
    f = without(f, ~np.isin(f.index, total))
    count = (start - total if down else start + total) % modulus
    base = TimeBase(TimeSpec(frames=Counter(bits, down=down), rate=100.0))
    stamps = base.stamp(f.t_ns, f.place, frames=count)
    assert np.cumsum(stamps.step).tolist() == total.tolist()
    assert (stamps.lost[1:] == np.diff(total) - 1).all() and not (stamps.flags & TIME_FAULT).any()
