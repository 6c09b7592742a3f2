"""Every filter against the battery, and the same bits as plain Python."""

import copy
import pickle

import numpy as np
import pytest

from plumbob import Filter, Frame, ImuData, ImuSample, filter_names
from plumbob.core.errors import ClockError, DecodeError, ShapeError
from plumbob.rotations import quat_from_euler_zyx
from tests.helpers import in_the_other_mode
from tests.helpers.filter_battery import FilterBattery, digest
from tests.helpers.motion import consistent, noisy


class TestEveryFilter(FilterBattery):
    pass


def test_compiled_and_plain_python_give_the_same_bits():
    given = {name: digest(name) for name in filter_names()}
    code = f"from tests.helpers.filter_battery import digest; given = {{name: digest(name) for name in {[*given]}}}"
    assert in_the_other_mode(code) == given


@pytest.mark.parametrize(("call", "error", "words"), [
    *(
        (lambda v=v, name=name: ImuSample(10_000_000, **{name: v}), ShapeError, rf"{name} of a sample .* \(3,\)")
        for name in ("gyr", "acc", "mag")
        for v in (np.zeros(2), np.zeros(0), np.zeros(6), np.zeros((1, 3)), np.zeros((3, 1)), 1.0)
    ),
    (lambda: ImuSample.packed(0, np.zeros(8)), ShapeError, r"values of a sample must have shape \(9,\)"),
    (lambda: ImuSample(0.01, gyr=np.zeros(3)), ClockError, r"whole number of nanoseconds, but it is 0\.01"),
    (lambda: Filter("mahony", frame=Frame.ENU).update([0.0] * 9), ShapeError, "takes an ImuSample, but got list"),
    (lambda: Filter("mahony", frame=Frame.ENU).process({}), ShapeError, "must be an ImuData, but it is a dict"),
])  # fmt: skip
def test_what_is_no_sample_and_no_recording_is_refused_by_name(call, error, words):
    with pytest.raises(error, match=words):
        call()
    assert ImuSample(np.int64(10_000_000)).t_ns == 10_000_000


@pytest.mark.parametrize("name", filter_names())
def test_streamed_impossible_and_absent_values_are_judged_as_in_a_recording(name):
    clean = consistent(300)[0]
    arrays = {k: getattr(clean, k).copy() for k in ("gyr", "acc", "mag")}
    for i, (triad, value) in enumerate([("gyr", 150), ("acc", 3e4), ("mag", 2e5), ("acc", np.inf), ("mag", np.nan)]):
        arrays[triad][50 * (i + 1)] = value
    data = ImuData(t=clean.t, **arrays)
    track = Filter(name, frame=Frame.ENU).process(data)
    f = Filter(name, frame=Frame.ENU)
    for i, t_ns in enumerate(data.t_ns.tolist()):
        assert f.update(ImuSample(t_ns, **{k: v[i] for k, v in arrays.items()})) == track.flags[i], i
        assert f.q_nb.tobytes() == track.q_nb[i].tobytes(), i


def test_a_restored_filter_remembers_its_start_attitude():
    start = quat_from_euler_zyx([0.3, 0.2, 0.1])
    f = Filter.restore(Filter("integrate", frame=Frame.ENU, init=start).save())
    f.reset()
    assert (f.q_nb == start).all()


@pytest.mark.parametrize("damage", [{"filter": None}, {"state": None}, {"state": [1.0]}, {"state": [np.nan] * 29}])
def test_a_damaged_saved_state_is_refused(damage):
    saved = {**Filter("integrate", frame=Frame.ENU).save(), **damage}
    with pytest.raises(DecodeError):
        Filter.restore({k: v for k, v in saved.items() if v is not None})
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
