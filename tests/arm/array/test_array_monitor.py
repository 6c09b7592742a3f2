"""The trackers are the full filter, a stream is the whole, and each fault is isolated, left out and taken back."""

from dataclasses import replace

import numpy as np
import pytest

from plumbob import flags
from plumbob.arm.array import Monitor, monitor
from plumbob.arm.array.monitoring import MonitoringSettings
from plumbob.core.errors import ParameterError
from plumbob.core.units import dps
from tests.helpers.arm_samples import ImuArray, ImuData, UnitMount, as_array, card, moved

FIXED = MonitoringSettings(gyr_bias=0.02, gyr_walk=1e-3, scale=0.0, scale_walk=0.0, adapt=0.0)


def full_filter(y, dt, n_rpsd, bias, walk, aid, aid_sd):
    """Kalman filter of an angle and the bias of each of n gyroscopes (N, n), aided by the angle; its states.

    The mean rate turns the angle. What the units measure beyond it is n − 1 independent numbers: their noise is that of
    one unit, and uncorrelated with the mean's.
    """
    n = y.shape[1]
    basis = np.linalg.svd(np.eye(n) - 1.0 / n)[0][:, : n - 1]
    x, p = np.zeros(n + 1), np.diag([1.0, *[bias**2] * n])
    f, h = np.eye(n + 1), np.zeros((n, n + 1))
    f[0, 1:] = -dt / n
    h[: n - 1, 1:], h[n - 1, 0] = basis.T, 1.0
    r = np.diag([*[n_rpsd**2 / dt] * (n - 1), aid_sd**2])
    found = []
    for row, angle in zip(y, aid, strict=True):
        x = f @ x
        x[0] += dt * row.mean()
        p = f @ p @ f.T + np.diag([n_rpsd**2 * dt / n, *[walk**2 * dt] * n])
        k = p @ h.T @ np.linalg.inv(h @ p @ h.T + r)
        x = x + k @ (np.array([*basis.T @ row, angle]) - h @ x)
        p = (np.eye(n + 1) - k @ h) @ p
        found.append(x)
    return np.array(found)


def test_a_filter_on_the_mean_and_a_tracker_for_each_unit_are_the_full_filter():
    """Closed form for units of equal noise; papers.md found 4e-15 in its own simulation."""
    rng, dt, n = np.random.default_rng(3), 0.1, 5
    t = dt * np.arange(300)
    y = 0.3 * np.sin(t)[:, np.newaxis] + 0.02 * rng.normal(size=n) + 1e-2 * rng.normal(size=(300, n))
    aid = 0.3 * (1.0 - np.cos(t)) + 1e-2 * rng.normal(size=300)
    n_rpsd = 1e-2 * np.sqrt(dt)
    full = full_filter(y, dt, n_rpsd, FIXED.gyr_bias, FIXED.gyr_walk, aid, 1e-2)
    # one unit of 1/√n of the noise, of the bias and of its walk is the mean
    mean = full_filter(
        y.mean(axis=1, keepdims=True), dt, n_rpsd / np.sqrt(n), FIXED.gyr_bias / np.sqrt(n),
        FIXED.gyr_walk / np.sqrt(n), aid, 1e-2,
    )  # fmt: skip
    mounts = {f"u{i}": UnitMount(noise=card(gyr=n_rpsd)) for i in range(n)}
    watch = Monitor(mounts, step=dt, settings=FIXED)
    parity = []
    for i in range(300):
        gyr = y[i : i + 1, :, np.newaxis] * np.ones(3)
        watch.take(ImuArray({f"u{u}": ImuData(t[i : i + 1], gyr=gyr[:, u]) for u in range(n)}, mounts))
        parity.append(watch.relative["gyr"][:, 0, 0])
    assert mean[:, 0] == pytest.approx(full[:, 0], abs=1e-13)
    assert mean[:, 1:] + np.array(parity) == pytest.approx(full[:, 1:], abs=1e-13)
    assert np.ptp(full[-1, 1:]) > 0.02  # and the biases are not nothing


@pytest.fixture(scope="module")
def moving():
    found = moved(11, 60.0, moving=True)
    found["u2"]["gyr"][300:400, 1] += dps(0.5)
    found["u4"]["mag"][::2] = np.nan
    return as_array(found)


@pytest.mark.parametrize("size", [1, 7, 250])
def test_a_stream_cut_anywhere_gives_the_same_bits(moving, size):
    whole = monitor(moving)
    watch = Monitor(moving.mounts, step=float(np.median(np.diff(moving.t))))
    parts = [watch.take(part) for part in moving.chunks(size)]
    assert whole.words.any()
    assert np.array_equal(np.concatenate([part.words for part in parts]), whole.words)
    for triad in ("gyr", "acc", "mag"):
        joined = np.concatenate([getattr(part.imu, triad) for part in parts])
        assert joined.tobytes() == getattr(whole.imu, triad).tobytes()
    assert np.array_equal(np.concatenate([part.imu.flags for part in parts]), whole.imu.flags)
    with pytest.raises(ParameterError, match="Make a monitor for each array"):
        Monitor({"a": UnitMount(), "b": UnitMount()}, step=0.1).take(moving)
    with pytest.raises(ParameterError, match="step"):
        Monitor({"a": UnitMount()}, step=0.0)
    with pytest.raises(ParameterError, match="must be positive numbers"):
        Monitor({"a": UnitMount()}, step=0.1, settings=MonitoringSettings(tau=0.0))


