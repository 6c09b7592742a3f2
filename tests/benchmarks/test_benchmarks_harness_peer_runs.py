"""Other libraries on whole recordings: their frames and signs, what they refuse, and their figures on BROAD."""

import functools
import math
import sys
from dataclasses import replace
from importlib.metadata import version
from types import SimpleNamespace

import numpy as np
import pytest

from plumbob import Frame, Recording, evaluate, files, simulate
from plumbob.core.errors import ParameterError, ShapeError
from plumbob.core.units import deg
from plumbob.filters.offline import Stage
from plumbob.fleet.experiments.peers import peer_runs, peer_track
from plumbob.fleet.experiments.trials import KEYS, measure_accuracy, trials_in
from plumbob.fleet.experiments.variants import without_mag
from plumbob.rotations import North, change_frame, quat_angle, quat_from_euler_zyx, quat_multiply, quat_rotate

LIBRARIES = ["vqf", "imufusion", "ahrs"]

# On the 15 trials of BROAD that the tests know: total, heading and inclination RMSE in degrees, from a study that
# called each library by its own examples, with vqf 2.1.2 and imufusion 1.3.3, rounded to 0.001.
STUDY = {
    "vqf.VQF": (2.584, 2.429, 0.772), "vqf.BasicVQF": (3.824, 3.608, 1.055), "vqf.offlineVQF": (2.278, 2.179, 0.586),
    "imufusion(default)": (12.369, 11.443, 3.699), "imufusion(readme)": (10.859, 9.572, 3.638),
}  # fmt: skip
STUDIED = {"vqf": "2.1.2", "imufusion": "1.3.3"}


@functools.cache
def rocking():
    """Half a minute of a buoy without sensor errors, heading 40°, in ENU; the field is turned by its declination."""
    return simulate("buoy", frame=Frame.ENU, sensors="ideal", unit="calibrated", seed=4, duration=30.0)


def file_of(path, run):
    files.write(path, Recording(imu=run.imu, track=run.truth, name=path.stem))


class Broken:
    """A library whose answer is not finite after a while, or that raises."""

    name = settings = "broken"

    def __init__(self, error=None, last=10):
        self.error, self.last = error, last

    def attitudes(self, gyr, acc, mag, step):
        if self.error:
            raise self.error
        q = np.tile([1.0, 0.0, 0.0, 0.0], (len(gyr), 1))
        q[len(q) - self.last :, 2] = np.inf
        return q


@pytest.mark.parametrize("library", LIBRARIES)
@pytest.mark.parametrize("frame", [Frame.ENU, Frame.NED])
def test_each_peer_has_its_frame_and_signs_right(library, frame):
    """A wrong axis or sign is wrong by tens of degrees; ahrs.Madgwick, which follows the waves most, by 2.4°."""
    pytest.importorskip(library)
    run = rocking()
    truth = change_frame(run.truth.q_nb, to=frame, from_=Frame.ENU)
    for peer in peer_runs(library)[0]:
        track = peer_track(peer, run.imu, frame=frame)
        assert (track.frame, track.source) == (frame, peer.settings)
        assert math.degrees(np.median(quat_angle(track.q_nb[1500:], truth[1500:]))) < 5.0, peer.name


@pytest.mark.parametrize("library", [None, *LIBRARIES])
def test_a_known_declination_turns_the_heading_to_true_north(library):
    """Heading counts clockwise from above, yaw in ENU the other way: 10° east of north is −10° of yaw."""
    if library:
        pytest.importorskip(library)
    imu = rocking().imu
    known = replace(imu, meta=replace(imu.meta, declination=deg(10.0)))
    unknown = replace(imu, meta=replace(imu.meta, declination=None))
    turn = quat_from_euler_zyx([-deg(10.0), 0.0, 0.0])
    before = [triad.tobytes() for triad in (imu.gyr, imu.acc, imu.mag)]
    for peer in peer_runs(library)[0] if library else [Broken(last=0)]:
        true, magnetic = (peer_track(peer, one, frame=Frame.ENU) for one in (known, unknown))
        assert (true.north, magnetic.north) == (North.TRUE, North.MAGNETIC)
        assert quat_angle(true.q_nb, quat_multiply(turn, magnetic.q_nb)).max() < 1e-7  # of the arc cosine near 1
    assert [triad.tobytes() for triad in (imu.gyr, imu.acc, imu.mag)] == before


@pytest.mark.parametrize("library", LIBRARIES)
def test_without_a_magnetometer_each_peer_keeps_the_tilt_and_a_heading_of_its_own(library):
    """Waves of some degrees: ahrs.Mahony, which follows them most, is off by 2.4° of tilt."""
    pytest.importorskip(library)
    run = rocking()
    for peer in peer_runs(library)[0]:
        track = peer_track(peer, without_mag(run.imu), frame=Frame.ENU)
        assert track.north is North.FREE
        found = evaluate(track, run.truth, align=("heading",), settle=15.0).stats
        assert math.degrees(found["inclination"].rmse) < 4.0, peer.name
        assert math.degrees(found["heading"].rmse) < 4.0, peer.name


