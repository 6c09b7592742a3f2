"""Recordings of a line: replay gives the live bits, damage becomes a gap, conversions hold what was there."""

import json
from contextlib import suppress
from dataclasses import asdict, replace

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given
from hypothesis.extra.numpy import arrays

from plumbob import AttitudeTrack, Frame, ImuData, files, flags
from plumbob.core.errors import DecodeError, ParameterError, PlumbobError, ShapeError
from plumbob.core.event import Event
from plumbob.data import ImuMeta
from plumbob.door import reading
from plumbob.files.header import plain_meta
from plumbob.files.mcap import Recorder, open_log
from plumbob.files.numbers import open_npy
from plumbob.filters.offline import Stage
from plumbob.live import rows
from plumbob.live.recorded import convert, only, read_recorded
from plumbob.live.replay import open_recording, replay
from plumbob.live.rigs.rig import PLANS, make_rig
from plumbob.live.rows import attitude_rows, imu_rows
from plumbob.live.sinks import TextSink
from plumbob.live.sources import open_source
from plumbob.live.transports.transport import Received
from plumbob.protocols.decode import full_scales
from plumbob.protocols.encode import encode
from plumbob.protocols.format_toml import find_format, parse_format
from plumbob.rotations import North, euler_zyx_from_quat, quat_angle, quat_conjugate, quat_multiply
from tests.helpers import beside
from tests.helpers.commandline import ok
from tests.helpers.live_samples import OFFSET, SESSION, motion, reads, record, session, stream, through


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    path = tmp_path_factory.mktemp("rec") / "buoy.mcap"
    items = reads(stream())
    items.insert(50, Event(items[50].t_ns, "damaged", "a character had a wrong stop bit", 1))
    return path, items, record(path, items)


def test_recording_holds_every_byte_with_its_time_and_its_replay_equals_live_to_the_bit(recording):
    """Foxglove's own library too, with its checks on, finds our channels and schemas."""
    from mcap.reader import make_reader

    path, items, _ = recording
    raw = [(m.t_ns, m.data) for m in open_log(path) if m.topic == "raw"]
    assert raw == [(i.t_ns, i.data) for i in items if not isinstance(i, Event)]
    topics = {}
    with path.open("rb") as stream_:
        for schema, channel, message in make_reader(stream_, validate_crcs=True).iter_messages():
            topics.setdefault(channel.topic, (schema.encoding if schema else None, message.log_time))
    assert (set(topics), topics["imu"][0]) == ({"raw", "events", "imu", "attitude"}, "jsonschema")
    assert topics["raw"][1] == OFFSET + items[0].t_ns
    path, _, live = recording
    log, chosen = open_recording(path)
    replayed = replay(log, session=chosen, check=True)
    again = replayed.found
    np.testing.assert_array_equal(again.t_ns, live.t_ns)
    for name in ("q_nb", "bias_b", "flags"):
        np.testing.assert_array_equal(getattr(again.track(), name), getattr(live.track(), name))
    result = replayed.comparison
    assert result.equal
    assert (result.compared, result.different) == (len(motion().imu), 0)
    assert [e.kind for e in again.events] == ["damaged"]
    result = replay(log, session=replace(chosen, stage=Stage("integrate", {})), check=True).comparison
    assert not result.equal  # another filter
    assert result.different > 0


@pytest.fixture(scope="module")
def short(tmp_path_factory):
    """Two seconds, 400 attitudes."""
    path = tmp_path_factory.mktemp("short") / "buoy.mcap"
    record(path, reads(stream(2.0)))
    return path


def rewritten(path, out, change):
    """A recording whose attitudes are those that `change` makes of them, all else as it was."""
    log = open_log(path)
    first = log.first_info
    recorder = Recorder(out, epoch_offset_ns=first.epoch_offset_ns, reserve=0)
    recorder.metadata.update(first.metadata)
    with recorder:
        channel = {topic: rows.declare(recorder, topic) for topic in ("events", "imu", "attitude")}
        channel["raw"] = recorder.channel("raw", "application/octet-stream")
        messages = list(log)
        for m in messages:
            if m.topic not in ("attitude", "recorder"):
                recorder.write(channel[m.topic], m.t_ns, m.data)
        for row in change([m.data for m in messages if m.topic == "attitude"]):
            recorder.write(channel["attitude"], messages[-1].t_ns, row)
    return replay(out, check=True)


