"""Estimators on folders of recordings: means per folder, paired differences, claims, refusals."""

from dataclasses import replace

import numpy as np
import pytest

import plumbob as pb
from plumbob import Frame, Recording, files, simulate
from plumbob.core.errors import DecodeError
from plumbob.core.units import deg
from plumbob.evaluation.metrics import INSIDE, inside_claim
from plumbob.filters.offline import Stage
from plumbob.fleet.experiments.trials import KEYS, SHARES, measure_accuracy, trials_in
from plumbob.rotations import dcm_from_quat, quat_from_rotvec, quat_multiply

TOTAL, CONVERGED = KEYS[0], KEYS[3]


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    """Two folders: two buoys, and one without a magnetometer."""
    root = tmp_path_factory.mktemp("trials")
    for folder, seeds in (("sea", (1, 2)), ("bare", (3,))):
        (root / folder).mkdir()
        for seed in seeds:
            how = {"frame": Frame.ENU, "sensors": "mpu6000+hmc5983", "unit": "calibrated", "rate": 50.0}
            run = simulate("buoy", **how, seed=seed, duration=40.0)
            imu = run.imu if folder == "sea" else replace(run.imu, mag=None)
            imu = replace(imu, meta=replace(imu.meta, calibration=None, acc_left=None, mag_left=None))
            files.write(root / folder / f"buoy{seed}.parquet", Recording(imu=imu, track=run.truth, name="buoy"))
    return root / "sea", root / "bare"


class Compass:
    """A library that needs a magnetometer, and then holds still."""

    name = settings = "compass"

    def attitudes(self, gyr, acc, mag, step):
        if mag is None:
            raise ValueError("it has no field")
        return np.tile([1.0, 0.0, 0.0, 0.0], (len(gyr), 1))


def stages(*names):
    return [Stage(name, {}) for name in names]


def test_means_are_over_each_folder_and_over_all(folders):
    found = measure_accuracy(trials_in(*folders), stages("mekf", "vqf"), align=("heading",), against="mekf")
    assert {name: len(trials) for name, trials in found.folders.items()} == {"sea": 2, "bare": 1}
    assert set(found.trials) == {"sea/buoy1", "sea/buoy2", "bare/buoy3"}
    each = [errors["vqf"][TOTAL] for errors in found.trials.values()]
    assert found.mean()["vqf"][TOTAL] == pytest.approx(np.mean(each))
    assert found.mean("sea")["vqf"][TOTAL] == pytest.approx(np.mean(each[:2]))
    assert found.mean("bare")["vqf"][TOTAL] == each[2]
    for trial, errors in found.trials.items():
        assert found.differences()[trial] == {"vqf": errors["vqf"][TOTAL] - errors["mekf"][TOTAL]}
    better = sum(row["vqf"] < 0.0 for row in found.differences().values())
    assert found.better()["vqf"] == (better, 3)


def test_files_and_recordings_are_taken_as_folders_are(folders, tmp_path):
    with pytest.raises(DecodeError, match="holds no recording; known suffixes are"):
        trials_in(tmp_path)
    paths = trials_in(folders[0] / "buoy1.parquet", folders[0] / "buoy2.parquet")
    read = [replace(files.read(path), name=path.stem) for path in paths]
    by_path, by_hand = (measure_accuracy(what, stages("vqf")) for what in (paths, read))
    assert by_path.trials == by_hand.trials == measure_accuracy(trials_in(folders[0]), stages("vqf")).trials
    assert set(by_path.trials) == {"buoy1", "buoy2"}
    twice = measure_accuracy([replace(recording, name="a.b") for recording in read], stages("vqf"))
    assert set(twice.trials) == {"a.b", "a.b (2)"}
    with pytest.raises(DecodeError, match="no sample is left to score"):
        measure_accuracy(read, stages("vqf"), between=(90.0, 99.0))


def test_an_estimator_that_takes_none_of_a_folder_is_left_out_and_a_refused_trial_counts_for_none(folders):
    found = measure_accuracy(trials_in(*folders), stages("mekf"), peers=[Compass()], align=("heading",))
    assert set(found.trials["bare/buoy3"]) == {"mekf"}
    assert "it has no field" in found.absent["compass (bare)"]
    assert found.mean("bare")["compass"] == found.mean()["compass"] == dict.fromkeys(KEYS)
    assert found.mean("sea")["compass"][TOTAL] > 5.0
    first = files.read(folders[0] / "buoy1.parquet").imu.acc[0, 0]

    class Picky(Compass):
        def attitudes(self, gyr, acc, mag, step):
            if acc[0, 0] == first:
                raise ValueError("not this one")
            return super().attitudes(gyr, acc, mag, step)

    found = measure_accuracy(trials_in(*folders), stages("mekf"), peers=[Picky()], align=("heading",))
    assert (set(found.trials), set(found.skipped)) == ({"sea/buoy2", "bare/buoy3"}, {"sea/buoy1.parquet"})
    assert found.mean("sea")["compass"] == found.trials["sea/buoy2"]["compass"]
    assert found.mean()["mekf"][TOTAL] == pytest.approx(np.mean([e["mekf"][TOTAL] for e in found.trials.values()]))