def test_the_ekf_of_ahrs_is_told_the_dip_of_the_field(monkeypatch):
    run, told = rocking(), []
    library = SimpleNamespace(filters=SimpleNamespace(EKF=lambda **given: told.append(given["magnetic_ref"])))
    monkeypatch.setitem(sys.modules, "ahrs", library)  # without an answer
    with pytest.raises(ShapeError, match=r"ahrs\.EKF rejects it"):
        peer_track(*peer_runs("ahrs.EKF")[0], run.imu, frame=Frame.ENU)
    x, y, z = quat_rotate(run.truth.q_nb[0], run.imu.mag[0])  # east, north, up
    assert told == [pytest.approx(math.degrees(math.atan2(-z, math.hypot(x, y))), abs=1.0)]


def test_one_peer_of_a_library_is_asked_for_by_its_name_and_others_are_refused():
    assert peer_runs("none") == ([], {})
    with pytest.raises(ParameterError, match="there is no peer 'px4'; known: vqf, imufusion, ahrs, all, none"):
        peer_runs("px4")
    pytest.importorskip("vqf")
    assert [peer.name for peer in peer_runs("vqf.offlineVQF,vqf.VQF")[0]] == ["vqf.offlineVQF", "vqf.VQF"]
    with pytest.raises(ParameterError, match=r"vqf gives no 'vqf.Best', but vqf.VQF, vqf.BasicVQF, vqf.offlineVQF"):
        peer_runs("vqf.Best")


# --- in the table -------------------------------------------------------------------------------------------


def test_a_trial_that_a_peer_refuses_is_skipped_for_all_with_the_peer_named(tmp_path):
    file_of(tmp_path / "good.parquet", rocking())
    run = rocking()
    mag = run.imu.mag.copy()
    mag[5] = np.nan
    with pytest.raises(ShapeError, match="mag is missing in some or all"):
        peer_track(Broken(), replace(run.imu, mag=mag), frame=Frame.ENU)
    file_of(tmp_path / "thin.parquet", replace(run, imu=replace(run.imu, mag=mag)))
    found = measure_accuracy(trials_in(tmp_path), [Stage("mahony", {})], peers=[Broken()])
    assert set(found.trials) == {"good"}
    assert "mag is missing" in found.skipped["thin.parquet"]
    refusing = Broken(ValueError("no field"))
    alone = measure_accuracy([tmp_path / "good.parquet"], [Stage("mahony", {})], peers=[refusing])
    assert set(alone.settings) == {"mahony"}
    assert alone.absent == {"broken": "broken rejects it: ValueError: no field"}


def test_an_attitude_that_is_not_finite_has_no_mean_and_progress_counts_every_run(tmp_path):
    for name in ("a", "b"):
        file_of(tmp_path / f"{name}.parquet", rocking())
    steps = []
    stages = [Stage("mahony", {}), Stage("tilt_compass", {})]
    found = measure_accuracy(trials_in(tmp_path), stages, peers=[Broken()], progress=lambda *now: steps.append(now))
    assert steps == [(done, 6) for done in range(1, 7)]
    assert found.mean()["broken"] == dict.fromkeys(KEYS)
    assert found.mean()["mahony"]["total_rmse_deg"] > 0.0
    assert found.text().splitlines()[-1].split() == ["broken", *4 * "–"]


def test_errors_of_a_peer_are_those_of_its_track(tmp_path):
    pytest.importorskip("vqf")
    file_of(tmp_path / "good.parquet", rocking())
    peers, _ = peer_runs("vqf")
    found = measure_accuracy(trials_in(tmp_path), [], peers=peers)
    recording = files.read(tmp_path / "good.parquet")
    for peer in peers:
        track = peer_track(peer, recording.imu, frame=Frame.ENU)
        summary = evaluate(track, recording.track).summary()
        assert found.trials["good"][peer.name] == {key: summary[key] for key in KEYS[:3]} | {KEYS[3]: summary[KEYS[0]]}
    assert "uses the whole recording" in found.settings["vqf.offlineVQF"]


def test_a_peer_that_is_not_installed_is_named_in_text_and_json(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "imufusion", None)  # Python's own way to say that there is none
    found, absent = peer_runs("imufusion")
    assert found == []
    file_of(tmp_path / "good.parquet", rocking())
    result = measure_accuracy(trials_in(tmp_path), [Stage("mahony", {})], peers=found, absent=absent)
    assert "left out: imufusion: " in result.text()
    assert "pip install imufusion" in result.summary()["absent"]["imufusion"]


@pytest.mark.parametrize("library", STUDIED)
def test_the_figures_of_the_study_on_broad(library, broad_folder):
    pytest.importorskip(library)
    if version(library) != STUDIED[library]:
        pytest.skip(f"the study had {library} {STUDIED[library]}")
    means = measure_accuracy(trials_in(broad_folder), [], peers=peer_runs(library)[0]).mean()
    for name, errors in means.items():
        assert tuple(errors.values())[:3] == pytest.approx(STUDY[name], abs=0.0006)  # its rounding, and ours of time
