"""The line beneath all points: where it lies, and what does not move it."""

import numpy as np
import pytest

from plumbob.core.time import BINS, bin_index, bin_middle, quantile
from plumbob.data.recording import delays
from plumbob.live.timing.delay import begin_line, line_at, observe
from plumbob.live.timing.spec import DRIFT, NOW, REALS, ROUGH

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