def false(row):
    return row.replace(b"[0.", b"[0.9")


@pytest.mark.parametrize(("change", "counts"), [
    (lambda live: live, (400, 0, 0, 0)),
    # the false rows meet the replay's, and the true ones are what nobody made
    (lambda live: [*map(false, live), *live], (400, 400, 400, 0)),
    (lambda live: [r for row in live for r in (false(row), row)], (400, 400, 400, 0)),
    (lambda live: live + live[-3:], (400, 0, 3, 0)),
    (lambda live: live[:5] + live[8:], (397, 0, 0, 3)),
    (lambda live: live[:-5], (395, 0, 0, 5)),
    (lambda live: [row.replace(b'"t_ns":', b'"t_ns":-') for row in live], (0, 0, 400, 400)),
])  # fmt: skip
def test_rows_are_compared_in_their_order_and_none_is_left_out(short, tmp_path, change, counts):
    result = rewritten(short, tmp_path / "a.mcap", change).comparison
    assert (result.compared, result.different, result.only_live, result.only_replayed) == counts
    assert result.equal == (counts == (400, 0, 0, 0))


def test_a_row_whose_time_is_no_whole_number_is_refused(short, tmp_path):
    with pytest.raises(DecodeError, match="no whole number of nanoseconds"):
        rewritten(short, tmp_path / "a.mcap", lambda _: [b'{"t_ns":1.5,"q_nb":0,"bias_b":0,"flags":0}'])


def test_bytes_missing_from_a_damaged_recording_become_a_gap(recording, tmp_path):
    path = tmp_path / "hurt.mcap"
    data = bytearray(recording[0].read_bytes())
    middle = len(data) // 2
    data[middle : middle + 1500] = bytes(1500)  # more than indexes take, less than a chunk
    path.write_bytes(data)
    log, chosen = open_recording(path)
    replayed = replay(log, session=chosen, check=True)
    assert log.damage
    kinds = [e.kind for e in replayed.found.events]
    assert kinds.count("reopened") == kinds.count("dropped") == 1
    track = replayed.found.track()
    whole = len(motion().imu)
    assert whole - 60 < len(track) < whole  # a chunk of 0.1 s is 20 frames, two may be hit; cut frames go with them
    assert np.isfinite(track.q_nb).all() and (track.flags & flags.GAP).any()
    assert not replayed.comparison.equal


@pytest.fixture(scope="module")
def whole(recording):
    return read_recorded(recording[0], estimated=True)


def test_recorded_samples_carry_utc_and_the_text_sink_writes_now_and_then_or_nothing(recording, tmp_path):
    path, _, live = recording
    read = reading.read(path)
    assert read.track is None  # an estimate is no reference
    assert read.imu.meta.calibration is None
    assert read.imu.meta.t0_ns == OFFSET + int(live.t_ns[0])
    np.testing.assert_array_equal(read.imu.gyr, live.imu(calibrated=False).gyr)
    sink = TextSink(tmp_path / "a.txt", 0.05)
    for part in recording[2].parts:
        sink.on_part(part)
    sink.close()
    times = np.loadtxt(tmp_path / "a.txt", skiprows=2, usecols=0)
    np.testing.assert_allclose(np.diff(times), 0.05, atol=1e-5)  # 20 Hz out of 200 Hz, as the buoy's host
    TextSink(tmp_path / "b.txt", 0.05).close()
    assert not (tmp_path / "b.txt").exists()  # or the next try would be refused
    (tmp_path / "b.txt").write_text("precious")
    with pytest.raises(ParameterError, match="never replaces a file"):
        TextSink(tmp_path / "b.txt", 0.05)
    with pytest.raises(DecodeError, match="there is no folder"):
        TextSink(tmp_path / "no" / "a.txt", 0.05)


