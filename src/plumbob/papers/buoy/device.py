"""The buoy's own program at work [Yu2018]: its events, its line at 20 Hz and its log in Flash, emulated."""

from typing import Final, NamedTuple

import numpy as np

from plumbob.core.check import Floats
from plumbob.core.time import to_s
from plumbob.data.cards import CalibrationCard
from plumbob.door.calibrate import read_track
from plumbob.live.rigs.firmware import FORMAT, Processor, decoded, run_firmware
from plumbob.papers.buoy.trials import errors_deg
from plumbob.papers.workspace import Work, recorded_samples
from plumbob.protocols.decode import decode
from plumbob.protocols.rigs import load
from plumbob.protocols.ring import read_ring

PERIODS: Final = {"sample": 3, "fuse": 10, "send": 50}
"""Of the events, ms [Yu2018]."""
_SLIDE: Final = {"peak_speed": 2.0, "stroke": 0.4}


class Device(NamedTuple):
    """What the program did on the slide of 2 m/s and 0.4 s with the paper's card.

    Attributes
    ----------
    rates : mapping of str to float
        Events served per second, by task, Hz.
    missed : mapping of str to int
        Events that were not served.
    latest : mapping of str to float
        How late the latest call began, s.
    idle : float
        Share of the time in which the processor sleeps.
    waiting : mapping of str to int
        Events missed where the loop waits for the line and for the Flash chip.
    calls : mapping of str to (ndarray, ndarray)
        Begin and end of each call, s.
    roll, pitch : float
        Largest errors of what went out at 20 Hz, deg.
    frames, junk : int
        Frames on the wire, and bytes between them.
    stored : int
        Records that the log's image gives back.
    same : bool
        Whether these are the frames that went out, to the bit.
    years : float
        Until each sector of the log was erased 100 000 times, at 20 Hz.
    """

    rates: dict[str, float]
    missed: dict[str, int]
    latest: dict[str, float]
    idle: float
    waiting: dict[str, int]
    calls: dict[str, tuple[Floats, Floats]]
    roll: float
    pitch: float
    frames: int
    junk: int
    stored: int
    same: bool
    years: float


def run_device(work: Work, card: CalibrationCard) -> Device:
    """Let the program run with a card while the unit is slid, and read its line and its log."""
    image = work.folder / "flash.bin"
    taken = work.recorded(FORMAT, "device", scenario="slide", set=_SLIDE, calibration=card, flash_log=image)
    data = taken.capture.read_bytes()
    track, truth = decoded(data), read_track(taken.truth)
    rows = np.searchsorted(truth.t, track.t - 1e-6)
    _, pitch, roll = np.abs(errors_deg(track.q_nb, truth.q_nb[rows])).max(axis=0).tolist()
    chips = recorded_samples(taken.truth)
    done = run_firmware(chips, calibration=card)
    slow = run_firmware(chips, calibration=card, processor=Processor(uart_waits=True, flash_waits=True))
    log = read_ring(image.read_bytes(), load(FORMAT))
    frames = decode(data, load(FORMAT))
    seconds = float(chips.t[-1])
    return Device(
        rates={name: count / seconds for name, count in done.served.items()},
        missed=done.missed,
        latest=done.latest,
        idle=done.idle,
        waiting=slow.missed,
        calls={name: (to_s(call.begun_ns), to_s(call.done_ns)) for name, call in done.calls.items()},
        roll=roll,
        pitch=pitch,
        frames=len(track),
        junk=frames.counts.junk,
        stored=log.records,
        same=log.stream == data[: len(log.stream)],
        years=done.flash.life_years(),
    )
