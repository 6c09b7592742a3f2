"""A device that prints text: what its lines give live is what a file of the same text gives, to the bit."""

import json
import os
import termios
import threading
import time

import numpy as np
import pytest

import plumbob
from plumbob.core import flags
from plumbob.core.errors import DecodeError, LineError, ParameterError
from plumbob.core.text import sentence_checksum
from plumbob.files.mcap import open_log
from plumbob.files.profile import parse_profile
from plumbob.files.text_table import printed_as_objects
from plumbob.live import rows
from plumbob.live.lines import CLOCK, decoder_of, line_format
from plumbob.live.record import record
from plumbob.live.replay import replay
from plumbob.live.rigs.rig import PLANS, make_rig
from plumbob.protocols.format_toml import find_format
from tests.helpers import beside, commandline

BANNER = ["Adafruit BMX055 test", "calibrating... done", "ready"]
ANSWERS = {"frame": "ENU", "acc.sign": "specific-force"}


def measured(k, rate):
    """Acceleration, m/s², rates, deg/s, and field, µT, of sample k of a hand that turns a unit, with noise."""
    rng, t = np.random.default_rng(k), k / rate
    roll, pitch = np.radians(25.0 * np.sin(2.0 * t)), np.radians(15.0 * np.sin(3.0 * t))
    gyr = (50.0 * np.cos(2.0 * t), 45.0 * np.cos(3.0 * t), 5.0 * np.sin(t))
    acc = 9.80665 * np.array([-np.sin(pitch), np.cos(pitch) * np.sin(roll), np.cos(pitch) * np.cos(roll)])
    mag = (20.0 * np.cos(pitch), 5.0 * np.sin(roll), -42.0)
    return acc + rng.normal(0, 0.02, 3), gyr + rng.normal(0, 0.1, 3), mag + rng.normal(0, 0.3, 3)


def cells(values, digits=3):
    return ",".join(f"{value:.{digits}f}" for value in values)


def csv(k, rate, unit=1e3):
    acc, gyr, _ = measured(k, rate)
    return [f"{round(k / rate * unit)},{cells(acc)},{cells(gyr)}"]


def tabs(k, rate):
    acc, gyr, _ = measured(k, rate)
    return ["\t".join([f"{k / rate:.3f}", *cells(acc).split(","), *cells(gyr).split(",")])]


def labels(k, rate):
    acc, gyr, _ = measured(k, rate)
    named = zip(("ax", "ay", "az", "gx", "gy", "gz"), (*acc, *gyr), strict=True)
    return [f"t: {round(k / rate * 1000)} " + " ".join(f"{name}: {value:.3f}" for name, value in named)]


def sentence(text):
    return [f"${text}*{sentence_checksum(text)}"]


def angles(k, rate):
    acc, gyr, mag = measured(k, rate)
    return sentence(f"VNYMR,+010.5,-002.1,+003.3,{cells(mag / 100.0, 4)},{cells(acc)},{cells(np.radians(gyr), 5)}")


def quaternion(k, rate):
    acc, gyr, mag = measured(k, rate)
    return sentence(f"VNQMR,+0.1000,+0.2000,+0.3000,+0.9274,{cells(mag / 100.0, 4)},{cells(acc)},"
                    f"{cells(np.radians(gyr), 5)}")  # fmt: skip


def below_titles(k, rate):
    return [
        line
        for title, triad in zip(("Accelerometer", "Gyroscope"), measured(k, rate)[:2], strict=True)
        for line in ("", f"{title}:", *(f" {axis} = {value:.3f}" for axis, value in zip("XYZ", triad, strict=True)))
    ]


def prefixes(k, rate):
    acc, gyr, _ = measured(k, rate)
    stamp = round(k / rate * 1000)
    return [f"ACC,{stamp},{cells(acc)}", f"GYR,{stamp},{cells(gyr)}"]


def messages(k, rate):
    acc, gyr, _ = measured(k, rate)
    stamp = ["header:", "  stamp:", f"    sec: {1_700_000_000 + k // 100}", f"    nanosec: {k % 100 * 10_000_000}"]
    named = (("angular_velocity", np.radians(gyr)), ("linear_acceleration", acc))
    rows = [[f"{name}:", *(f"  {axis}: {value:.6f}" for axis, value in zip("xyz", triad, strict=True)),
             f"{name}_covariance:", *["- 0.1"] * 9] for name, triad in named]  # fmt: skip
    return [*stamp, *rows[0], *rows[1], "---"]


