"""Every unit of the teaching arm: emulated, recorded, read as an array, equal to what its bytes say."""

import functools
import os
from dataclasses import fields, replace

import numpy as np
import pytest

import plumbob
from plumbob.acquisition.transport import Received
from plumbob.core.errors import ClockError, DecodeError, ParameterError, PlumbobError
from plumbob.data import TRIADS, ImuData, ImuMeta
from plumbob.data.array import PRESETS, ImuArray, Mount
from plumbob.data.calibrated import apply_card
from plumbob.data.cards import CalibrationCard, TriadCalibration
from plumbob.files.mcap import open_log, repair, verify
from plumbob.protocols.decode import decode, triads_of
from plumbob.protocols.rigs import load
from plumbob.session.reading import read_array
from plumbob.session.recording_sink import RecordingSink
from plumbob.session.runner import run_stream
from plumbob.session.session import RecordSpec
from plumbob.session.session_toml import of_unit, parse_session
from plumbob.session.sinks import Collected
from plumbob.session.stream import Stream
from plumbob.simulation.rigs import PLANS, make_rig
from tests.helpers.live_samples import OFFSET, Handed

UNITS = ("u1", "u2", "u3", "u4", "u5", "u6")
ALL = """
kind = "plumbob session"
version = 1
[format]
name = "arm"
units = "all"
[imu]
frame = "NED"
[estimate]
filter = "mahony"
"""


@functools.cache
def arm(seed=1, duration=6.0):
    return make_rig(PLANS["arm"], load("arm"), seed=seed, duration=duration, unit="random").frames.tobytes()


def session(text=ALL, **files):
    return parse_session(text, files.__getitem__, name="arm")