def test_every_sample_counts_those_of_the_converged_beside_and_only_a_part_of_the_time_may_count(folders):
    """The first seconds of a start in waves are those in which a filter says that it has not converged."""
    whole, first, start = (
        measure_accuracy(trials_in(folders[0]), stages("mekf", "tilt_compass"), between=time).trials["buoy1"]
        for time in (None, (0.0, 5.0), (0.0, 0.5))
    )
    assert start["mekf"][TOTAL] > 0.0 and start["mekf"][CONVERGED] is None
    assert start["tilt_compass"][TOTAL] == pytest.approx(start["tilt_compass"][CONVERGED])
    read = files.read(folders[0] / "buoy1.parquet")  # tilt_compass knows nothing of other samples
    alone = measure_accuracy([replace(read, imu=read.imu[:251], name="buoy1")], stages("tilt_compass")).trials["buoy1"]
    assert whole["tilt_compass"] != first["tilt_compass"] == pytest.approx(alone["tilt_compass"])
    converged = pb.evaluate(pb.estimate(read.imu, filter="mekf", frame="ENU").track, read).summary()[TOTAL]
    assert whole["mekf"][CONVERGED] == pytest.approx(converged, rel=1e-12) != whole["mekf"][TOTAL]


def test_a_recording_that_cannot_be_aligned_is_named_and_the_others_go_on(folders):
    """A reference that stands still does not show by how much another clock is off."""
    still, other = (replace(files.read(folders[0] / f"buoy{n}.parquet"), name=f"buoy{n}") for n in (1, 2))
    still = replace(still, track=still.track.with_attitude(np.tile(still.track.q_nb[0], (len(still.track), 1))))
    found = measure_accuracy([still, other], stages("mekf"), align=("time",))
    assert found.mean()["mekf"][TOTAL] == found.trials["buoy2"]["mekf"][TOTAL] > 0.0
    assert list(found.skipped) == ["buoy1"]


def test_claims_are_judged_where_there_are_any_and_a_declared_calibration_makes_them_narrower(folders):
    unknown, declared = (
        measure_accuracy(trials_in(folders[0]), stages("mekf", "vqf"), calibrated=told) for told in (False, True)
    )
    assert set(unknown.claims()) == {"mekf"}
    assert set(unknown.claims()["mekf"]) == set(SHARES)
    assert unknown.trials == declared.trials
    mean, worst = declared.claims()["mekf"]["tilt_motion"]
    assert worst <= mean <= 1.0
    assert unknown.claims()["mekf"]["tilt_motion"][1] >= worst
    start = measure_accuracy(trials_in(folders[0]), stages("mekf"), calibrated=True, between=(0.0, 20.0))
    assert start.claims()["mekf"]["tilt_motion"] != (mean, worst)
    assert unknown.calibration["buoy1"].startswith("NONE")
    assert declared.calibration["buoy1"] == "declared, no card"


def test_a_covariance_that_is_right_holds_95_percent_and_one_half_as_wide_68():
    """Errors drawn from the covariance; 67.3 % of a normal variable lie within 0.98 standard deviations."""
    rng, n = np.random.default_rng(4), 20_000
    q = rng.standard_normal((n, 4))
    q /= np.linalg.norm(q, axis=1, keepdims=True)
    sd_n = deg(np.array([0.3, 0.6, 2.0]))
    truth = quat_multiply(quat_from_rotvec(sd_n * rng.standard_normal((n, 3))), q)
    c_nb = dcm_from_quat(q)
    cov_b = np.swapaxes(c_nb, 1, 2) @ np.diag(sd_n**2) @ c_nb
    for factor, share in ((1.0, 0.95), (0.25, 0.6729)):
        heading, tilt = inside_claim(q, truth, factor * cov_b)
        assert heading.mean() == pytest.approx(share, abs=4.0 * np.sqrt(share * (1.0 - share) / n) + 1e-3)
        assert tilt.mean(axis=0) == pytest.approx(share, abs=0.015)


def test_an_error_at_the_limit_is_inside_and_a_free_heading_is_claimed_from_where_it_starts():
    q = np.array([[1.0, 0.0, 0.0, 0.0]])
    cov = np.diag(deg(1.0) ** 2 * np.ones(3))[np.newaxis]
    for size, expected in ((0.999, True), (1.001, False)):
        heading, tilt = inside_claim(q, quat_from_rotvec([[0.0, 0.0, size * INSIDE * deg(1.0)]]), cov)
        assert heading.tolist() == [expected]
        assert tilt.all()
        heading, tilt = inside_claim(q, quat_from_rotvec([[size * INSIDE * deg(1.0), 0.0, 0.0]]), cov)
        assert tilt.tolist() == [[expected, True]]
        assert heading.all()
    # 170° off throughout is its zero; what it turns from there, also across ±180°, is its error.
    off = deg(np.array([170.0, 171.5, 169.0, 190.5, 170.0]))
    q = np.tile([1.0, 0.0, 0.0, 0.0], (off.size, 1))
    truth = quat_from_rotvec(np.stack((0.0 * off, 0.0 * off, -off), axis=1))
    cov = np.tile(np.diag(deg(1.0) ** 2 * np.ones(3)), (off.size, 1, 1))
    heading, tilt = inside_claim(q, truth, cov, free=True)
    assert heading.tolist() == [True, True, True, False, True]
    assert not inside_claim(q, truth, cov)[0].any()
    assert tilt.all()