NAMES = ["millis,ax (m/s2),ay,az,gx (deg/s),gy,gz"]
UNITS = {"gyr.unit": "deg/s", "acc.unit": "m/s2"}
FORMS = {
    "csv": {"line": csv, "head": NAMES},
    "tabs": {"line": tabs, "answers": UNITS | {"time.unit": "s"}},
    "labels": {"line": labels, "answers": UNITS | {"time.unit": "ms"}},
    "banner": {"line": csv, "head": [*BANNER, *NAMES]},
    "checksum": {"line": angles, "stamped": False},
    "quaternion": {"line": quaternion, "stamped": False},
    "prefix per sensor": {"line": prefixes, "answers": UNITS | {"time.unit": "ms"}},
    "an axis a line below its title": {"line": below_titles, "answers": UNITS, "stamped": False},
    "messages of ROS": {"line": messages, "head": ["---"]},
    "1 kHz": {"line": lambda k, rate: csv(k, rate, 1e6), "head": ["micros" + NAMES[0][6:]], "rate": 1000.0},
    "cut at random": {"line": csv, "head": NAMES, "cut": 40},
    "reboot": {"line": csv, "head": [*BANNER, *NAMES], "reboot": 0.7},
    "low rate": {"line": csv, "head": NAMES, "rate": 20.0, "cut": 4, "lasts": 1.6},
    "CRLF": {"line": csv, "head": NAMES, "end": "\r\n"},
    "CR": {"line": csv, "head": NAMES, "end": "\r"},
}


def test_blank_lines_and_lines_without_an_end_are_no_message():
    *before, message, last, end = printed_as_objects("  \n---\na:\n  x: 1\n---\n{}\nb:").split("\n")
    assert (before, json.loads(message), last, end) == (["  ", "---", "", ""], {"a": {"x": "1"}}, "{}", "b:")


class Arduino:
    """A device on a pseudo-terminal that begins to print when its port is opened, as an Arduino does."""

    def __init__(self, line, *, head=(), rate=100.0, end="\n", cut=0, reboot=None, **_):
        self._line, self._head, self._rate, self._end, self._cut, self._reboot = line, head, rate, end, cut, reboot
        self._master, self._slave = os.openpty()
        os.set_blocking(self._master, False)
        self.port = os.ttyname(self._slave)
        self._stop, self._thread = threading.Event(), None

    def begin(self, *_):
        self._thread = threading.Thread(target=self._print, daemon=True)
        self._thread.start()

    def close(self):
        self._stop.set()
        if self._thread:
            self._thread.join()
        self._thread = None
        self._stop.clear()

    def _text(self):
        """Lines of the next boots, with the time at which each is due, s."""
        due = 0.0
        for boot in range(2 if self._reboot else 1):
            yield due, self._head
            for k in range(round(self._reboot * self._rate) if self._reboot and not boot else 1_000_000):
                yield due + k / self._rate, self._line(k, self._rate)
            due += (self._reboot or 0.0) + 0.2

    def _print(self):
        start, rng = time.monotonic(), np.random.default_rng(7)
        for due, lines in self._text():
            if self._stop.wait(max(0.0, start + due - time.monotonic())):
                return
            data = self.on_line("".join(line + self._end for line in lines).encode())
            while data:
                size = int(rng.integers(1, self._cut)) if self._cut else len(data)
                try:
                    data = data[os.write(self._master, data[:size]) :]
                except BlockingIOError:  # nobody reads
                    return

    def on_line(self, data):
        return data


SPEEDS = {getattr(termios, name): int(name[1:]) for name in dir(termios) if name[0] == "B" and name[1:].isdigit()}


class Uart(Arduino):
    """The same behind a UART of one speed, of which a reader at another makes other bytes."""

    def __init__(self, line, *, speed, **how):
        super().__init__(line, **how)
        self._speed = speed

    def on_line(self, data):
        read_at = SPEEDS[termios.tcgetattr(self._master)[5]]  # a terminal's two ends have one setting
        if read_at == self._speed:
            return data
        bits = [1, 1, *(bit for byte in data for bit in (0, *(byte >> k & 1 for k in range(8)), 1)), *[1] * 12]
        step, t, said = self._speed / read_at, 0.0, bytearray()
        while t + 10 * step < len(bits):
            if bits[int(t)]:
                t += min(step, 0.5)
                continue
            said.append(sum(bits[int(t + (k + 1.5) * step)] << k for k in range(8)))
            t += 9.5 * step
        return bytes(said)