@pytest.mark.parametrize("suffix", [".csv", ".parquet", ".mcap"])
def test_convert_reads_back_exactly(recording, whole, tmp_path, suffix):
    out = tmp_path / f"out{suffix}"
    convert(whole, out)
    back = read_recorded(out, estimated=True) if suffix == ".mcap" else files.read(out)
    np.testing.assert_array_equal(back.imu.t_ns, whole.imu.t_ns)
    np.testing.assert_array_equal(back.imu.acc, whole.imu.acc)
    np.testing.assert_array_equal(back.track.q_nb, recording[2].track().q_nb)
    assert back.imu.meta == whole.imu.meta


def test_tum_conversion_is_scalar_last_and_text_has_degrees(whole, tmp_path):
    notes = []
    convert(whole, tmp_path / "a.tum")
    convert(whole, tmp_path / "a.txt", layout="tum", note=notes.append)
    assert (tmp_path / "a.txt").read_bytes() == (tmp_path / "a.tum").read_bytes()
    assert notes[-1] == "TUM has no place for samples, bias, flags, notes: left out"
    table = np.loadtxt(tmp_path / "a.tum")
    np.testing.assert_array_equal(table[:, 4:], whole.track.q_nb[:, [1, 2, 3, 0]])
    np.testing.assert_array_equal(table[:, 1:4], 0.0)
    assert table[5, 0] == pytest.approx(whole.track.t[5], abs=1e-9)
    convert(whole, tmp_path / "b.txt")
    table = np.loadtxt(tmp_path / "b.txt", skiprows=2, delimiter="\t", usecols=(0, 1, 2, 3))
    angles = np.degrees(euler_zyx_from_quat(whole.track.q_nb))[:, ::-1]
    assert len(table) == len(motion().imu)
    np.testing.assert_allclose(table[:, 1:], angles, rtol=0, atol=1e-3)


def test_viewers_of_foxglove_find_its_transforms(whole, tmp_path):
    """By the library of MCAP, and docs.foxglove.dev/docs/sdk/schemas/frame-transform."""
    from mcap.reader import make_reader

    convert(whole, tmp_path / "a.mcap")
    with (tmp_path / "a.mcap").open("rb") as file:
        found = [(schema, message) for schema, _, message in make_reader(file).iter_messages(topics=["tf"])]
    assert {(schema.name, schema.encoding) for schema, _ in found} == {("foxglove.FrameTransform", "jsonschema")}
    world, *bodies = [json.loads(message.data) for _, message in found]
    assert (world["parent_frame_id"], world["child_frame_id"]) == ("world (ENU)", "navigation (NED)")
    assert world["timestamp"] == bodies[0]["timestamp"]
    assert len(bodies) == len(whole.track)
    q_nb = [[body["rotation"][axis] for axis in "wxyz"] for body in bodies]
    np.testing.assert_array_equal(q_nb, whole.track.q_nb)
    stamps = [body["timestamp"]["sec"] * 10**9 + body["timestamp"]["nsec"] for body in bodies]
    assert stamps == (whole.imu.t_ns + whole.imu.meta.t0_ns).tolist() == [message.log_time for _, message in found[1:]]


def test_convert_refuses_what_is_not_there_and_what_would_be_lost(whole, tmp_path):
    samples = only(whole, "samples")
    with pytest.raises(ShapeError, match="has no attitude; it has samples"):
        only(samples, "attitude")
    for name in ("b.tum", "b.csv", "b.parquet"):
        (tmp_path / name).write_text("precious")
    for recording, name, error, words in (
        (samples, "a.tum", ShapeError, "holds an attitude, and there is none"),
        *((whole, f"b.{kind}", ParameterError, "exists already and is not") for kind in ("tum", "csv", "parquet")),
        (whole, "b.json", ParameterError, r"convert writes .*, not '\.json'"),
    ):
        with pytest.raises(error, match=words):
            convert(recording, tmp_path / name)
    (tmp_path / "a.mcap").write_bytes(b"no recording")
    with pytest.raises(DecodeError):
        reading.read(tmp_path / "a.mcap")


