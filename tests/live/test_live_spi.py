"""Chips on SPI, emulated, as the source of a session: start-up, polls, faults, and the same bits from a recording."""

from functools import partial

import numpy as np
import pytest

from plumbob import Stream, flags, replay
from plumbob.core.errors import DecodeError, ParameterError, PlumbobError, UnitError
from plumbob.core.event import Event
from plumbob.files.mcap import open_log
from plumbob.live.runner import run_stream
from plumbob.live.session import RecordSpec
from plumbob.live.session_toml import parse_session
from plumbob.live.sinks import Collected, RecordingSink
from plumbob.live.transports.spi_bus import SpiSource
from tests.helpers import beside
from tests.helpers.chips.adxrs290 import Adxrs290
from tests.helpers.chips.adxrs453 import Adxrs453, Fault, sensor_command
from tests.helpers.live_samples import joined

MS = 1_000_000
START_NS = 50_000_000_000
LSB = np.radians(1.0 / 80.0)  # DS-453: 80 LSB/(°/s)

ADXRS453 = beside(__file__, "adxrs453.toml")

ADXRS290 = beside(__file__, "adxrs290.toml")


class Bench:
    """A chip, and time that passes only in `sleep`; the chip feels a rate that rises by one count each ms."""

    def __init__(self, chip, feel):
        self.t_ns, self.chip, self.feel = START_NS, chip, feel
        self.transfers, self.at, self.flipped = 0, {}, 0

    def clock(self):
        return self.t_ns

    def sleep(self, seconds):
        self.t_ns += round(seconds * 1e9)

    def transfer(self, data):
        self.transfers += 1
        self.at.get(self.transfers, lambda: None)()
        self.chip.sample(self.feel(self.t_ns), self.t_ns)
        self.t_ns += 8_000  # 32 bits at 4 MHz
        reply = bytearray(self.chip.transfer(data))
        reply[1] ^= 0x10 if self.transfers == self.flipped else 0
        return bytes(reply)

    def close(self):
        pass


def counts(t_ns):
    """Rate in counts, to within ±300 °/s."""
    return (t_ns - START_NS) // MS % 20_000 - 10_000


def yaw():
    return Bench(Adxrs453(START_NS), lambda t: {"gyr.z": counts(t) * LSB, "temp_c": 25.0})


def session(text=ADXRS453):
    return parse_session(text, {}.__getitem__, name="bench")


def run(bench, duration, path=None, text=ADXRS453):
    chosen = session(text)
    line, found = Stream(chosen), Collected()
    recording_sink = None if path is None else RecordingSink(chosen, RecordSpec(str(path)), offset=lambda: 0)
    run_stream(
        line, opened(bench, chosen), sinks=[found], recording=recording_sink, duration=duration, clock=bench.clock
    )
    return line, found


def opened(bench, chosen):
    how = {"open_bus": lambda: bench, "clock": bench.clock, "sleep": bench.sleep}
    return SpiSource(**chosen.source.settings, **how).open()


def flagged(parts, flag):
    return np.flatnonzero(joined(parts, "flags") & flag)


def test_from_the_chip_to_the_recording_to_the_replay(tmp_path):
    line, live = run(yaw(), 2.0, tmp_path / "a.mcap")
    assert np.unique(np.diff(live.t_ns)).tolist() == [4 * MS]  # 250 Hz: DS-453 wants faults read so often
    assert line.decoder.counts.junk == 0
    gyr = joined(live.parts, "gyr")[:, 2]
    np.testing.assert_allclose(gyr[20:] / LSB, counts(live.t_ns[20:] - 4 * MS), atol=1e-6)  # one poll old
    again = replay(tmp_path / "a.mcap").found
    np.testing.assert_array_equal(again.t_ns, live.t_ns)
    for name in ("gyr", "flags"):
        np.testing.assert_array_equal(joined(again.parts, name), joined(live.parts, name))
    assert {len(row.data) for row in open_log(tmp_path / "a.mcap") if row.topic == "raw"} == {4}