def items(data, size=130):
    """Reads at 10 Hz that do not end where frames end, so that a part has one or two of them, or none."""
    rng, at, found = np.random.default_rng(4), 0, []
    while at < len(data):
        end = min(len(data), at + int(rng.integers(1, 3 * size)))
        found.append(Received(5_000_000_000 + end * 100_000_000 // size, data[at:end]))
        at = end
    return found


def record(path, data, chosen=None, **spec):
    chosen, found = chosen or session(), Collected()
    sink = RecordingSink(chosen, RecordSpec(str(path), reserve=0, **spec), offset=lambda: OFFSET)
    run_stream(Stream(chosen), Handed(items(data)), sinks=[found], recording=sink)
    return found


def assert_decoded(array, data, names=UNITS):
    """Each unit has the numbers that its bytes have, to the bit."""
    frames = decode(data, load("arm")).frames["arm"]
    assert array.names == tuple(names)
    assert len(array) == len(frames) > 0
    for name in names:
        for triad, values in triads_of(frames, name).items():
            assert getattr(array.units[name], triad).tobytes() == values.tobytes(), (name, triad)


def assert_same(mine, other, *, but=()):
    assert mine.names == other.names
    assert dict(mine.mounts) == dict(other.mounts)
    for name in mine.names:
        for one in (f.name for f in fields(ImuData) if f.name not in but):
            a, b = getattr(mine.units[name], one), getattr(other.units[name], one)
            assert a.tobytes() == b.tobytes() if isinstance(a, np.ndarray) else a == b, (name, one)


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


def test_an_array_of_the_recording_has_the_rows_of_its_channels(tmp_path):
    """The decoded rows that viewers see are those that are decoded again from the bytes."""
    found = record(tmp_path / "a.mcap", arm())
    log = open_log(tmp_path / "a.mcap")
    counts = {}
    for row in log:
        counts[row.topic] = counts.get(row.topic, 0) + 1
    assert counts == {"raw": counts["raw"], "attitude": 60} | {f"imu/{name}": 60 for name in UNITS}
    assert_same(found.array(calibrated=False), read_array(tmp_path / "a.mcap"), but=("meta",))
    assert plumbob.verify(tmp_path / "a.mcap").whole
    assert plumbob.replay(tmp_path / "a.mcap", check=True).comparison.equal


def test_an_older_recording_of_one_unit_gives_all(tmp_path):
    """Its bytes have all units, though its session knows one."""
    chosen = session(ALL.replace('units = "all"', 'unit = "u2"'))
    record(tmp_path / "a.mcap", arm(), chosen)
    assert {row.topic for row in open_log(tmp_path / "a.mcap")} == {"raw", "imu", "attitude"}
    assert plumbob.read(tmp_path / "a.mcap").imu is not None
    assert_decoded(read_array(tmp_path / "a.mcap"), arm())


def test_parts_are_chunks_of_the_array():
    """However the bytes were cut: what a live monitor sees is what a reader sees later."""
    stream, cut, whole = Stream(session()), Collected(), Collected()
    arrays = []
    for item in items(arm()):
        if (part := stream.feed(item)) is not None:
            cut.on_part(part)
            arrays.append(part.array)
    other = Stream(session())
    whole.on_part(other.feed(Received(0, arm())))
    for name in UNITS:
        for triad in TRIADS:
            joined = np.concatenate([getattr(one.units[name], triad) for one in arrays])
            assert joined.tobytes() == getattr(whole.parts[0].array.units[name], triad).tobytes()
    assert {len(one) for one in arrays} > {1, 2}
    assert Stream(session(ALL.replace('units = "all"', 'unit = "u2"'))).feed(Received(0, arm())).array is None


def test_the_attitude_is_that_of_the_chosen_or_the_first_unit():
    """To the bit that of a session that knows no other unit."""

    def track(text):
        stream, found = Stream(session(text)), Collected()
        for item in items(arm()):
            if (part := stream.feed(item)) is not None:
                found.on_part(part)
        return found.track().q_nb.tobytes()

    alone = {name: track(ALL.replace('units = "all"', f'unit = "{name}"')) for name in ("u1", "u5")}
    assert track(ALL) == alone["u1"]
    assert track(ALL.replace('units = "all"', 'units = "all"\nunit = 5')) == alone["u5"] != alone["u1"]


def card(device, scale):
    part = TriadCalibration(scale * np.eye(3), np.array([0.01, 0.0, -0.02]), "rad/s", "rad/s")
    return CalibrationCard(device=device, gyr=part, date="2024-05-01", method="test")


CARDS = """
[[unit]]
name = "u4"
axes = "-x -y z"
lever = ["20 mm", "0 mm", "0 mm"]
device = "arm 7 u4"
card = "u4.json"
[[unit]]
name = "u2"
clock_offset = "2 ms"
device = "arm 7 u2"
card = "u2.json"
"""
FILES = {
    "arm.json": card("arm", 1.0).text(),
    "u4.json": card("arm 7 u4", 1.02).text(),
    "u2.json": card("arm 7 u2", 0.97).text(),
}


def test_each_unit_has_its_own_card_and_mount(tmp_path):
    record(tmp_path / "a.mcap", arm(), session(ALL + CARDS, **FILES))
    array, bare = read_array(tmp_path / "a.mcap"), plumbob.read(tmp_path / "a.mcap").array
    assert_decoded(bare, arm())
    assert array.mounts["u4"] == Mount((0.0, 0.0, 0.0, 1.0), (0.02, 0.0, 0.0))
    assert array.mounts["u2"] == Mount(clock_offset=2e-3)
    for name, scale in (("u4", 1.02), ("u2", 0.97)):
        expected = apply_card(card(f"arm 7 {name}", scale), bare.units[name])
        assert array.units[name].gyr.tobytes() == expected.gyr.tobytes()
        assert array.units[name].meta == expected.meta
    assert array.units["u1"].meta.calibration is None
    again = read_array(tmp_path / "a.mcap", mounts={"u4": Mount(lever_b=(1.0, 0.0, 0.0))})
    assert again.mounts["u4"].lever_b == (1.0, 0.0, 0.0)
    assert again.mounts["u2"] == array.mounts["u2"]  # who is not named stays as the session says


def test_tables_alone_name_the_units():
    """Without units = "all" those of the tables, in their order; the first is estimated."""
    chosen = session(ALL.replace('units = "all"', "") + CARDS, **FILES)
    assert [one.unit for one in chosen.units] == ["u4", "u2"]
    assert (chosen.unit, chosen.card.device) == ("u4", "arm 7 u4")
    part = Stream(chosen).feed(Received(0, arm()))
    assert tuple(part.units) == ("u4", "u2")
    assert part.imu is part.units["u4"].imu
    other = of_unit(chosen, "u2")
    assert (other.unit, other.card.device, len(other.units)) == ("u2", "arm 7 u2", 2)


def test_a_file_of_mounts_calibrates(tmp_path):
    for name, text in FILES.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    (tmp_path / "mounts.toml").write_text('kind = "plumbob array"\nversion = 1\n' + CARDS, encoding="utf-8")
    record(tmp_path / "a.mcap", arm())
    record(tmp_path / "b.mcap", arm(), session(ALL + CARDS, **FILES))
    mounted = read_array(tmp_path / "a.mcap", mounts=tmp_path / "mounts.toml")
    assert_same(mounted, read_array(tmp_path / "b.mcap"))
    with pytest.raises(PlumbobError, match="already calibrated"):
        read_array(tmp_path / "b.mcap", mounts=tmp_path / "mounts.toml")


WRONG = {
    "no such unit": (ALL + '[[unit]]\nname = "u9"', "u9"),
    "a word": (ALL.replace('"all"', '"both"'), "must be one of 'all'"),
    "estimated unit is not among them": (
        ALL.replace('units = "all"', 'unit = "u3"') + '[[unit]]\nname = "u1"', "format.unit is 'u3', but the units"
    ),
    "one unit": (ALL.replace('"arm"', '"buoy"'), "one unit without a name"),
    "card of one": (ALL + '[calibration]\ncard = "arm.json"', r"\[calibration\] has the card of one unit"),
    "card of another": (ALL + '[[unit]]\nname = "u2"\ncard = "u2.json"', r"device in \[\[unit\]\]"),
    "twice": (ALL + '[[unit]]\nname = "u2"\n[[unit]]\nname = "u2"', "stands twice"),
}  # fmt: skip


@pytest.mark.parametrize("case", WRONG)
def test_sessions_that_do_not_go_together_are_refused(case):
    text, match = WRONG[case]
    with pytest.raises(PlumbobError, match=match):
        session(text, **FILES)


def test_faults_on_the_line_are_those_of_one_unit(tmp_path):
    """Lost, cut and flipped frames: all units have the samples that a session of one unit has, and their flags."""
    raw = tmp_path / "arm.bin"
    plumbob.emulate(
        "arm", seed=5, duration=20.0, write=raw, faults={"flip": 0.05, "cut": 0.05, "lose": 0.05, "noise": 0.05}
    )
    data = raw.read_bytes()
    record(tmp_path / "a.mcap", data)
    array = read_array(tmp_path / "a.mcap")
    frames = decode(data, load("arm")).frames["arm"]
    assert 150 < len(array) <= len(frames) < 195
    known = [row.tobytes() for row in np.hstack([triads_of(frames, name)["acc"] for name in UNITS])]
    places = [known.index(row.tobytes()) for row in np.hstack([one.acc for one in array.units.values()])]
    assert places == sorted(set(places))  # a frame whose counter is flipped belongs to no time
    notes = []
    read_array(tmp_path / "a.mcap", note=notes.append)
    assert any("of them junk" in note for note in notes)
    for name in UNITS:
        alone = plumbob.read(tmp_path / "a.mcap", unit=name).imu
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


def test_a_full_disk_costs_rows_and_says_so(tmp_path, monkeypatch):
    """The disk refuses after 6 kB: the line goes on, and what is lost is counted for each channel."""
    from plumbob.files.mcap import disk

    write, room = os.write, [6000]

    def full(fd, data):
        if room[0] < len(data):
            raise OSError(28, "No space left on device")
        room[0] -= len(data)
        return write(fd, data)

    monkeypatch.setattr(disk.os, "write", full)
    chosen, found = session(), Collected()
    sink = RecordingSink(chosen, RecordSpec(str(tmp_path / "a.mcap"), reserve=0))
    run_stream(Stream(chosen), Handed(items(arm())), sinks=[found], recording=sink)
    monkeypatch.undo()
    assert len(found.array(calibrated=True)) == 60
    assert sink.recorder.acknowledged < sink.recorder.written


def test_one_unit_of_an_array_runs_as_one(tmp_path, capsys):
    from plumbob.cli.main import main

    record(tmp_path / "a.mcap", arm())
    plumbob.convert(tmp_path / "a.mcap", tmp_path / "a.parquet", what="samples")
    for name in ("a.mcap", "a.parquet"):
        file = str(tmp_path / name)
        assert main(["run", file, "--filter", "mahony", "--frame", "NED", "--unit", "u3"]) == 0
        assert main(["run", file, "--filter", "mahony", "--frame", "NED"]) == 1
        assert "holds the units u1, u2, u3, u4, u5, u6. Name one with --unit" in capsys.readouterr().err
    three = plumbob.estimate(tmp_path / "a.mcap", "mahony", unit="u3", frame="NED").track
    assert (
        three.q_nb.tobytes()
        == plumbob.estimate(tmp_path / "a.parquet", "mahony", unit="3", frame="NED").track.q_nb.tobytes()
    )
    assert main(["convert", str(tmp_path / "a.mcap"), str(tmp_path / "u3.csv"), "--unit", "u3"]) == 0
    alone = plumbob.read(tmp_path / "u3.csv")
    np.testing.assert_array_equal(alone.imu.gyr, plumbob.read(tmp_path / "a.mcap", unit="u3").imu.gyr)


def one(path, **changes):
    rng = np.random.default_rng(3)
    imu = ImuData(
        t=np.arange(50) / 50.0, gyr=rng.normal(size=(50, 3)) * 0.1, meta=ImuMeta(device="d", unit_check=False)
    )
    return plumbob.write(path, replace(imu, **changes))


def test_files_of_one_unit_each(tmp_path):
    files = [one(tmp_path / "left.parquet"), one(tmp_path / "right.csv")]
    assert read_array(files).names == ("left", "right")
    assert read_array({"upper": files[0], "lower": files[1]}).names == ("upper", "lower")
    with pytest.raises(ParameterError, match="same stem"):
        read_array([files[0], one(tmp_path / "left.csv")])
    with pytest.raises(ParameterError, match=r"holds one unit"):
        read_array(files[0])
    with pytest.raises(ParameterError, match="mount 'u1' belongs to no unit"):
        read_array(files, mounts={"u1": Mount()})


def test_files_of_other_times_are_refused_with_what_to_do(tmp_path):
    files = [one(tmp_path / "a.parquet"), one(tmp_path / "b.parquet", t=np.arange(50) / 51.0)]
    with pytest.raises(ClockError, match=r"plumbob\.array\.joined"):
        read_array(files)
    metas = [ImuMeta(device="d", unit_check=False, t0_ns=10**18 + k * 10**9) for k in range(2)]
    files = [one(tmp_path / f"{k}.parquet", meta=meta) for k, meta in enumerate(metas)]
    with pytest.raises(ClockError, match=r"up to 1 s apart.*plumbob\.array\.joined"):
        read_array(files)


def test_a_unit_that_is_dead_from_the_start_is_left_out(tmp_path):
    """A triad without any number is absent, a unit without any is not there; the others do not suffer."""
    found = record(tmp_path / "a.mcap", arm())
    for part in found.parts:
        for name, dead in (("u3", TRIADS), ("u5", ("mag",))):
            sensed = part.units[name].sensed
            gone = {triad: np.full((len(sensed), 3), np.nan) for triad in dead}
            part.units[name] = part.units[name]._replace(sensed=sensed.corrected(meta=sensed.meta, **gone))
    array = found.array(calibrated=False)
    assert array.names == ("u1", "u2", "u4", "u5", "u6")
    assert array.units["u5"].triads == ("gyr", "acc")
    assert_decoded(ImuArray({"u6": array.units["u6"]}), arm(), ["u6"])


def test_with_a_lag_every_unit_comes_as_the_samples_come(tmp_path):
    """The attitudes that wait come at the end, in a part without samples; its array is empty."""
    text = ALL.replace('filter = "mahony"', 'params = { lag = "1 s" }')
    found = record(tmp_path / "a.mcap", arm(), session(text))
    assert len(found.track()) == 60
    assert len(found.array(calibrated=True)) == 60
    assert len(found.parts[-1].array) == found.parts[-1].t_ns.size


def test_a_recorder_that_was_away_leaves_a_gap_in_every_unit(tmp_path):
    half = 130 * 30
    record(tmp_path / "a.mcap", arm()[:half])
    record(tmp_path / "a.mcap", arm()[half:], next_part=True)
    array = read_array(tmp_path / "a.mcap")
    assert_decoded(array, arm())
    for one in array.units.values():
        assert np.flatnonzero(one.flags & np.uint32(plumbob.flags.GAP)).tolist() == [30]


def test_all_units_of_an_older_recording_are_replayed(tmp_path):
    record(tmp_path / "a.mcap", arm(), session(ALL.replace('units = "all"', 'unit = "u2"')))
    assert_decoded(plumbob.replay(tmp_path / "a.mcap", unit="all").found.array(calibrated=False), arm())
    with pytest.raises(ParameterError, match="u9"):
        plumbob.replay(tmp_path / "a.mcap", unit="u9")
