"""Every unit of the teaching arm: emulated, recorded, read as an array, equal to what its bytes say."""

import functools
import json
from collections import Counter
from dataclasses import fields, replace

import numpy as np
import pytest

import plumbob
from plumbob import Stream, apply_card, find_format, read_array
from plumbob.arm import JointTrack, run
from plumbob.arm.array import Monitor
from plumbob.core.errors import ClockError, DecodeError, ParameterError, PlumbobError
from plumbob.data import TRIADS, ImuData, ImuMeta
from plumbob.data.array import PRESETS, ImuArray, UnitMount
from plumbob.data.cards import CalibrationCard, TriadCalibration
from plumbob.data.chain import chain_text
from plumbob.files.mcap import open_log, repair, verify
from plumbob.live.recorded import read_recorded
from plumbob.live.rigs.rig import PLANS, make_rig
from plumbob.live.session_toml import of_unit, parse_session
from plumbob.live.transports.transport import Received
from plumbob.protocols.decode import decode, triads_of
from tests.helpers import beside
from tests.helpers.commandline import ok, refused
from tests.helpers.live_samples import CHAIN, through

UNITS = ("u1", "u2", "u3", "u4", "u5", "u6")
ALL = beside(__file__, "all_units.toml")


@functools.cache
def arm(seed=1, duration=6.0):
    return make_rig(PLANS["arm"], find_format("arm"), seed=seed, duration=duration, unit="random").frames.tobytes()


def session(text=ALL, **files):
    return parse_session(text, files.__getitem__, name="arm")