def test_recording_without_samples_is_smaller_and_replays_alike(tmp_path, short):
    path = tmp_path / "raw.mcap"
    live = record(path, reads(stream(2.0)), samples=False)
    assert {m.topic for m in open_log(path)} == {"raw"}
    assert path.stat().st_size < short.stat().st_size
    log, chosen = open_recording(path)
    np.testing.assert_array_equal(replay(log, session=chosen).track.q_nb, live.track().q_nb)
    with pytest.raises(DecodeError, match="holds no attitudes"):
        replay(log, session=chosen, check=True)


ROD = 'kind = "plumbob session"\nversion = 1\n[format]\nname = "rod"\n[imu]\nframe = "NED"\n'
REFERENCE = '[reference]\nunit = "ref"\nnorth = "magnetic"\n'


def rod(plan, duration):
    """The rod's rig, and what a line gives of it."""
    rig = make_rig(plan, find_format("rod"), seed=1, duration=duration, unit="calibrated")
    return rig, [Received(int(t) + 10**9, frame.tobytes()) for t, frame in zip(rig.due_ns, rig.frames, strict=True)]


def test_reference_in_the_same_frames_is_read_and_compared(tmp_path):
    """The rod's rig: its AHRS gives the truth, to half a count of 180°/2^15."""
    rig, items = rod(PLANS["rod"].with_reference("ideal"), 5.0)
    record(tmp_path / "rod.mcap", items, ROD + REFERENCE)
    track, truth = read_recorded(tmp_path / "rod.mcap").track, rig.units["ref"].truth  # turned against the other's case
    assert track.north is North.MAGNETIC
    turn = quat_multiply(quat_conjugate(truth.q_nb), track.q_nb)
    angle = 2.0 * np.arcsin(np.minimum(1.0, np.linalg.norm(turn[:, 1:], axis=1)))
    half_count = np.radians(0.5 * 180.0 / 2**15)
    assert np.median(angle) < 2.0 * half_count  # three angles, each half a count off at most


