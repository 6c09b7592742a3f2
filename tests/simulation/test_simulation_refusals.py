"""What cannot be simulated is refused, each by its own rule."""

import math
from dataclasses import replace

import numpy as np
import pytest

from plumbob import Frame, apply_card, simulate, simulate_chain
from plumbob.core.errors import CalibrationError, FrameError, ParameterError, PlumbobError, ShapeError
from plumbob.data.cards import NoiseCard, TriadNoise
from plumbob.data.chain import Chain, Segment
from plumbob.simulation import (
    CHAINS,
    Dipole,
    PoseMotion,
    SoftTissue,
    TriadErrors,
    draw_module,
    earth_field,
    scenario,
    waypoints,
)
from plumbob.simulation.errors import AttitudeErrors
from plumbob.simulation.signals import Moves

PARTS = "mpu6000+hmc5983"
TRIAD = TriadNoise(n_rpsd=[1e-3] * 3, b=[0.0] * 3, k_rpsd=[0.0] * 3)
NOISE = NoiseCard("unit 7", "Allan analysis", gyr=TRIAD)
WHOLE = {"frame": Frame.NED, "sensors": "ideal", "unit": "calibrated", "seed": 3}
LEVEL = [1.0, 0.0, 0.0, 0.0]
TWO_POSES = np.deg2rad([[0] * 6, [0, 120, 0, 0, 0, 0]])


def rod(name="rod", **changes):
    return simulate(name, **{**WHOLE, "duration": 20.0, **changes})


def chained(**changes):
    given = {"chain": "arm", "program": "slow", "frame": "NED", "unit": "calibrated", "seed": 1, "duration": 2.0}
    return simulate_chain(**(given | changes))


def without(left_out):
    return simulate("static", **{name: value for name, value in WHOLE.items() if name != left_out})


def field(**changes):
    return earth_field(Frame.NED, **({"strength": 50.0, "dip": 1.0, "declination": 0.0} | changes))


def angles(**changes):
    return AttitudeErrors(**({"heading": 0.1, "tilt": 0.1} | changes))


def poses(attitudes, dwell):
    return PoseMotion(Frame.NED, attitudes, dwell, 1.0)


def taught(attitudes):
    return waypoints(CHAINS["teach"], attitudes)


def moves(start, duration):
    return Moves(start, duration, (1.0,) * len(start))


def another_card(**changes):
    return apply_card(rod(sensors=PARTS, unit="random", seed=4).calibration, rod(sensors=PARTS, **changes).imu)