def test_start_up_runs_the_self_test_and_without_it_nothing_is_believed_that_the_chip_does_not():
    _, found = run(yaw(), 0.5)
    (opening,) = found.events
    assert "start answered 00000001 " in opening.text  # DS-453: the first reply
    *_, first, second = opening.text.split("answered ")[1].partition(")")[0].split()
    for reply in (first, second):
        word = int(reply, 16)
        assert (word >> 26 & 3, word >> 1 & 0x7F) == (2, 0x7F)  # ST = 2, every fault
    assert not (flagged(found.parts, flags.GYR_INVALID) >= 13).any()  # gone within 50 ms; replies are one poll old
    _, found = run(yaw(), 0.3, text=ADXRS453.replace("start =", "# "))
    invalid = flagged(found.parts, flags.GYR_INVALID)
    assert {*range(100 // 4 - 1)} <= {*invalid}  # DS-453: 100 ms from power-up; the first reply of all has no parity
    assert not (invalid >= 28).any()
    settings, rate = session().source.settings, sensor_command()
    assert settings["exchange"] == (rate,)
    assert settings["start"] == (0.1, sensor_command(check=True), 0.05, rate, 0.05, rate, rate)


def test_faults_of_the_chip_are_flagged_for_as_long_as_they_are_told():
    bench = yaw()
    bench.at = {n: partial(setattr, bench.chip, "faults", f) for n, f in ((50, Fault.PLL), (60, Fault(0)))}
    _, found = run(bench, 1.0)
    invalid = flagged(found.parts, flags.GYR_INVALID)
    transfers = invalid + 5  # four are of the start, and they count from 1
    assert transfers.tolist() == list(range(51, 62))  # replies to 50 to 59, and to 60, which is told what was latched
    faults = np.concatenate([part.frames.columns["faults"] for part in found.parts])
    assert set(faults[invalid].tolist()) == {int(Fault.PLL)}


def test_a_flipped_bit_missed_deadlines_and_a_lost_chip_are_gaps():
    bench = yaw()
    bench.flipped = 100
    line, found = run(bench, 1.0)
    assert (line.decoder.counts.bad_content, line.decoder.counts.junk) == (1, 4)
    assert flagged(found.parts, flags.GAP).size == 1
    assert np.diff(found.t_ns).max() == 8 * MS
    assert line.report()["time"]["lost"] == 1
    bench = yaw()
    bench.at = {100: lambda: bench.sleep(0.021)}
    line, found = run(bench, 1.0)
    _, late = found.events
    assert (late.kind, late.count) == ("late", 4)  # 4, 8, 12 and 16 ms; that of 20 is met
    gaps = np.flatnonzero(np.diff(found.t_ns) > 6 * MS) + 1
    assert flagged(found.parts, flags.GAP).tolist() == gaps.tolist() != []
    assert line.report()["time"]["lost"] == 5  # what 25 ms have room for; the event has the exact number
    assert line.faults == 0
    line, bench, parts = Stream(session()), yaw(), []
    source = opened(bench, line.session)
    for number in range(200):
        if number == 100:
            line.feed(Event(bench.t_ns, "lost", "the bus is gone"))
            bench.sleep(0.5)
            line.feed(Event(bench.t_ns, "reopened", "it is back"))
        parts += [part for item in source.read(1.0) if (part := line.feed(item)) is not None]
    assert flagged(parts, flags.GAP).size == 1


def test_a_chip_that_answers_behind_its_command_byte():
    bench = Bench(Adxrs290(START_NS), lambda t: {"gyr.x": 0.5, "gyr.y": -0.25, "temp_c": -3.5})
    _, found = run(bench, 1.0, text=ADXRS290)
    gyr = joined(found.parts, "gyr")[5:, :2]
    np.testing.assert_allclose(gyr, np.tile([0.5, -0.25], (len(gyr), 1)), atol=np.radians(0.5 / 200))
    np.testing.assert_allclose(joined(found.parts, "temp_c")[5:], -3.5, atol=0.05)
    assert found.parts[0].sensed.meta.rate_nominal == 100.0


WRONG = {
    "no commands": (ADXRS453.replace('["20 00 00 00"]', "[]"), PlumbobError, "0 bytes"),
    "no hex": (ADXRS453.replace("20 00 00 00", "2000000g"), DecodeError, "bytes in hex"),
    "wrong length": (ADXRS453.replace("20 00 00 00", "20 00 00"), ParameterError, "a poll gives 3 bytes"),
    "command byte not skipped": (ADXRS290.replace("skip = 1\n", ""), ParameterError, "a poll gives 7 bytes"),
    "wait of another unit": (ADXRS453.replace("100 ms", "100 mm"), DecodeError, "bytes in hex"),
    "rate without unit": (ADXRS453.replace("250 Hz", "250"), UnitError, "has no unit"),
    "no mode": (ADXRS453.replace("mode = 0\n", ""), DecodeError, "needs the key 'mode'"),
    "mode 4": (ADXRS453.replace("mode = 0", "mode = 4"), DecodeError, "at most 3"),
    "no format": (ADXRS453.replace('[format]\nname = "adxrs453"\n', ""), DecodeError, "needs the key 'format'"),
}


@pytest.mark.parametrize("case", WRONG)
def test_wrong_session_is_refused_with_a_word(case):
    text, error, word = WRONG[case]
    with pytest.raises(error, match=word):
        session(text)