@pytest.mark.parametrize("lost", [(), (100, 101, 102)])
def test_capture_of_a_logger_gives_the_device_times(tmp_path, lost):
    """Raw bytes without a host: time from the device clock, holes where frames are missing."""
    data = stream(2.0)
    frames = b"".join(data[30 * i : 30 * i + 30] for i in range(len(data) // 30) if i not in lost)
    (tmp_path / "sd.bin").write_bytes(b"\x00\xa5" + frames)
    chosen = session(SESSION + f'[source]\nkind = "file"\npath = "{tmp_path / "sd.bin"}"\n')
    line, found = through([], chosen, source=open_source(chosen.source))
    t_ns = np.delete(motion(2.0).imu.t_ns // 1000 * 1000, lost)
    np.testing.assert_array_equal(found.imu(calibrated=True).t_ns, t_ns)
    assert line.report()["time"]["lost"] == len(lost)
    assert line.decoder.counts.junk == 2


def test_capture_that_cannot_be_timed_or_decoded_is_refused(tmp_path):
    (tmp_path / "a.bin").write_bytes(bytes(1000))
    source = f'[source]\nkind = "file"\npath = "{tmp_path / "a.bin"}"\n'
    bare = f'kind = "plumbob session"\nversion = 1\n{source}[format]\nname = "mpu6000"\n'
    for text, error, words in (
        (SESSION + source, DecodeError, "holds no frame of imu9"),
        (SESSION + source.replace("a.bin", "b.bin"), DecodeError, "does not exist"),
        (bare, ParameterError, "neither a clock nor a rate"),
    ):
        with pytest.raises(error, match=words):
            open_source(session(text).source)
    items = open_source(session(bare.replace("[format]", 'rate = "50 Hz"\n[format]')).source)
    assert items.read(0.0)[0].t_ns == round(63 * 1e9 / 50)  # 64 frames, the last of them 63 periods after the first


@pytest.mark.parametrize("chosen", ['filter = "integrate"', ""], ids=["integrate", "by default"])
def test_a_gyroscope_started_from_the_reference_follows_it_and_replays(tmp_path, chosen):
    """The rod's rig has no magnetometer: the start is the AHRS's first frame, headings from its north."""
    _, items = rod(PLANS["rod"], 2.0)
    record(tmp_path / "rod.mcap", items, f'{ROD}[estimate]\n{chosen}\ninit = "truth"\n{REFERENCE}')
    log, session = open_recording(tmp_path / "rod.mcap")
    replayed = replay(log, session=session, check=True)
    assert replayed.comparison.equal
    first, reference = replayed.found.track(), read_recorded(tmp_path / "rod.mcap").track
    assert first.north is North.MAGNETIC and quat_angle(first.q_nb[0], reference.q_nb[0]) < 1e-12


DEEP = "[" * 200_000
LONG = "9" * 5000
HUGE = "9" * 400  # an integer that Python reads, and no float holds
IMU = {"t_ns": 0, "gyr": [0.1, 0.2, 0.3], "acc": None, "mag": None, "temp_c": 20.5, "flags": 0}
ATTITUDE = {"t_ns": 0, "q_nb": [1.0, 0.0, 0.0, 0.0], "bias_b": None, "flags": 0}


def about(**changes):
    meta = asdict(plain_meta(ImuMeta(device="unit 7", rate_nominal=100.0)))
    return json.dumps(
        {"imu": meta, "track": {"frame": "NED", "north": "true", "source": "a test"}, "notes": []} | changes
    )


def crafted(folder, *, topic=rows.IMU, text=None, imu=True, **texts):
    """Two good rows of samples, and one more with this text in a topic."""
    path = folder / "crafted.mcap"
    path.unlink(missing_ok=True)
    recorder = Recorder(path, epoch_offset_ns=0)
    recorder.metadata.update({"recording": about()} | texts)
    numbers = {name: rows.declare(recorder, name) for name in (rows.IMU, rows.ATTITUDE)}
    with recorder:
        for t_ns in (1, 10_000_001) if imu else ():
            recorder.write(numbers[rows.IMU], t_ns, json.dumps(IMU | {"t_ns": t_ns}).encode())
        if text is not None:
            recorder.write(numbers[topic], 20_000_001, text.encode())
    return path


def row(plain=IMU, **changes):
    return json.dumps(plain | {"t_ns": 20_000_001} | changes)


NO_FLAGS = json.dumps({key: value for key, value in IMU.items() if key != "flags"})
BAD_ROWS = ["", "[]", '"x"', "null", DEEP, "{}", row()[:-9], row().replace("20.5", LONG), NO_FLAGS]
BAD_ROWS += [row(flags=value) for value in (-1, "x", 2**32, 1.5, True)]
BAD_ROWS += [row(t_ns=value) for value in (2**63, "1", None)]
BAD_ROWS += [row(gyr=value) for value in ([1.0, 2.0], [1.0, 2.0, "3"], 3.0, [[1.0], 2.0, 3.0], {})]
BAD_ROWS += [row().replace("0.1", HUGE), row(temp_c="20")]
BAD_ABOUT = [about()[:-9], "[]", DEEP, "{}", about(imu=5), about(notes=5), about(notes=[5])]
BAD_ABOUT += [about().replace("100.0", HUGE), about().replace("100.0", LONG)]
BAD_ABOUT += [about().replace('"t0_ns": 0', '"t0_ns": "0"'), about().replace('"unit 7"', "5")]
BAD_ATTITUDES = [(row(ATTITUDE, q_nb=[1.0]), about()), (row(ATTITUDE, q_nb=None)[:-1], about())]
BAD_ATTITUDES += [(row(ATTITUDE), about(track=track)) for track in (None, {"frame": "up"}, [])]


def test_rows_and_metadata_are_read_or_refused(tmp_path):
    found = read_recorded(crafted(tmp_path, text=row()))
    np.testing.assert_array_equal(found.imu.gyr, [IMU["gyr"]] * 3)
    assert found.imu.meta.device == "unit 7"
    for text in BAD_ROWS:
        with pytest.raises(DecodeError, match=r"crafted\.mcap: .*damaged, or was not made by Plumbob"):
            read_recorded(crafted(tmp_path, text=text))
    for text in BAD_ABOUT:
        with pytest.raises(DecodeError):
            read_recorded(crafted(tmp_path, text=row(), recording=text))
    for text, metadata in BAD_ATTITUDES:
        path = crafted(tmp_path, topic=rows.ATTITUDE, text=text, imu=False, recording=metadata)
        with pytest.raises(PlumbobError):
            read_recorded(path, estimated=True)


def test_an_event_is_read_or_refused_and_a_sensor_that_is_not_there_is_absent_in_every_row():
    for text in ("{", DEEP, "[]", "{}", '{"t_ns": "x", "kind": "a", "text": "b", "count": 1}'):
        with pytest.raises(DecodeError, match="a row of 'events'"):
            rows.parsed_event(text.encode())
    assert rows.parsed_event(rows.event_row(Event(1, "a", "b", 2))) == Event(1, "a", "b", 2)
    meta = ImuData(t=[0.0], gyr=[[0.0, 0.0, 0.0]]).meta
    imu = ImuData.live(np.array([0, 1]), {"gyr": np.zeros((2, 3))}, flags=np.zeros(2, dtype=np.uint32), meta=meta)
    assert (imu.flags == flags.ACC_ABSENT | flags.MAG_ABSENT).all()


def test_no_byte_of_an_array_of_numpy_makes_a_traceback(tmp_path):
    """Every byte of the header turned to each of some signs that mean something in it."""
    path = tmp_path / "damaged.npy"
    np.save(path, np.arange(30.0).reshape(10, 3))
    data = path.read_bytes()
    for at in range(6, 128):
        for sign in b"('{\\":
            path.write_bytes(data[:at] + bytes([sign]) + data[at + 1 :])
            with suppress(DecodeError):
                open_npy(path, None)


T_NS = [5, 10, 2**61]


def same(told, values):
    return all(a == b or (a is None and not np.isfinite(b)) for a, b in zip(told, values, strict=True))


@given(arrays(np.float64, (3, 3), elements=st.floats(allow_nan=True, allow_infinity=True)))
def test_every_number_of_a_sample_reads_back(gyr):
    gyr[0, 0] = 0.1  # a recording needs a number
    meta = ImuData(t=[0.0], gyr=[[0.0, 0.0, 0.0]]).meta
    imu = ImuData.live(np.array([0, 1, 2]), {"gyr": gyr}, flags=np.arange(3, dtype=np.uint32), meta=meta)
    for row, t, values in zip(imu_rows(T_NS, imu), T_NS, gyr, strict=True):
        told = json.loads(row)
        assert told["t_ns"] == t
        assert told["acc"] is told["mag"] is told["temp_c"] is None
        assert same(told["gyr"], values)


@given(arrays(np.float64, (3, 4), elements=st.floats(-1, 1)))
def test_every_number_of_an_attitude_reads_back(q_nb):
    track = AttitudeTrack.trusted(t=np.arange(3.0), q_nb=q_nb, frame=Frame.ENU, north=North.TRUE)
    for row, values in zip(attitude_rows(T_NS, track), q_nb, strict=True):
        told = json.loads(row)
        assert told["q_nb"] == values.tolist()
        assert (told["bias_b"], told["flags"]) == (None, 0)


JUDGED = np.uint32(flags.GYR_CLIPPED | flags.GYR_INVALID)
FIN = np.radians([100.0, 100.0, 300.0])
"""ADXRS290 about x and y, ±100 °/s, and ADXRS453 about z, ±300 °/s: their data sheets, as the catalogue cites them."""


@pytest.fixture(scope="module")
def fast(tmp_path_factory):
    """A fin that turns at up to 130 °/s about z."""
    folder = tmp_path_factory.mktemp("fin")
    motion = ("--scenario", "fin", "--set", "frequency=0.56Hz", "--duration", "4s")
    ok("emulate", "fin", *motion, "--write", folder / "fin.bin")
    ok("record", "--from", folder / "fin.bin", "--format", "fin", "--out", folder / "fin.mcap")
    return folder


def test_an_axis_is_judged_by_its_own_range_which_turns_with_the_axes(fast, tmp_path):
    imu = read_recorded(fast / "fin.mcap").imu
    np.testing.assert_allclose(imu.meta.full_scale("gyr"), FIN, rtol=1e-12)
    assert np.abs(imu.gyr[:, 2]).max() > 1.05 * FIN[0]  # where the smallest range of the triad made it invalid
    assert not (imu.flags[(np.abs(imu.gyr) < 0.99 * FIN).all(axis=1)] & JUDGED).any()
    session = tmp_path / "fin.toml"
    session.write_text(
        'kind = "plumbob session"\nversion = 1\n[format]\nname = "fin"\n[imu]\naxes = "z x y"\n'
        f'[source]\nkind = "file"\npath = "{(fast / "fin.bin").as_posix()}"\n[record]\npath = "turned.mcap"\n'
    )
    ok("record", session, cwd=tmp_path)
    imu = read_recorded(tmp_path / "turned.mcap").imu
    np.testing.assert_allclose(imu.meta.full_scale("gyr"), FIN[[2, 0, 1]], rtol=1e-12)
    np.testing.assert_array_equal(imu.gyr, read_recorded(fast / "fin.mcap").imu.gyr[:, [2, 0, 1]])


@pytest.mark.parametrize("name", ["fin.parquet", "fin.csv"])
def test_convert_keeps_its_ranges(fast, tmp_path, name):
    convert(fast / "fin.mcap", tmp_path / name)
    assert files.read(tmp_path / name).imu.meta == read_recorded(fast / "fin.mcap").imu.meta


WRONG_UNIT = beside(__file__, "wrong_unit.toml")


def test_the_units_of_a_format_are_doubted_in_a_note_but_open(tmp_path):
    """1 g of 8192 counts, read as 1 m/s²."""
    level = {"acc.x": np.zeros(200), "acc.y": np.zeros(200), "acc.z": np.ones(200)}
    (tmp_path / "three.toml").write_text(WRONG_UNIT, encoding="utf-8")
    (tmp_path / "a.bin").write_bytes(encode(parse_format(WRONG_UNIT), level).tobytes())
    ok("record", "--from", tmp_path / "a.bin", "--format", tmp_path / "three.toml", "--out", tmp_path / "a.mcap")
    found = read_recorded(tmp_path / "a.mcap")
    np.testing.assert_allclose(found.imu.acc, [[0.0, 0.0, 1.0]] * 200)
    (note,) = [note for note in found.notes if note.code == "reading.unit_doubt"]
    assert "|acc| is 1 m/s²" in str(note) and str(note).endswith("looks like g; check the units of the format")


def form_of(*types):
    lines = [
        f'[[field]]\nname = "gyr.{axis}"\ntype = "{kind}"\nunit = "rad/s"\nlsb = {lsb}\n{more}\n'
        for axis, kind, lsb, more in types
    ]
    head = 'kind = "plumbob format"\nversion = 1\nname = "x"\ntitle = "x"\nbyte_order = "little"\n'
    sizes = {"s16": 2, "u16": 2, "f32": 4}
    length = 2 + sum(sizes[kind] for _, kind, *_ in types)
    return parse_format(f'{head}[frame]\nsync = "A5 F1"\nlength = {length}\n' + "\n".join(lines))


S16, SLOW = ("s16", 0.001, ""), ("s16", -0.0005, "")


@pytest.mark.parametrize(("types", "ranges"), [
    ([("z", *S16)], [32.767] * 3),  # an axis that is not there takes the largest
    # the other way round, −32768 to 32767 counts; u16 about 32768, −32.768 to 32.767 rad/s
    ([("x", *SLOW), ("y", "u16", 0.001, "raw_offset = -32768")], [16.3835, 32.767, 32.767]),
])  # fmt: skip
def test_ranges_of_a_format(types, ranges):
    np.testing.assert_allclose(full_scales(form_of(*types).message(""))["gyr"], ranges)
    np.testing.assert_allclose(full_scales(find_format("fin").message(""))["gyr"], FIN, rtol=1e-12)
    assert not full_scales(form_of(("x", "f32", 1, ""), ("y", *S16)).message(""))  # floating point has no range