CASES = [
    # a recording of one unit
    (rod, {"frame": "north"}, FrameError, "ENU"),
    (rod, {"unit": "perfect"}, ParameterError, "random, calibrated"),
    (rod, {"sensors": "abc"}, ParameterError, "known:"),
    (rod, {"name": "abc"}, ParameterError, "known:"),
    (rod, {"frequncy": 1.0}, ParameterError, "no parameter 'frequncy'"),
    (rod, {"rate": -1.0}, ParameterError, "rate"),
    (rod, {"seed": -1}, ParameterError, "seed must be"),
    (rod, {"seed": 1.5}, ParameterError, "seed must be"),
    (rod, {"duration": 0.0}, ParameterError, "rate × duration"),
    (rod, {"lost": 1.0}, ParameterError, "lost"),
    (rod, {"dip": 2.0}, ParameterError, "dip"),
    (rod, {"sensors": PARTS, "mag_rate": -3.0}, ParameterError, "rate must be positive"),
    (rod, {"sensors": "mpu3050", "temp_c": -300.0}, ParameterError, r"-273\.15 °C, absolute zero"),
    (rod, {"sensors": "mpu3050", "temp_c": "-1 K"}, ParameterError, r"-273\.15 °C, absolute zero"),
    (rod, {"warm_up": "15 K"}, PlumbobError, "RISE, TIME, as '15 K, 120 s', but it is '15 K'"),
    (rod, {"warm_up": "15 m, 120 s"}, PlumbobError, "unit of temperature"),
    (rod, {"warm_up": "15 K, 120 m"}, PlumbobError, "unit of time"),
    (rod, {"warm_up": "15 K, 0 s"}, PlumbobError, "the time of warm_up must be above 0"),
    (rod, {"warm_up": (math.nan, 1.0)}, PlumbobError, "the rise of warm_up must be"),
    (rod, {"sensors": "mpu6000", "noise": replace(NOISE, mag=TRIAD)}, ParameterError, "gyr, mag, but mpu6000 has gyr"),
    (rod, {"noise": NoiseCard("unit 7", "empty")}, ParameterError, "has no triad"),
    (rod, {"name": scenario("coning"), "frequency": 2.0}, ParameterError, "given as an object"),
    *((without, {"left_out": name}, TypeError, name) for name in ("frame", "unit") if name in WHOLE),
    (another_card, {"unit": "random"}, CalibrationError, "device"),
    # a chain
    (chained, {"chain": "leg"}, ParameterError, "no chain"),
    (chained, {"program": "dance"}, ParameterError, "no program of a chain"),
    (chained, {"frame": "XYZ"}, FrameError, "XYZ"),
    (chained, {"jitter": 1e-4}, ParameterError, "one time line"),
    (chained, {"disturbances": [Dipole((0, 0, 0), (0, 0, 1), on="nose")]}, ParameterError, "'nose' is not a segment"),
    (chained, {"mounts": {}, "mount_angle": 0.1}, ParameterError, "either mounts"),
    (chained, {"mounts": {"foot": CHAINS["arm"].segments[-1].mount}}, ParameterError, "no unit 'foot'"),
    (chained, {"mount_angle": -0.1}, ParameterError, "mounting error"),
    (chained, {"sensors": {}}, ParameterError, "'upperarm' has none"),
    (chained, {"soft": "maybe"}, ParameterError, "yes or no"),
    (chained, {"bend": "20 uT", "bend_at": "base"}, ParameterError, "not at 'base'"),
    (chained, {"strenght": 3.0}, ParameterError, "no setting 'strenght'"),
    (chained, {"chain": "five", "base": (1, 0, 0, 0)}, ParameterError, "leave base out"),
    (chained, {"duration": -1.0}, ParameterError, "duration"),
    (chained, {"chain": Chain("bare", (Segment("a"),))}, ParameterError, "has a unit"),
    (SoftTissue, {"damping": 1.0}, ParameterError, "damping"),
    (taught, {"attitudes": TWO_POSES}, ParameterError, r"pose 1 takes j2 to 120\.0°, beyond its limits"),
    (taught, {"attitudes": np.zeros((1, 6))}, ParameterError, "at least two poses"),
    (taught, {"attitudes": np.zeros((2, 5))}, ShapeError, "poses"),
    # scenarios and what they are made of
    (scenario, {"name": "sailing"}, ParameterError, "known: static, turntable, ball"),
    (scenario, {"name": "slide", "speed": 1.0}, ParameterError, "no parameter 'speed'; known: peak_speed, stroke"),
    (scenario, {"name": "slide", "stroke": 0.0}, ParameterError, "stroke must be 0.05 to 60 s"),
    (scenario, {"name": "slide", "strokes": 2.5}, ParameterError, "whole number"),
    (scenario, {"name": "turntable", "peak_rate": "90"}, ParameterError, "needs a unit"),
    (scenario, {"name": "buoy", "peakedness": math.nan}, ParameterError, "peakedness must be"),
    (scenario, {"name": "buoy", "height": True}, ParameterError, "height must be"),
    (scenario, {"name": "rod", "fastest": 3.0, "slowest": 2.0}, ParameterError, "fastest must not exceed slowest"),
    (scenario, {"name": "rod", "vibration_low": 30.0}, ParameterError, "vibration_low must not exceed"),
    (scenario, {"name": "coning", "half_angle": 3.2}, ParameterError, "half_angle must be"),
    (poses, {"attitudes": np.empty((0, 4)), "dwell": 1.0}, ShapeError, "at least one pose"),
    (poses, {"attitudes": [LEVEL], "dwell": 0.0}, ParameterError, "must be positive"),
    (moves, {"start": (0.0, 1.0), "duration": (1.5, 1.0)}, ParameterError, "overlap"),
    (moves, {"start": (0.0,), "duration": (0.0,)}, ParameterError, "positive duration"),
    (field, {"strength": 0.0}, ParameterError, "field"),
    (field, {"strength": math.nan}, ParameterError, "field"),
    (field, {"dip": 1.6}, ParameterError, "field"),
    (field, {"declination": 4.0}, ParameterError, "field"),
    # sensors
    (draw_module, {"sensors": "mpu9999", "seed": 1}, ParameterError, "known: .*adxrs290.*mpu6000"),
    (draw_module, {"sensors": "adis16355:other", "seed": 1}, ParameterError, "no sensor"),
    (draw_module, {"sensors": "", "seed": 1}, ParameterError, "no sensor"),
    (draw_module, {"sensors": "adxrs290", "seed": 1}, ParameterError, "add a part with z"),
    (draw_module, {"sensors": "adxrs453", "seed": 1}, ParameterError, "add a part with xy"),
    (draw_module, {"sensors": "mpu6000+mpu3050", "seed": 1}, ParameterError, "both have gyr axis"),
    (draw_module, {"sensors": "ahrs500ga+dcm260b", "seed": 1}, ParameterError, "both have acc axis"),
    (TriadErrors, {"white_rpsd": -0.1}, ParameterError, "not below 0"),
    (TriadErrors, {"bias": np.nan}, ParameterError, "finite"),
    (TriadErrors, {"lsb": np.inf}, ParameterError, "finite"),
    (TriadErrors, {"full_scale": -1.0}, ParameterError, "not below 0"),
    (TriadErrors, {"bias": (1.0, 2.0)}, ParameterError, "shape"),
    (TriadErrors, {"misalignment": 0.1}, ParameterError, "shape"),
    (TriadErrors, {"misalignment": np.eye(3)}, ParameterError, "zero diagonal"),
    (TriadErrors, {"rate": 0.0}, ParameterError, "positive"),
    (TriadErrors, {"high_pass": 0.0}, ParameterError, "high_pass must be positive and finite, but it is 0 Hz"),
    (angles, {"heading": -1.0}, ParameterError, "must be 0 rad or more"),
    (angles, {"tilt": math.inf}, ParameterError, "must be 0 rad or more"),
    (angles, {"time": 0.0}, ParameterError, "must be 0 rad or more"),
]


@pytest.mark.parametrize(("make", "given", "error", "match"), CASES)
def test_what_cannot_be_is_refused(make, given, error, match):
    with pytest.raises(error, match=match):
        make(**given)
