"""The smoother as its users meet it: the default of estimate and run, what is refused in words, and bad input."""

import json
import warnings

import numpy as np
import pytest

from plumbob import Filter, ImuData, ImuMeta, Stream, estimate, files, flags, load_session
from plumbob.core.errors import ParameterError, PlumbobError, ShapeError
from plumbob.filters.smoother import Smoother
from plumbob.live.session_toml import capture_session
from plumbob.rotations import quat_conjugate, quat_rotate
from tests.helpers.commandline import ok, plumbob
from tests.helpers.hand_motion import by_hand
from tests.helpers.live_samples import FORMAT, SESSION
from tests.helpers.motion import consistent


@pytest.fixture(scope="module")
def hand():
    return by_hand(6.0)


@pytest.fixture(scope="module")
def file(hand, tmp_path_factory):
    return files.write(tmp_path_factory.mktemp("smoother") / "hand.parquet", hand.imu())


# --- Python -------------------------------------------------------------------------------------------------


def test_estimate_smooths_unless_it_is_asked_otherwise(hand):
    """And warming up compiles it and leaves it as it was."""
    whole = Smoother(frame="ENU").process(hand.imu())
    assert (estimate(hand.imu()).track.q_nb == whole.q_nb).all()
    assert (estimate(hand.imu(), "smoother").track.q_nb == whole.q_nb).all()
    causal = Smoother(frame="ENU", params={"lag": "0 s"}).process(hand.imu())
    for asked in ({"causal": True}, {"causal": True, "filter": "smoother"}, {"lag": "0 s"}):
        track = estimate(hand.imu(), **asked).track
        for name in ("q_nb", "bias_b", "cov_b", "flags"):
            assert (getattr(track, name) == getattr(causal, name)).all()
    lagged = Smoother(frame="ENU", params={"lag": 1.0}).process(hand.imu()).q_nb
    assert (estimate(hand.imu(), lag="1s").track.q_nb == lagged).all()
    assert (estimate(hand.imu(), lag=1.0, params={"lag": 2.0}).track.q_nb == lagged).all()  # what is nearer decides
    assert (estimate(hand.imu(), params={"lag": "1s"}).track.q_nb == lagged).all()
    assert (lagged != whole.q_nb).any()
    smoother = Smoother(frame="ENU")
    assert (smoother.process(hand.imu()).q_nb == whole.q_nb).all()


@pytest.mark.parametrize(("arguments", "words"), [
    ({"filter": "mekf", "causal": True}, "causal is for the smoother, but filter is mekf"),
    ({"causal": True, "lag": 1.0}, "causal is a lag of 0 s, but lag is 1.0. Leave one of them out"),
    ({"filter": "vqf", "lag": 1.0}, "lag is for the smoother, but filter is vqf"),
    ({"init": "flat"}, "init must be level, truth or ROLL,PITCH,HEADING with units"),
    ({"init": "truth"}, "takes the first attitude of the recording's reference, but it has none"),
    ({"lag": "5 m"}, "'m' is not a unit of time"),
    ({"lag": -0.01}, "lag must be 0 to"),
    ({"params": {"kp": 1.0}}, "smoother has no parameter 'kp'; known: gyr_noise"),
    ({"params": {"max_gap": 1.0}}, "smoother has no parameter 'max_gap'"),  # it is the samples' own
    ({"params": {"speed": -1.0}}, "speed"),
    ({"filter": "smother"}, "there is no filter 'smother'; known: .*smoother"),
])  # fmt: skip
def test_what_contradicts_itself_is_refused_in_words(hand, arguments, words):
    with pytest.raises(ParameterError, match=words):
        estimate(hand.imu(), **arguments)


@pytest.mark.parametrize(("recorded", "words"), [
    (lambda hand: hand.imu(acc=None), "smoother needs gyr, acc, but the recording has no acc"),
    (lambda hand: hand.imu(gyr=kept(hand.gyr, [0])), "smoother needs two samples with a rate"),
    (lambda hand: hand.imu(gyr=kept(hand.gyr, [300])), "smoother needs two samples with a rate"),
    (lambda hand: {}, "data must be an ImuData, but it is a dict"),
])  # fmt: skip
def test_what_lacks_a_sensor_is_refused(hand, recorded, words):
    with pytest.raises(ShapeError, match=words):
        Smoother(frame="ENU").process(recorded(hand))


def test_a_stream_has_no_smoother_of_the_whole_and_a_session_without_a_name_one_without_a_lag(tmp_path):
    """Nor is it a Filter; each says what to do."""
    with pytest.raises(ParameterError, match=r"has a class of its own: plumbob\.FixedLag\(frame=\.\.\.\) takes single"):
        Filter("smoother", frame="ENU")
    asked = SESSION.replace('"mahony"', '"smoother"').replace('kp = 0.5, gate = "0.08 g"', 'lag = "off"')
    (tmp_path / "s.toml").write_text(asked, encoding="utf-8")
    (tmp_path / "imu9.toml").write_text(FORMAT, encoding="utf-8")
    with pytest.raises(ParameterError, match="on a stream the smoother cannot wait for the end, but lag is off"):
        load_session(tmp_path / "s.toml")
    with pytest.raises(PlumbobError):
        Smoother(frame="ENU").process(GOOD[:1])
    asked = SESSION.replace('filter = "mahony"', "").replace('params = { kp = 0.5, gate = "0.08 g" }', "")
    (tmp_path / "s.toml").write_text(asked, encoding="utf-8")
    (tmp_path / "imu9.toml").write_text(FORMAT, encoding="utf-8")
    (tmp_path / "sea.bin").write_bytes(b"")
    by_options = {"capture": tmp_path / "sea.bin", "format": tmp_path / "imu9.toml", "frame": "NED", "init": "level"}
    for chosen in (load_session(tmp_path / "s.toml"), capture_session(**by_options)):
        assert Stream(chosen).filter.params.lag == 0.0
    assert capture_session(**{**by_options, "init": None}).stage is None  # as long as nothing says to estimate