@pytest.mark.parametrize("speed", [9600, 57600])
def test_speed_of_a_port_is_found_by_its_text_and_said(speed):
    device, said = Uart(labels, speed=speed), []

    def note(text):
        said.append(text)
        if len(said) == 1:
            device.begin()

    draft = plumbob.profile(
        device.port, duration=0.5, accept=True, answers=ANSWERS | FORMS["labels"]["answers"], note=note
    )
    device.close()
    assert draft.questions == ()
    assert said[1].endswith(f"sends text at {speed} baud; record it with --baud {speed}")


def test_speed_is_not_guessed_where_frames_come(tmp_path):
    rig = make_rig(PLANS["buoy"], find_format("buoy"), seed=1, duration=20.0)
    frames = [bytes(frame).decode("latin-1") for frame in rig.frames]
    device = Uart(lambda k, rate: [frames[k % len(frames)]], end="", speed=115200)
    device.on_line = lambda data: Uart.on_line(device, data.decode().encode("latin-1"))
    with pytest.raises(LineError, match=r"looks like buoy \(\d+ frames\) at 115200 baud"):
        plumbob.profile(device.port, duration=0.5, note=device.begin, out=tmp_path / "p.toml")
    device.close()
    assert not (tmp_path / "p.toml").exists()


def raw_text(path):
    return b"".join(message.data for message in open_log(path) if message.topic == rows.RAW)


def parts_of(text, form):
    """Text as files of one boot each; what came before the first line end may be half a line, and is left out."""
    end = form.get("end", "\n").encode()
    text = text[text.index(end) + len(end) :]
    if not form.get("reboot"):
        return [text]
    before, _, rest = text.rpartition(BANNER[0].encode())
    return [before, rest.partition(NAMES[0].encode() + end)[2]]


@pytest.mark.parametrize("name", FORMS)
def test_text_form_is_drafted_recorded_replayed_and_equal_to_the_file(name, tmp_path):
    form = FORMS[name]
    profile, recording = tmp_path / "port.profile.toml", tmp_path / "port.mcap"
    device = Arduino(**form)
    answers = ANSWERS | form.get("answers", {})
    draft = plumbob.profile(
        device.port, duration=0.8 * form.get("lasts", 1.0), accept=True, answers=answers, out=profile, note=device.begin
    )
    assert draft.questions == ()
    device.close()
    recorded = record(port=device.port, profile=profile, filter="mekf", out=recording, opened=device.begin,
                      duration=1.25 * form.get("lasts", 1.0))  # fmt: skip
    device.close()
    assert not recorded.lossy
    again = replay(recording, check=True)
    assert again.comparison.equal
    live = again.found.imu(calibrated=False)
    assert len(live) == recorded.samples > 20
    known = np.flatnonzero(np.isfinite(np.hstack([getattr(live, triad) for triad in live.triads])).all(axis=1))
    live = live[int(known[0]) : int(known[-1]) + 1]  # a file's rows begin where all of its sensors have begun
    files = []
    for number, text in enumerate(parts_of(raw_text(recording), form)):
        file = tmp_path / f"log{number}.txt"
        file.write_bytes(text)
        files.append(plumbob.read(file, profile=profile).imu)
    for triad in live.triads:
        np.testing.assert_array_equal(getattr(live, triad), np.concatenate([getattr(imu, triad) for imu in files]))
    if not form.get("stamped", True):  # arrival says the time: the mean step is the printer's
        assert np.median(np.diff(live.t)) == pytest.approx(1.0 / form.get("rate", 100.0), rel=0.05)
        return
    steps = np.diff(live.t_ns)
    same = np.ones(steps.size, dtype=bool)
    if len(files) > 1:
        same[len(files[0]) - 1] = False  # how long it was away, the host alone knows
        assert 0.1 < live.t[len(files[0])] - live.t[len(files[0]) - 1] < 1.0
        assert live.flags[len(files[0])] & flags.GAP
        assert "begins again" in recorded.text()
    np.testing.assert_array_equal(steps[same], np.concatenate([np.diff(imu.t_ns) for imu in files]))


PROFILE = beside(__file__, "lines.profile.toml")


def decoded(text, profile=PROFILE, *, sizes=None, step_ns=10_000_000):
    """Samples of a text, in pieces of some sizes, one each read; and the decoder."""
    decoder = decoder_of(line_format(parse_profile(profile), midway=False))
    parts, at, k = [], 0, 0
    data = text if isinstance(text, bytes) else text.encode()
    while at < len(data):
        size = len(data) if sizes is None else int(sizes[k % len(sizes)])
        parts.append(decoder.feed(data[at : at + size], k * step_ns))
        at, k = at + size, k + 1
    parts.append(decoder.finish())
    frames = [each for part in parts for each in part.values()]
    columns = {name: np.concatenate([each.columns[name] for each in frames]) for name in frames[0].columns}
    return columns, decoder


