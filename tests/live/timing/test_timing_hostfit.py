"""The line beneath all points: where it lies, and what does not move it."""

import functools
from itertools import pairwise
from types import FunctionType

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given

from plumbob.core.flags import TIME_FAULT
from plumbob.core.time import BINS, bin_index, bin_middle, quantile
from plumbob.data.recording import delays
from plumbob.live.timing.delay import begin_line, line_at, observe
from plumbob.live.timing.spec import DRIFT, NOW, REALS, ROUGH, Counter, TimeSpec
from plumbob.live.timing.timebase import TimeBase, stamp_frames
from tests.helpers import examples, is_plain
from tests.helpers.clock_samples import START_NS, Frames, frames, hold, ticks, without

DEVICE_0, HOST_0 = 777_000_000_000, 1_790_000_000_000_000_000  # since a start; since 1970, beyond float64's 2**53
LEAST_NS = 250_000


def points(count=60_000, drift_ppm=40.0, mean_us=200.0, seed=4):
    """100 points a second with exponential delays above a least one."""
    rng = np.random.default_rng(seed)
    x = np.arange(count) * 10_000_000
    y = np.rint(x * (1.0 + 1e-6 * drift_ppm) + LEAST_NS + rng.exponential(mean_us * 1e3, count)).astype(np.int64)
    return DEVICE_0 + x, HOST_0 + y


def truth(device_ns, drift_ppm=40.0):
    return HOST_0 + LEAST_NS + (device_ns - DEVICE_0) * (1.0 + 1e-6 * drift_ppm)


class HostFit:
    """Follows ``host = offset + (1 + drift) · device`` as a time base does, for clocks of whole nanoseconds."""

    def __init__(self):
        self.real, self.origin, self.worst, self.resets = np.zeros(REALS), None, 0.0, 0
        self.histogram = np.zeros(BINS, dtype=np.int64)

    def observe(self, device_ns, host_ns):
        for device, host in zip(device_ns.tolist(), host_ns.tolist(), strict=True):
            first = self.origin is None
            self.origin = self.origin or (device, host)
            x, y = float(device - self.origin[0]), float(host - self.origin[1])
            if first or x < self.real[NOW]:
                self.resets += not first
                begin_line(self.real, x, y)
            delay = observe(self.real, x, y)
            self.worst = max(self.worst, delay)
            self.histogram[bin_index(delay)] += 1
            self.real[NOW] = x
        return self

    def to_host(self, device_ns):
        return self.origin[1] + round(line_at(self.real, float(device_ns - self.origin[0])))

    @property
    def drift_ppm(self):
        return 1e6 * self.real[DRIFT]


@pytest.mark.parametrize("drift_ppm", [-100.0, 40.0, 30_000.0])
def test_offset_and_drift(drift_ppm):
    """A block of 320 points of mean 200 µs has its lowest at 0.6 µs: 1e-2 ppm over 100 s, and 5 µs at the end."""
    device, host = points(drift_ppm=drift_ppm)
    fit = HostFit().observe(device, host)
    assert fit.drift_ppm == pytest.approx(drift_ppm, abs=0.02)
    assert fit.to_host(int(device[-1])) == pytest.approx(truth(device[-1], drift_ppm), abs=5_000)
    assert fit.resets == 0
    found = delays(fit.histogram, fit.worst)
    # quantiles of the exponential distribution: ln 2 and ln 100 means; bins are 6 % wide
    assert found.p50 == pytest.approx(200e-6 * np.log(2.0), rel=0.08)
    assert found.p99 == pytest.approx(200e-6 * np.log(100.0), rel=0.08)
    assert found.worst > found.p99


@pytest.mark.parametrize(("seconds", "believed_ppm"), [(9.8, 50_000.0), (10.8, 100_000.0)])
def test_a_drift_of_more_than_5_percent_is_believed_after_ten_seconds(seconds, believed_ppm):
    fit = HostFit().observe(*points(round(seconds * 100.0 / 1.1), drift_ppm=100_000.0))
    assert fit.drift_ppm == pytest.approx(believed_ppm, rel=0.01)


def test_no_point_is_below_the_line_when_it_comes_and_pieces_give_the_same_bits():
    fit, (device, host) = HostFit(), points(3000)
    for k in range(3000):
        fit.observe(device[k : k + 1], host[k : k + 1])
        assert fit.to_host(int(device[k])) <= host[k] + 1
    np.testing.assert_array_equal(HostFit().observe(device, host).real, fit.real)


def test_stalls_do_not_move_it_and_a_device_starts_again():
    device, host = points()
    held = host.copy()
    held[30_000:33_000] = np.maximum(held[30_000:33_000], held[33_000])  # 30 s
    fit = HostFit().observe(device, held)
    assert fit.drift_ppm == pytest.approx(40.0, abs=0.02)
    assert fit.to_host(int(device[-1])) == pytest.approx(truth(device[-1]), abs=5_000)
    assert fit.worst == pytest.approx(30e9, abs=0.1e9)
    device, host = points(6000)
    again = device.copy()
    again[3000:] -= again[3000] - 5
    fit = HostFit().observe(again, host)
    assert (fit.resets, fit.drift_ppm) == (1, pytest.approx(40.0, abs=1.0))
    moved = int(device[3000]) - 5
    assert fit.to_host(int(again[-1])) == pytest.approx(truth(int(again[-1]) + moved), abs=20_000)


def test_a_backlog_and_a_block_tell_nothing_of_the_drift():
    """Five seconds of points come at once, and then three as they are made: the first tell nothing of the drift."""
    device, host = points(800)
    host[:500] = host[500]
    assert abs(HostFit().observe(device, host).drift_ppm - 40.0) < 200
    # otherwise a line without a nominal rate would take it for a clock that is infinitely fast
    real = np.zeros(REALS)
    real[ROUGH] = 1.0
    begin_line(real, 0.0, 0.0)
    for k in range(500):
        observe(real, k * 1e7, 0.0)
    assert real[DRIFT] == 0.0
    fit = HostFit().observe(np.array([5, 5]), np.array([100, 90]))
    assert (fit.to_host(5), fit.drift_ppm) == (90, 0.0)


def test_bins_and_quantiles_of_delays():
    delays = np.unique(np.rint(np.geomspace(1.0, 1e18, 2000)))
    places = [bin_index(float(delay)) for delay in delays]
    assert places == sorted(places)
    assert 0 < places[0] <= places[-1] < BINS
    for delay, place in zip(delays, places, strict=True):
        assert bin_middle(place) == pytest.approx(delay, rel=1 / 32)
    assert bin_index(-1.0) == bin_index(0.0) == 0
    assert bin_index(1e300) < BINS
    histogram = np.zeros(2 * BINS, dtype=np.int64)
    assert quantile(histogram, 0, 0.5) == 0.0
    for delay in range(1, 101):
        histogram[BINS + bin_index(1000.0 * delay)] += 1
    assert quantile(histogram, 0, 0.5) == 0.0
    assert quantile(histogram, BINS, 0.5) == pytest.approx(50_000, rel=1 / 16)
    assert quantile(histogram, BINS, 1.0) == pytest.approx(100_000, rel=1 / 16)


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
