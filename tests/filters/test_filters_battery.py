"""Every filter against the battery, and the same bits as plain Python."""

import copy
import hashlib
import os
import pickle
import subprocess
import sys

import numpy as np
import pytest

from plumbob import Filter, Frame, ImuData, ImuSample
from plumbob.core.errors import ClockError, DecodeError, ShapeError
from plumbob.filters import filter_names
from plumbob.rotations import quat_from_euler_zyx
from tests.helpers.filter_battery import FilterBattery, bits
from tests.helpers.motion import consistent, noisy


class TestEveryFilter(FilterBattery):
    pass


def digest(name):
    return hashlib.sha256(bits(Filter(name, frame=Frame.ENU).process(noisy()))).hexdigest()


@pytest.mark.parametrize("name", filter_names())
def test_compiled_and_plain_python_give_the_same_bits(name):
    other = "0" if os.environ.get("NUMBA_DISABLE_JIT", "0") == "1" else "1"
    code = f"from tests.filters.test_filters_battery import digest; print(digest({name!r}))"
    environment = {**os.environ, "NUMBA_DISABLE_JIT": other}
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", code], env=environment, capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == digest(name)


@pytest.mark.parametrize("wrong", [np.zeros(2), np.zeros(0), np.zeros(6), np.zeros((1, 3)), np.zeros((3, 1)), 1.0])
@pytest.mark.parametrize("triad", ["gyr", "acc", "mag"])
def test_a_sample_of_the_wrong_shape_is_refused(triad, wrong):
    with pytest.raises(ShapeError, match=rf"{triad} of a sample must have shape \(3,\)"):
        ImuSample(10_000_000, **{triad: wrong})
    with pytest.raises(ShapeError, match=r"values of a sample must have shape \(9,\)"):
        ImuSample.packed(0, np.zeros(8))


def test_a_sample_time_in_seconds_is_refused():
    with pytest.raises(ClockError, match=r"whole number of nanoseconds, but it is 0\.01"):
        ImuSample(0.01, gyr=np.zeros(3))
    assert ImuSample(np.int64(10_000_000)).t_ns == 10_000_000


@pytest.mark.parametrize(
    ("triad", "value"), [("gyr", 150.0), ("acc", 3e4), ("mag", 2e5), ("acc", np.inf), ("mag", np.nan)]
)
@pytest.mark.parametrize("name", filter_names())
def test_streamed_impossible_and_absent_values_are_judged_as_in_a_recording(name, triad, value):
    clean = consistent(300)[0]
    arrays = {k: getattr(clean, k).copy() for k in ("gyr", "acc", "mag")}
    arrays[triad][100] = value
    data = ImuData(t=clean.t, **arrays)
    track = Filter(name, frame=Frame.ENU).process(data)
    f = Filter(name, frame=Frame.ENU)
    for i, t_ns in enumerate(data.t_ns.tolist()):
        found = f.update(ImuSample(t_ns, **{k: v[i] for k, v in arrays.items()}))
        assert f.q_nb.tobytes() == track.q_nb[i].tobytes(), i
        assert found == track.flags[i], i


def test_a_restored_filter_remembers_its_start_attitude():
    start = quat_from_euler_zyx([0.3, 0.2, 0.1])
    f = Filter.restore(Filter("integrate", frame=Frame.ENU, init=start).save())
    f.reset()
    assert (f.q_nb == start).all()


@pytest.mark.parametrize(
    "damage", [{"filter": None}, {"state": None}, {"state": [1.0]}, {"state": [float("nan")] * 29}]
)
def test_a_damaged_saved_state_is_refused(damage):
    saved = {**Filter("integrate", frame=Frame.ENU).save(), **{k: v for k, v in damage.items() if v is not None}}
    for key in (k for k, v in damage.items() if v is None):
        del saved[key]
    with pytest.raises(DecodeError):
        Filter.restore(saved)
    with pytest.raises(DecodeError):
        Filter.restore({"kind": "something else"})


@pytest.mark.parametrize(("at", "value"), [(0, 1e300), (0, 0.0), (4, 1e300), (-1, -1e300), (1, 0.1)])
def test_a_saved_state_that_no_filter_can_come_to_is_refused(at, value):
    """Finite, and yet a quaternion without length or a bias beyond every number: it would go on with nonsense."""
    saved = Filter("mahony", frame=Frame.ENU).save()
    assert Filter.restore(saved).save() == saved
    saved["state"][at] = value
    with pytest.raises(DecodeError, match="it is damaged"):
        Filter.restore(saved)


@pytest.mark.parametrize("sample", [None, 5, [0.0] * 9])
def test_what_is_no_sample_is_refused_by_name(sample):
    with pytest.raises(ShapeError, match=f"update takes an ImuSample, but got {type(sample).__name__}"):
        Filter("mahony", frame=Frame.ENU).update(sample)


def test_what_is_no_recording_is_refused_by_name():
    with pytest.raises(ShapeError, match="data must be an ImuData, but it is a dict"):
        Filter("mahony", frame=Frame.ENU).process({})
    assert Filter("mahony", frame=Frame.NED).describe().startswith("mahony(kp=0.5 1/s")


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy, lambda f: pickle.loads(pickle.dumps(f))])  # noqa: S301
def test_a_copy_goes_on_by_itself(copied):
    samples = list(noisy().samples())
    first = Filter("vqf", frame=Frame.NED, params={"tau_acc": 2.0})
    for sample in samples[:100]:
        first.update(sample)
    second = copied(first)
    for sample in samples[100:200]:
        second.update(sample)
    assert (first.q_nb != second.q_nb).any()
    for sample in samples[100:200]:
        first.update(sample)
    assert first.q_nb.tobytes() == second.q_nb.tobytes()