def lines_of(stamps, end="\n"):
    return "".join(f"{stamp},0.1,0.2,9.8,1.5,{k}.25,-3{end}" for k, stamp in enumerate(stamps))


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_rows_do_not_depend_on_how_the_bytes_are_cut(end):
    text = "boot\n" + lines_of(range(1000, 2000, 10), end)
    at_once, _ = decoded(text)
    sizes = np.random.default_rng(3).integers(1, 60, 500)
    in_pieces, decoder = decoded(text, sizes=sizes)
    for name, column in at_once.items():
        np.testing.assert_array_equal(in_pieces[name], column)
    assert len(at_once["gyr.x"]) == 100
    np.testing.assert_array_equal(at_once["gyr.y"], np.radians(np.arange(100) + 0.25))
    counts = decoder.counts
    assert counts.framed + counts.junk + counts.pending == counts.received == len(text)


def test_axes_below_titles_do_not_depend_on_how_the_bytes_are_cut(tmp_path):
    text = "".join(f"{line}\n" for k in range(100) for line in below_titles(k, 100.0))
    (tmp_path / "a.txt").write_text(text)
    answers = ANSWERS | UNITS | {"time.rate": "100 Hz"}
    profile = plumbob.profile(tmp_path / "a.txt", accept=True, answers=answers).text
    at_once, in_pieces = (decoded(text, profile, sizes=sizes)[0] for sizes in (None, [1, 5, 2, 60, 9, 33]))
    for name, column in at_once.items():
        np.testing.assert_array_equal(in_pieces[name], column)
    assert len(at_once["gyr.x"]) == 100


def test_bad_lines_are_left_out_counted_and_named():
    good = lines_of(range(0, 500, 10)).splitlines(keepends=True)
    text = "".join(
        [*good[:20], "200,0.1,0.2\n", *good[20:30], "300,0.1,oops,9.8,1,2,3\n", b"\xff\n".decode("latin-1"), *good[30:]]
    )
    columns, decoder = decoded(text)
    assert len(columns[CLOCK]) == 50
    (note,) = decoder.notes
    assert (note.code, note.values["count"]) == ("reading.lines_left_out", 3)
    assert "line 21 has 3 cells" in str(note) or "column 4" in str(note)


@pytest.mark.parametrize(("last", "count"), [("1000,0.1,0.2,9.8,1.5,7.25,-3", 11), ("1000,0.1,0.2,9.8,1.5,7.25", 10)])
def test_last_line_without_an_end_counts_unless_it_is_cut(last, count):
    columns, _ = decoded(lines_of(range(900, 1000, 10)) + last)
    assert len(columns[CLOCK]) == count


@pytest.mark.parametrize("bits", [16, 32])
def test_counter_that_comes_round_goes_on(bits):
    stamps = (np.arange(300) * 10 + (1 << bits) - 1500) % (1 << bits)
    columns, decoder = decoded(lines_of(stamps))
    np.testing.assert_array_equal(np.diff(columns[CLOCK]), 10_000_000)
    assert [note.code for note in decoder.notes] == ["reading.clock_turned"]


def test_clock_that_begins_again_goes_on_by_the_time_that_passed_at_the_host():
    before, after = lines_of(range(50_000, 51_000, 10)), lines_of(range(0, 1000, 10))
    sizes = [len(before), len(after)]
    columns, decoder = decoded(before + after, sizes=sizes, step_ns=3_000_000_000)
    steps = np.diff(columns[CLOCK])
    assert steps[99] == 3_000_000_000
    np.testing.assert_array_equal(np.delete(steps, 99), 10_000_000)
    assert [note.code for note in decoder.notes] == ["reading.clock_again"]


@pytest.mark.parametrize("stamp", [90, 99_000])
def test_single_stamp_far_off_is_left_out(stamp):
    stamps = [*range(50_000, 50_500, 10)]
    stamps[30] = stamp
    columns, decoder = decoded(lines_of(stamps))
    np.testing.assert_array_equal(columns[CLOCK], np.delete(np.arange(50_000, 50_500, 10), 30) * 1_000_000)
    assert "far off" in str(decoder.notes[0])