def items(data, size=130):
    """Reads at 10 Hz that do not end where frames end, so that a part has one or two of them, or none."""
    rng, at, received = np.random.default_rng(4), 0, []
    while at < len(data):
        end = min(len(data), at + int(rng.integers(1, 3 * size)))
        received.append(Received(5_000_000_000 + end * 100_000_000 // size, data[at:end]))
        at = end
    return received


def card(device, scale):
    part = TriadCalibration(scale * np.eye(3), np.array([0.01, 0.0, -0.02]), "rad/s", "rad/s")
    return CalibrationCard(device=device, gyr=part, date="2024-05-01", method="test")


CARDS = beside(__file__, "unit_cards.toml")
FILES = {
    "arm.json": card("arm", 1.0).text(),
    "u4.json": card("arm 7 u4", 1.02).text(),
    "u2.json": card("arm 7 u2", 0.97).text(),
}
U2 = ALL.replace('units = "all"', 'unit = "u2"')


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    """Of all units, and what was made of it live; nobody writes beside it."""
    path = tmp_path_factory.mktemp("array") / "a.mcap"
    return path, record(path, arm())


def record(path, data, text=ALL, **spec):
    return through(items(data), session(text, **FILES), recording=path, **spec)[1]


def assert_decoded(array, data, names=UNITS):
    """Each unit has the numbers that its bytes have, to the bit."""
    frames = decode(data, find_format("arm")).frames["arm"]
    assert array.names == tuple(names)
    assert len(array) == len(frames) > 0
    for name in names:
        for triad, values in triads_of(frames, name).items():
            assert getattr(array.units[name], triad).tobytes() == values.tobytes(), (name, triad)


def assert_same(mine, other, *, but=()):
    assert mine.names == other.names
    assert dict(mine.mounts) == dict(other.mounts)
    for name in mine.names:
        for field in (f.name for f in fields(ImuData) if f.name not in but):
            a, b = getattr(mine.units[name], field), getattr(other.units[name], field)
            assert a.tobytes() == b.tobytes() if isinstance(a, np.ndarray) else a == b, (name, field)


def test_units_of_a_line_are_one_that_leaves_out_who_is_wrong_as_of_a_file():
    text = ALL + '[array]\nscheme = "monitor"\n'
    found = through(items(arm(duration=20.0)), session(text))[1]
    array = through(items(arm(duration=20.0)), session())[1].array(calibrated=True)
    whole = Monitor(array.mounts, step=0.1).take(array).imu
    one = found.imu(calibrated=True)
    assert len(found.parts) > 20
    for triad in TRIADS:
        np.testing.assert_array_equal(getattr(one, triad), getattr(whole, triad))
    np.testing.assert_array_equal(one.flags, whole.flags)


def test_whole_from_the_emulator_to_a_file(tmp_path):
    """emulate, record all, read, convert, read: equal to decoding the bytes directly."""
    raw, mcap, native = tmp_path / "arm.bin", tmp_path / "arm.mcap", tmp_path / "arm.parquet"
    plumbob.emulate("arm", seed=2, duration=5.0, write=raw)
    kept = plumbob.record(capture=raw, format="arm", unit="all", out=mcap, filter="mahony", frame="NED")
    assert not kept.lossy
    assert kept.summary()["units"] == list(UNITS)
    array = read_array(mcap, mounts="arm")
    assert_decoded(array, raw.read_bytes())
    assert dict(array.mounts) == dict(PRESETS["arm"])
    assert_same(read_array(raw, format="arm", mounts="arm"), array, but=("t", "meta"))
    plumbob.convert(mcap, native)
    assert_same(read_array(native, mounts="arm"), array)
    plumbob.convert(native, tmp_path / "again.mcap")
    assert_same(read_array(tmp_path / "again.mcap", mounts="arm"), array)


TEACH = chain_text(PLANS["teach"].scenario.chain)
UNFIT = [
    ('pose = "zero"', 'pose = ["10 deg", "0 deg"]', "pose needs 6 finite angles"),
    ('pose = "zero"', 'params = { gyro_nois = "1 deg/s/rtHz" }', "gyro_nois"),
    ('pose = "zero"', 'button = "trigger"', "chain.button"),
    ('units = "all"', 'unit = "u1"', "needs several units"),
    ('imu = { frame = "NED" }', "", "needs imu.frame"),
    ('"teach.toml"', '"other.toml"', "the segment 'link6' has the unit 'u7'"),
    ('"teach.toml"', '"bad.json"', "bad.json"),
]


def test_joint_angles_of_a_line_are_those_of_its_recording_written_and_sent(tmp_path):
    raw, mcap, text, sent = (tmp_path / name for name in ("teach.bin", "a.mcap", "a.txt", "a.jsonl"))
    plumbob.emulate("teach", write=raw, seed=1, duration=6.0, unit="calibrated")
    (tmp_path / "teach.toml").write_text(TEACH)
    (tmp_path / "s.toml").write_text(f'{CHAIN}[source]\nkind = "file"\npath = "teach.bin"\n')
    ran = plumbob.record(tmp_path / "s.toml", out=mcap, text=text, send=[f"json file:{sent}"])
    live = JointTrack.load(mcap)
    whole = run(tmp_path / "teach.toml", mcap, frame="NED", pose="zero", causal=True).joints
    for name in ("t", "angles", "sd", "hand", "hand_sd", "flags"):
        assert getattr(live, name).tobytes() == getattr(whole, name).tobytes(), name
    again = plumbob.replay(mcap, check=True)
    assert again.comparison.equal and again.comparison.compared == len(live) == 600
    said = [line.split("\t") for line in text.read_text().splitlines()[1:]]
    rows = np.searchsorted(live.t, [float(line[0]) - 1e-6 for line in said])
    both = np.stack((live.angles, live.sd), axis=2).reshape(600, 12)[rows]
    np.testing.assert_allclose([list(map(float, line[1:13])) for line in said], np.degrees(both), atol=5.1e-5)
    assert list(json.loads(sent.read_text().splitlines()[-1])["joints_deg"].values()) == pytest.approx(
        np.degrees(live.angles[-1]), abs=1e-9
    )
    assert ran.summary()["joints"]["j1"]["sd_deg"] == pytest.approx(np.degrees(live.sd[-1, 0]))
    files = {"teach.toml": TEACH, "other.toml": TEACH.replace('"u6"', '"u7"'), "bad.json": "{"}
    for old, new, words in UNFIT:
        with pytest.raises(PlumbobError, match=words):
            parse_session(CHAIN.replace(old, new), files.__getitem__, name="teach")


def test_an_array_of_the_recording_has_the_rows_of_its_channels(recording):
    """The decoded rows that viewers see are those that are decoded again from the bytes."""
    path, found = recording
    counts = Counter(row.topic for row in open_log(path))
    assert counts == {"raw": counts["raw"], "attitude": 60} | {f"imu/{name}": 60 for name in UNITS}
    assert_same(found.array(calibrated=False), read_array(path), but=("meta",))
    assert plumbob.verify(path).whole and plumbob.replay(path, check=True).comparison.equal


def test_an_older_recording_of_one_unit_gives_all(tmp_path):
    """Its bytes have all units, though its session knows one."""
    path = tmp_path / "a.mcap"
    record(path, arm(), U2)
    assert {row.topic for row in open_log(path)} == {"raw", "imu", "attitude"}
    assert plumbob.read(path).imu is not None
    assert_decoded(read_array(path), arm())
    assert_decoded(plumbob.replay(path, unit="all").found.array(calibrated=False), arm())
    with pytest.raises(ParameterError, match="u9"):
        plumbob.replay(path, unit="u9")


def test_parts_are_chunks_of_the_array(recording):
    """However the bytes were cut: what a live monitor sees is what a reader sees later."""
    whole = Stream(session()).feed(Received(0, arm())).array
    arrays = [part.array for part in recording[1].parts]
    for name in UNITS:
        for triad in TRIADS:
            joined = np.concatenate([getattr(array.units[name], triad) for array in arrays])
            assert joined.tobytes() == getattr(whole.units[name], triad).tobytes()
    assert {len(array) for array in arrays} > {1, 2}
    assert Stream(session(U2)).feed(Received(0, arm())).array is None


def test_the_attitude_is_that_of_the_chosen_or_the_first_unit(recording):
    """To the bit that of a session that knows no other unit."""

    def track(text):
        return through(items(arm()), session(text))[1].track().q_nb.tobytes()

    alone = {name: track(ALL.replace('units = "all"', f'unit = "{name}"')) for name in ("u1", "u5")}
    assert recording[1].track().q_nb.tobytes() == alone["u1"]
    assert track(ALL.replace('units = "all"', 'units = "all"\nunit = 5')) == alone["u5"] != alone["u1"]


@pytest.fixture(scope="module")
def calibrated(tmp_path_factory):
    """A recording whose session has a mount and a card for two units."""
    path = tmp_path_factory.mktemp("cards") / "b.mcap"
    record(path, arm(), ALL + CARDS)
    return path


def test_each_unit_has_its_own_card_and_mount_and_a_file_of_mounts_calibrates(calibrated, recording, tmp_path):
    array, bare = read_array(calibrated), plumbob.read(calibrated).array
    assert_decoded(bare, arm())
    assert array.mounts["u4"] == UnitMount((0.0, 0.0, 0.0, 1.0), (0.02, 0.0, 0.0))
    assert array.mounts["u2"] == UnitMount(clock_offset=2e-3)
    for name, scale in (("u4", 1.02), ("u2", 0.97)):
        expected = apply_card(card(f"arm 7 {name}", scale), bare.units[name])
        assert array.units[name].gyr.tobytes() == expected.gyr.tobytes()
        assert array.units[name].meta == expected.meta
    assert array.units["u1"].meta.calibration is None
    shown = plumbob.info(calibrated).numbers["array"]["units"]  # as they were estimated with
    assert {name: unit["calibration"] for name, unit in shown.items()} == {
        name: unit.meta.calibration for name, unit in array.units.items()
    }
    for given, scale in ((None, 1.02), (card("arm 7 u4", 1.5), 1.5)):  # that of its session, or the one that is given
        made = plumbob.estimate(calibrated, filter="mahony", frame="ENU", unit="u4", calibration=given)
        assert made.imu.gyr.tobytes() == apply_card(card("arm 7 u4", scale), bare.units["u4"]).gyr.tobytes()
    again = read_array(calibrated, mounts={"u4": UnitMount(lever_b=(1.0, 0.0, 0.0))})
    assert again.mounts["u4"].lever_b == (1.0, 0.0, 0.0)
    assert again.mounts["u2"] == array.mounts["u2"]  # who is not named stays as the session says
    for name, text in FILES.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    (tmp_path / "mounts.toml").write_text('kind = "plumbob array"\nversion = 1\n' + CARDS, encoding="utf-8")
    assert_same(read_array(recording[0], mounts=tmp_path / "mounts.toml"), read_array(calibrated))
    with pytest.raises(PlumbobError, match="already calibrated"):
        read_array(calibrated, mounts=tmp_path / "mounts.toml")


WRONG = [
    ("", '[[unit]]\nname = "u9"', "u9"),
    ('units = "both"', "", "must be one of 'all'"),
    ('unit = "u3"', '[[unit]]\nname = "u1"', "is 'u3', but the units"),
    ("", '[calibration]\ncard = "arm.json"', r"\[calibration\] has the card of one unit"),
    ("", '[[unit]]\nname = "u2"\ncard = "u2.json"', r"device in \[\[unit\]\]"),
    ("", '[[unit]]\nname = "u2"\n[[unit]]\nname = "u2"', "occurs twice"),
]


def test_tables_alone_name_the_units():
    """Without units = "all" those of the tables, in their order; the first is estimated."""
    chosen = session(ALL.replace('units = "all"', "") + CARDS, **FILES)
    assert [unit.unit for unit in chosen.units] == ["u4", "u2"]
    assert (chosen.unit, chosen.card.device) == ("u4", "arm 7 u4")
    part = Stream(chosen).feed(Received(0, arm()))
    assert tuple(part.units) == ("u4", "u2")
    assert part.imu is part.units["u4"].imu
    other = of_unit(chosen, "u2")
    assert (other.unit, other.card.device, len(other.units)) == ("u2", "arm 7 u2", 2)
    for units, more, match in WRONG:
        with pytest.raises(PlumbobError, match=match):
            session(ALL.replace('units = "all"', units or 'units = "all"') + more, **FILES)
    for text in (ALL, U2):
        with pytest.raises(PlumbobError, match="one unit without a name"):
            Stream(session(text.replace('"arm"', '"buoy"')))


def test_faults_on_the_line_are_those_of_one_unit(tmp_path):
    """Lost, cut and flipped frames: all units have the samples that a session of one unit has, and their flags."""
    raw, path = tmp_path / "arm.bin", tmp_path / "a.mcap"
    faults = {"flip": 0.05, "cut": 0.05, "lose": 0.05, "noise": 0.05}
    plumbob.emulate("arm", seed=5, duration=20.0, write=raw, faults=faults)
    record(path, raw.read_bytes())
    array, frames = read_array(path), decode(raw.read_bytes(), find_format("arm")).frames["arm"]
    assert 150 < len(array) <= len(frames) < 195
    rows = [row.tobytes() for row in np.hstack([triads_of(frames, name)["acc"] for name in UNITS])]
    places = [rows.index(row.tobytes()) for row in np.hstack([unit.acc for unit in array.units.values()])]
    assert places == sorted(set(places))  # a frame whose counter is flipped belongs to no time
    decoded = read_recorded(path, unit="all").notes[0]
    assert decoded.code == "source.decoded" and decoded.values["junk"] > 0
    for name in UNITS:
        alone = plumbob.read(path, unit=name).imu
        assert array.units[name].flags.tobytes() == alone.flags.tobytes()
        assert array.t.tobytes() == alone.t.tobytes()


def test_a_cut_file_gives_what_came_before(tmp_path):
    record(tmp_path / "a.mcap", arm(), rotate=None)
    raw, sizes = (tmp_path / "a.mcap").read_bytes(), []
    (tmp_path / "c").mkdir()
    cut = tmp_path / "c" / "a.mcap"
    for share in (0.2, 0.5, 0.8, 0.999):
        cut.write_bytes(raw[: int(share * len(raw))])
        try:
            array = read_array(cut)
        except DecodeError as error:
            assert "no sample" in str(error)
            continue
        sizes.append(len(array))
        assert_decoded(array, arm()[: 130 * len(array)])
        assert not verify(cut).clean
        (tmp_path / "mended.mcap").unlink(missing_ok=True)
        repair(cut, tmp_path / "mended.mcap")
        assert_same(read_array(tmp_path / "mended.mcap"), array)
    assert sizes == sorted(sizes)
    assert sizes[-1] == 60


def test_one_unit_of_an_array_runs_as_one(recording, tmp_path):
    mcap, parquet, csv = recording[0], tmp_path / "a.parquet", tmp_path / "u3.csv"
    plumbob.convert(mcap, parquet, what="samples")
    for file in (mcap, parquet):
        words = ("run", file, "--filter", "mahony", "--frame", "NED")
        ok(*words, "--unit", "u3")
        assert "holds the units u1, u2, u3, u4, u5, u6. Name one with --unit" in refused(*words)
    three, again = (
        plumbob.estimate(file, "mahony", unit=unit, frame="NED").track for file, unit in ((mcap, "u3"), (parquet, "3"))
    )
    assert three.q_nb.tobytes() == again.q_nb.tobytes()
    ok("convert", mcap, csv, "--unit", "u3")
    np.testing.assert_array_equal(plumbob.read(csv).imu.gyr, plumbob.read(mcap, unit="u3").imu.gyr)


def single(path, **changes):
    rng = np.random.default_rng(3)
    meta = ImuMeta(device="d", unit_check=False)
    imu = ImuData(t=np.arange(50) / 50.0, gyr=rng.normal(size=(50, 3)) * 0.1, meta=meta)
    return plumbob.write(path, replace(imu, **changes))


def test_files_of_one_unit_each(tmp_path):
    files = [single(tmp_path / "left.parquet"), single(tmp_path / "right.csv")]
    assert tuple(read_array(files).names) == ("left", "right")
    assert tuple(read_array({"upper": files[0], "lower": files[1]}).names) == ("upper", "lower")
    metas = [ImuMeta(device="d", unit_check=False, t0_ns=10**18 + k * 10**9) for k in range(2)]
    later = [single(tmp_path / f"{k}.parquet", meta=meta) for k, meta in enumerate(metas)]
    slower = single(tmp_path / "b.parquet", t=np.arange(50) / 51.0)
    for given, mounts, error, words in (
        ([files[0], single(tmp_path / "left.csv")], None, ParameterError, "same stem"),
        (files[0], None, ParameterError, "holds one unit"),
        (files, {"u1": UnitMount()}, ParameterError, "mount 'u1' belongs to no unit"),
        ([files[0], slower], None, ClockError, r"plumbob\.array\.joined"),
        (later, None, ClockError, r"up to 1 s apart.*plumbob\.array\.joined"),
    ):
        with pytest.raises(error, match=words):
            read_array(given, mounts=mounts)


def test_dead_units_and_lags():
    """A triad without any number is absent, a unit without any is not there; the others do not suffer."""
    _, found = through(items(arm()), session())
    for part in found.parts:
        for name, dead in (("u3", TRIADS), ("u5", ("mag",))):
            sensed = part.units[name].sensed
            gone = {triad: np.full((len(sensed), 3), np.nan) for triad in dead}
            part.units[name] = part.units[name]._replace(sensed=sensed.corrected(meta=sensed.meta, **gone))
    array = found.array(calibrated=False)
    assert (array.names, array.units["u5"].triads) == (("u1", "u2", "u4", "u5", "u6"), ("gyr", "acc"))
    assert_decoded(ImuArray({"u6": array.units["u6"]}), arm(), ["u6"])
    # the attitudes that wait come at the end, in a part without samples; its array is empty
    _, found = through(items(arm()), session(ALL.replace('filter = "mahony"', 'params = { lag = "1 s" }')))
    assert (len(found.track()), len(found.array(calibrated=True))) == (60, 60)
    assert len(found.parts[-1].array) == found.parts[-1].t_ns.size


def test_a_recorder_that_was_away_leaves_a_gap_in_every_unit(tmp_path):
    half = 130 * 30
    record(tmp_path / "a.mcap", arm()[:half])
    record(tmp_path / "a.mcap", arm()[half:], next_part=True)
    array = read_array(tmp_path / "a.mcap")
    assert_decoded(array, arm())
    for unit in array.units.values():
        assert np.flatnonzero(unit.flags & np.uint32(plumbob.flags.GAP)).tolist() == [30]