# --- command line -------------------------------------------------------------------------------------------


def test_run_says_how_it_smoothed(file, hand, tmp_path):
    assert "smoother (lag=1 s): smoothed with a lag of 1 s" in ok("run", file, "--lag", "1s").stdout
    assert ok("run", file, "--causal").stdout == ok("run", file, "--lag", "0s").stdout
    for words in (("--causal", "--lag", "1s"), ("--filter", "vqf", "--lag", "1s"), ("--filter", "vqf", "--causal")):
        assert plumbob("run", file, *words).returncode == 2
    found = json.loads(ok("run", file, "--json").stdout)
    assert "lag=off" in found["filter"]
    assert found["samples"] == hand.t.size
    track = Smoother(frame="ENU").process(hand.imu())
    last = quat_rotate(quat_conjugate(track.q_nb[-1]), [0.0, 0.0, 1.0])
    assert np.sin(np.radians(-found["last_attitude_deg"]["pitch"])) == pytest.approx(last[0], abs=1e-9)
    gap = files.write(tmp_path / "gap.parquet", hand.imu(t=hand.t + np.where(hand.t > 3.0, 2.0, 0.0)))
    assert "note: 1 gap in the samples (until 5.0 s): the tilt starts again" in ok("run", gap).stderr
    assert "smoother" in json.loads(ok("list", "filters", "--json").stdout)["filters"]


# --- bad input ----------------------------------------------------------------------------------------------

GOOD, _ = consistent(600)
TRIADS, STEPS = ("gyr", "acc", "mag"), (1e-9, 1.0, 60.0)
UNCHECKED = ImuMeta(unit_check=False)
NAN = np.full_like(GOOD.gyr, np.nan)


def kept(values, rows):
    """Values in some rows only."""
    some = np.full_like(values, np.nan)
    some[rows] = values[rows]
    return some


def one(values, value):
    changed = values.copy()
    changed[100] = value
    return changed


def stepped(step, at=300):
    return GOOD.t + np.where(np.arange(600) >= at, step, 0.0)


TINY = {name: 1e-300 * getattr(GOOD, name) for name in ("gyr", "acc", "mag")}
DAMAGED = {
    **{f"{n} samples": {k: getattr(GOOD, k)[:n] for k in ("t", "gyr", "acc", "mag")} for n in (2, 3, 5, 10, 30)},
    **{f"steps of {dt:g} s": {k: getattr(GOOD, k)[:80] for k in TRIADS} | {"t": dt * np.arange(80.0)} for dt in STEPS},
    "no field": {"mag": None},
    "one field": {"mag": kept(GOOD.mag, [0])},
    "last field": {"mag": kept(GOOD.mag, [599])},
    "one force": {"acc": kept(GOOD.acc, [300])},
    "two rates": {"gyr": kept(GOOD.gyr, [300, 301])},
    "rates at the ends": {"gyr": kept(GOOD.gyr, [0, 599])},
    "no rate": {"gyr": np.zeros_like(NAN)},
    "no force": {"acc": np.zeros_like(NAN), "meta": UNCHECKED},
    "a field of nothing": {"mag": np.zeros_like(NAN), "meta": UNCHECKED},
    "a field of 1e-9": {"mag": 1e-9 * GOOD.mag, "meta": UNCHECKED},
    "nearly nothing": {**TINY, "meta": UNCHECKED},
    "a huge force": {"acc": one(GOOD.acc, 1e6)},
    "a huge rate": {"gyr": one(GOOD.gyr, -1e9)},
    "a huge field": {"mag": one(GOOD.mag, np.inf)},
    "all forces large": {"acc": 1e3 * GOOD.acc, "meta": UNCHECKED},
    "all fields large": {"mag": 1e3 * GOOD.mag, "meta": UNCHECKED},
    "all rates large": {"gyr": 90.0 * GOOD.gyr},
    "a gap of days": {"t": stepped(2e5)},
    "the first sample alone": {"t": stepped(500.0, 1)},
    "the last sample alone": {"t": stepped(500.0, 599)},
    "noise": {
        name: scale * np.random.default_rng(0).normal(size=NAN.shape)
        for name, scale in (("gyr", 30.0), ("acc", 10.0), ("mag", 50.0))
    },
}
FLAGGED = {"a huge force": "acc-invalid", "a huge rate": "gyr-invalid", "a huge field": "mag-invalid"}


@pytest.mark.parametrize("params", [{}, {"lag": 2.0}], ids=["whole", "lag"])
@pytest.mark.parametrize("case", DAMAGED)
def test_whatever_comes_there_is_an_attitude_or_a_word(case, params):
    """Finite everywhere, a covariance that is one, no warning; or an error of the package."""
    imu = ImuData(**{"t": GOOD.t, "gyr": GOOD.gyr, "acc": GOOD.acc, "mag": GOOD.mag} | DAMAGED[case])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        track = Smoother(frame="ENU", params=params).process(imu)
    assert len(track) == len(imu)
    assert np.abs(np.linalg.norm(track.q_nb, axis=1) - 1.0).max() < 1e-9 and np.isfinite(track.bias_b).all()
    assert (track.cov_b == np.swapaxes(track.cov_b, 1, 2)).all() and np.linalg.eigvalsh(track.cov_b).min() > 0.0
    if case in FLAGGED:
        assert FLAGGED[case] in flags.counts(track.flags)