def test_stamps_that_repeat_are_spread_over_their_tick_and_objects_of_json_are_rows_by_their_keys():
    columns, _ = decoded(lines_of(np.arange(400) // 4 * 10))
    np.testing.assert_array_equal(np.diff(columns[CLOCK])[8:], 2_500_000)
    named = PROFILE.replace('","', '"json"').replace("false", "true").replace("column = 1", 'column = "t"')
    named = named.replace("[5, 6, 7]", '["g[1]", "g[2]", "g[3]"]').replace("[2, 3, 4]", '["a.x", "a.y", "a.z"]')
    objects = [{"t": k * 10, "a": {"x": 0.1, "y": 0.2, "z": 9.8}, "g": [1, 2, k]} for k in range(20)]
    columns, _ = decoded("".join(json.dumps(each) + "\n" for each in objects), named)
    np.testing.assert_array_equal(columns["gyr.z"], np.radians(np.arange(20.0)))


def test_standard_input_is_recorded_to_its_end(tmp_path):
    (tmp_path / "p.toml").write_text(PROFILE)
    text = lines_of(range(0, 3000, 10))
    reading, writing = os.pipe()
    kept = os.dup(0)
    os.dup2(reading, 0)
    try:
        os.write(writing, text.encode())
        os.close(writing)
        commandline.ok(
            "record", "-", "--profile", tmp_path / "p.toml", "--out", tmp_path / "r.mcap", "--filter", "mekf"
        )
    finally:
        os.dup2(kept, 0)
        os.close(reading)
        os.close(kept)
    assert raw_text(tmp_path / "r.mcap") == text.encode()
    (tmp_path / "r.txt").write_text(text)
    imu, again = (
        plumbob.read(tmp_path / "r.txt", profile=tmp_path / "p.toml").imu,
        replay(tmp_path / "r.mcap", check=True),
    )
    assert again.comparison.equal
    np.testing.assert_array_equal(again.imu.gyr, imu.gyr)
    np.testing.assert_array_equal(again.imu.t_ns, imu.t_ns)


def test_messages_of_a_websocket_are_lines_and_it_is_connected_again(tmp_path):
    from websockets.sync.server import serve

    (tmp_path / "p.toml").write_text(PROFILE)
    lines, served = lines_of(range(0, 2000, 10)).splitlines(), []

    def send(connection):
        served.append(connection.request.path)
        half = lines[:100] if len(served) == 1 else lines[100:]
        for line in half[:-1]:
            connection.send(line)
        connection.send([half[-1][:5], half[-1][5:] + "\n"])  # in two fragments, with an end of its own

    with serve(send, "127.0.0.1", 0) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        url = f"ws://127.0.0.1:{server.socket.getsockname()[1]}/imu"
        made = record(port=url, profile=tmp_path / "p.toml", out=tmp_path / "r.mcap", duration=2.0)
        server.shutdown()
    assert served[:2] == ["/imu", "/imu"]
    assert [*filter(None, raw_text(tmp_path / "r.mcap").decode().split("\n"))][:200] == lines
    assert made.samples >= 200
    with pytest.raises(ParameterError, match="not an open WebSocket"):
        record(port="ws:nowhere", profile=tmp_path / "p.toml")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (('unit = "deg/s"', 'unit = "deg/s"\ndelay = "5 ms"'), "delay of a sensor is for files"),
        (('separator = ","', 'separator = ","\nencoding = "utf-16"'), "encoding utf-16 is for files"),
    ],
)  # fmt: skip
def test_what_a_line_cannot_do_is_refused_before_it_opens(change, words):
    with pytest.raises(ParameterError, match=words):
        line_format(parse_profile(PROFILE.replace(*change)), midway=False)


def test_session_names_the_profile_of_its_lines_and_text_that_nothing_estimates_is_refused(tmp_path):
    (tmp_path / "p.toml").write_text(PROFILE)
    file = tmp_path / "s.toml"
    text = (
        'kind = "plumbob session"\nversion = 1\n[source]\nkind = "tcp"\nhost = "a.b"\nport = 5000\nlines = "p.toml"\n'
    )
    file.write_text(text)
    session = plumbob.load_session(file)
    assert (session.meta.frame, session.texts["p.toml"]) == ("ENU", PROFILE)
    file.write_text(text + '[format]\nname = "buoy"\n')
    with pytest.raises(DecodeError, match=r"\[format\] does not go with source.lines"):
        plumbob.load_session(file)
    (tmp_path / "p.toml").write_text(PROFILE)
    with pytest.raises(ParameterError, match="nothing estimates them"):
        record(port="/dev/none", profile=tmp_path / "p.toml", text=tmp_path / "a.txt")
    assert not (tmp_path / "a.txt").exists()
