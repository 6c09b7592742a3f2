"""What no rig can be, and what no log in Flash can hold, is refused."""

from dataclasses import replace

import pytest

from plumbob.core.errors import CalibrationError, DecodeError, ParameterError, ShapeError
from plumbob.data.cards import NoiseCard, TriadNoise
from plumbob.live.rigs.firmware import FlashLog, Processor, run_firmware
from plumbob.live.rigs.rig import PLANS, make_rig, plan_for
from plumbob.protocols.format_toml import find_format, parse_format
from plumbob.protocols.ring import read_ring
from plumbob.rotations import Frame
from plumbob.simulation import scenario

FORM = find_format("buoy_attitude")
BARE = replace(FORM, messages=(replace(FORM.messages[0], fields=FORM.messages[0].fields[1:]),))
WHITE = TriadNoise(n_rpsd=[0.1] * 3, b=[0.0] * 3, k_rpsd=[0.0] * 3)
DEPTH = """
kind = "plumbob format"
version = 1
name = "mine"
title = "Mine"
byte_order = "little"
frame = { sync = "55 AA", length = 6 }
field = [{ name = "depth", type = "f32", unit = "m" }]
"""


def rig(name="buoy", duration=2.0, **how):
    return make_rig(PLANS[name], find_format(name), seed=1, duration=duration, **how)


def own(rate, **how):
    form = parse_format(DEPTH)
    plan = plan_for(form, scenario("buoy"), sensors="ideal", frame=Frame.NED, rate=rate)
    return make_rig(plan, form, seed=1, duration=1.0, **how)


def firmware(rows=200, **how):
    return run_firmware(rig("buoy_attitude").units[""].imu[:rows], **how)


def card_of(name, seed):
    return make_rig(PLANS[name], find_format(name), seed=seed, duration=1.0).units[""].calibration


CASES = [
    (lambda: own(None), ParameterError, "give a rate"),
    (lambda: own(50.0), ParameterError, "no field that a simulation can fill"),
    (lambda: find_format("mpu9999"), ParameterError, r"'mpu9999' is not a known device.* Rigs are arm, buoy"),
    (lambda: rig(faults={"length": 0.1}), ParameterError, "fault length needs a length"),
    (lambda: rig(faults={"fip": 0.1}), ParameterError, "there is no fault 'fip'; known: unplug"),
    (lambda: rig(faults={"flip": 2.0}), ParameterError, "0 to 1, but it is 2"),
    (lambda: rig("teach", mount_error=0.02), ParameterError, "--set mount_angle"),
    (lambda: rig("ring", mount_error=-1.0), ParameterError, "mount_error must be 0 to 180°"),
    (lambda: rig("arm", noise={"u9": NoiseCard("u", "t", gyr=WHITE)}), ParameterError, "no measuring unit 'u9'"),
    (lambda: rig("fin", noise=NoiseCard("unit 8", "t", acc=WHITE)), ParameterError, r"has acc, but adxrs290\+adxrs453"),
    (lambda: rig(calibration=card_of("buoy", 1)), ParameterError, "sends samples as they are"),
    (lambda: firmware(take="median"), ParameterError, "take must be one of"),
    (lambda: firmware(rows=40), ParameterError, "before a frame"),
    # 11.25 ms of each 10 ms
    (lambda: firmware(processor=Processor(clock_hz=4e6)), ParameterError, "too slow"),
    (lambda: firmware(calibration=card_of("buoy_attitude", 6)), CalibrationError, "the card is for device"),
    (lambda: FlashLog(size=4096), ParameterError, "two sectors or more"),
    (lambda: FlashLog().write(bytes(33)), ShapeError, "33 bytes are not a multiple"),
    (lambda: read_ring(bytes(4096), FORM), DecodeError, "no record of buoy_attitude is in the 4096 bytes"),
    (lambda: read_ring(FlashLog().image, FORM), DecodeError, "which are blank, as an erased chip is"),
    (lambda: read_ring(b"", BARE), DecodeError, "cannot be a log's record"),
]


@pytest.mark.parametrize(("make", "error", "match"), CASES)
def test_what_cannot_be_is_refused(make, error, match):
    with pytest.raises(error, match=match):
        make()