def broken(kind, triad, values, rng, rows):
    out = values.copy()
    if kind == "frozen":
        out[rows] = values[rows.start]
    elif kind == "biased":
        out[rows, 0] += {"gyr": dps(0.5), "acc": 0.5, "mag": 3.0}[triad]
    elif kind == "scaled":
        out[rows] *= 1.03
    elif kind == "noisy":
        out[rows] += {"gyr": dps(1.0), "acc": 1.0, "mag": 5.0}[triad] * rng.normal(size=out[rows].shape)
    elif kind == "swapped":
        out[rows] = values[rows][:, [1, 2, 0]]
    else:
        out[rows] = np.nan
    return out


SAYS = {"frozen": {"frozen"}, "dead": {"dead"}, "noisy": {"noisy"}}


@pytest.mark.parametrize("triad", ["gyr", "acc", "mag"])
@pytest.mark.parametrize("kind", ["frozen", "biased", "scaled", "noisy", "swapped", "dead"])
def test_each_fault_is_isolated_left_out_and_the_unit_taken_back(kind, triad):
    found = moved(21, 90.0, moving=True)  # moves from 20 s to 40 s and from 60 s to 80 s
    late = kind in {"scaled", "swapped"} and triad == "gyr"  # nothing shows a scale of no rate
    rows = slice(600, 750) if late else slice(450, 600)  # the second in rest, then in motion
    found["u5"][triad] = broken(kind, triad, found["u5"][triad], np.random.default_rng(1), rows)
    seen = monitor(as_array(found))
    begin = 60.0 if late else 45.0
    first = seen.faults[0]
    assert (first.unit, first.triad) == ("u5", triad)
    assert begin <= first.begin <= begin + 5.0
    assert first.kind in SAYS.get(kind, {"deviates", "noisy"})
    assert {(fault.unit, fault.triad) for fault in seen.faults} == {("u5", triad)}
    assert not seen.words[-1].any()  # taken in again
    assert (seen.imu.flags[int(10 * begin) + 60] & flags.UNIT_EXCLUDED) != 0


def test_nothing_wrong_is_nothing_said():
    """papers.md: no false alarm in three hours; here a quarter of one, at rest and moving in turn."""
    seen = monitor(as_array(moved(5, 900.0, moving=True)))
    assert seen.faults == ()
    assert not (seen.imu.flags & np.uint32(flags.UNIT_EXCLUDED | flags.CANNOT_ISOLATE)).any()
    assert "No unit contradicts the others." in seen.text()


def test_two_units_or_two_faults_of_three_cannot_be_isolated():
    found = moved(6, 60.0, moving=False, units=2)
    found["u1"]["gyr"][300:, 0] += dps(0.5)
    seen = monitor(as_array(found))
    said = (seen.imu.flags & np.uint32(flags.CANNOT_ISOLATE)) != 0
    assert not said[:300].any() and said[320:].all()
    assert seen.faults == ()
    # +f and −f on two of three: the third is the middle, and its value is what the body gets.
    found = moved(8, 60.0, moving=False, units=3)
    found["u1"]["gyr"][300:, 0] += dps(2.0)
    found["u2"]["gyr"][300:, 0] -= dps(2.0)  # its x axis lies along the body's, too
    seen = monitor(as_array(found))
    after = slice(330, 600)
    assert ((seen.imu.flags[after] & np.uint32(flags.CANNOT_ISOLATE)) != 0).all()
    bias = found["u3"]["gyr"][:300, 0].mean() - np.mean([found[f"u{i}"]["gyr"][:300, 0].mean() for i in (1, 2, 3)])
    assert seen.imu.gyr[after, 0] == pytest.approx(found["u3"]["gyr"][after, 0] - bias, abs=dps(0.05))


def test_a_unit_that_goes_does_not_move_the_combined_rate():
    """Biases of ±0.13 °/s: without the trackers the mean would step by a fifth of the unit's, 0.02 °/s."""
    found = moved(9, 120.0, moving=False)
    found["u1"]["gyr"][:, 0] += dps(1.0)  # from the start: a bias, and not a fault
    found["u1"]["gyr"][600:] = np.nan
    seen = monitor(as_array(found), settings=MonitoringSettings(gyr_bias=dps(2.0)))
    assert [(fault.unit, fault.kind) for fault in seen.faults] == [("u1", "dead")]
    step = seen.imu.gyr[606:, 0].mean() - seen.imu.gyr[100:600, 0].mean()
    # means of 500 samples of 0.1/√6 °/s scatter by 0.0026 °/s, the tracker's walk adds 0.002 √60 /√5 °/s
    assert abs(step) < dps(0.03)


@pytest.mark.parametrize("moving", [False, True])
def test_without_noise_cards_noise_is_that_of_the_samples_and_no_fault(moving):
    """The gyroscopes' noise is 5.5 times that of a common part, the other sensors' 10 and 1.6 times."""
    found = moved(5, 90.0, moving=moving)
    bare = as_array(found)
    bare = ImuArray(bare.units, {name: replace(mount, noise=None) for name, mount in bare.mounts.items()})
    assert monitor(bare).faults == ()
    found["u2"]["gyr"][310:600, 0] += dps(0.5)
    broken = ImuArray(as_array(found).units, bare.mounts)
    assert [(f.unit, f.triad) for f in monitor(broken).faults] == [("u2", "gyr")]
