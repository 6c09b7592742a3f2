"""Plumbob: attitude from MEMS inertial sensors, from bytes to an error against a reference.

This page is the vocabulary. Every other docstring uses these words without explaining them again.

Types
-----
ImuData
    What the sensors said: ``t (N,)``, ``gyr (N, 3)``, ``acc (N, 3)``, ``mag (N, 3)``, ``temp_c (N,)``, ``flags (N,)``
    and an `ImuMeta`. A missing triad is None, a missing sample NaN.
AttitudeTrack
    An attitude over time: ``t (N,)``, ``q_nb (N, 4)``, its `Frame` and `North`; estimates and references alike.
CalibrationCard, NoiseCard
    What a calibration and a noise analysis leave behind, as JSON.
Format, Decoder
    What a device says on the wire, as data, and what makes numbers of its bytes: ``feed(bytes)`` gives frames.
Session, Stream
    What a live stream is, from a TOML file; and the stream: bytes in, samples and attitude out, live or replayed.
Filter
    A named causal estimator with parameters and a state: ``process(data)`` gives a track, ``update(sample)`` goes on
    by one sample.
FixedLag
    The smoother on a stream: the same ``update`` without a lag, ``take(data)`` with one.

Units
-----
SI and radians inside: rad/s, m/s², s, rad. Two declared exceptions: magnetic flux density in µT and temperature in °C.
Anything else carries its unit in its name (``rate_dps``, ``tilt_deg``) and exists only at the border.
Time is seconds since the start of the recording, kept to the nanosecond; a step is measured, never 1/rate.

Frames
------
n
    Navigation: local level, an explicit `Frame` (ENU, NED or NWU); there is no default.
b
    Body: right-handed axes fixed to the case.
s
    Sensor case, where it differs from the body.

``x_to_from``: ``q_nb`` takes body coordinates to navigation coordinates, ``v_n = quat_rotate(q_nb, v_b)``, and adjacent
letters cancel, ``q_ns = quat_multiply(q_nb, q_bs)``. Quaternions are Hamilton, scalar first (wxyz). Euler angles are
ZYX: yaw, pitch, roll. A heading counts from true North, magnetic North, or a free zero: `North` says which.

Signs
-----
``acc`` is specific force: at rest it points **up** and measures +g, whatever the navigation frame. A level body with z
up (forward-left-up) reads ``[0, 0, +9.81]``; with z down (forward-right-down) it reads ``[0, 0, −9.81]``.

Flags
-----
Every sample carries a `flags` integer; `plumbob.core.flags` names the bits. A flag never removes a value.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from plumbob.core import __version__, lazily

if TYPE_CHECKING:
    from plumbob import arm, noise, rotations, simulation
    from plumbob.arm import array
    from plumbob.arm.joints import joints
    from plumbob.core import errors, flags, units
    from plumbob.core.errors import PlumbobError, PlumbobWarning
    from plumbob.core.extensions import register
    from plumbob.core.resources import docs
    from plumbob.data import AttitudeTrack, ImuData, ImuMeta
    from plumbob.data.array import ImuArray
    from plumbob.data.calibrated import apply_card
    from plumbob.data.cards import CalibrationCard, NoiseCard, open_card
    from plumbob.data.chain import Chain, load_chain
    from plumbob.data.recording import Recording
    from plumbob.data.sample import ImuSample
    from plumbob.door.allan import allan
    from plumbob.door.calibrate import calibrate, calibrate_counts
    from plumbob.door.doctor import doctor
    from plumbob.door.estimate import earth_acceleration, estimate
    from plumbob.door.evaluate import compare, evaluate
    from plumbob.door.rates import filter_rates
    from plumbob.door.reading import read, read_array
    from plumbob.door.send import send
    from plumbob.evaluation.evaluation import Evaluation
    from plumbob.files import write
    from plumbob.files.mcap import repair, verify
    from plumbob.filters import Filter, filter_names
    from plumbob.filters.known import cite
    from plumbob.filters.smoother import FixedLag
    from plumbob.fleet.batch import BatchRun, batch
    from plumbob.fleet.experiments.tuning import tune
    from plumbob.fleet.waves import waves
    from plumbob.live.emulated import emulate
    from plumbob.live.listen import profile
    from plumbob.live.record import record
    from plumbob.live.recorded import convert
    from plumbob.live.replay import replay
    from plumbob.live.session import Session
    from plumbob.live.session_toml import json_schema, load_session
    from plumbob.live.stream import Stream
    from plumbob.papers.reproduce import reproduce
    from plumbob.protocols.decode import Decoder, decode
    from plumbob.protocols.format import Format
    from plumbob.protocols.format_toml import find_format
    from plumbob.reporting.info import info
    from plumbob.reporting.overview import plot, report
    from plumbob.rotations import Frame, North
    from plumbob.simulation import simulate, simulate_chain
    from plumbob.viewer.commands import control
    from plumbob.viewer.view import view

_HOME = {
    "AttitudeTrack": "data.imu", "Chain": "data.chain", "ImuArray": "data.array", "load_chain": "data.chain",
    "read_array": "door.reading", "BatchRun": "fleet.batch", "CalibrationCard": "data.cards",
    "Decoder": "protocols.decode", "Evaluation": "evaluation.evaluation", "Filter": "filters",
    "FixedLag": "filters.smoother", "Format": "protocols.format", "Frame": "rotations", "ImuData": "data.imu",
    "ImuMeta": "data.imu", "ImuSample": "data.sample", "Stream": "live.stream", "NoiseCard": "data.cards",
    "North": "rotations", "PlumbobError": "core.errors", "PlumbobWarning": "core.errors",
    "Recording": "data.recording", "Session": "live.session", "allan": "door.allan", "apply_card": "data.calibrated",
    "batch": "fleet.batch", "calibrate": "door.calibrate", "calibrate_counts": "door.calibrate",
    "cite": "filters.known", "compare": "door.evaluate", "control": "viewer.commands", "decode": "protocols.decode",
    "docs": "core.resources", "doctor": "door.doctor", "earth_acceleration": "door.estimate",
    "emulate": "live.emulated", "estimate": "door.estimate", "evaluate": "door.evaluate", "convert": "live.recorded",
    "filter_names": "filters", "filter_rates": "door.rates", "find_format": "protocols.format_toml",
    "info": "reporting.info", "joints": "arm.joints", "json_schema": "live.session_toml",
    "load_session": "live.session_toml",
    "open_card": "data.cards", "plot": "reporting.overview", "profile": "live.listen", "read": "door.reading",
    "record": "live.record", "register": "core.extensions", "repair": "files.mcap", "report": "reporting.overview",
    "reproduce": "papers.reproduce", "replay": "live.replay", "send": "door.send", "simulate": "simulation",
    "simulate_chain": "simulation", "tune": "fleet.experiments.tuning", "verify": "files.mcap", "view": "viewer.view",
    "waves": "fleet.waves", "write": "files",
}  # fmt: skip

__all__ = [
    "AttitudeTrack",
    "BatchRun",
    "CalibrationCard",
    "Chain",
    "Decoder",
    "Evaluation",
    "Filter",
    "FixedLag",
    "Format",
    "Frame",
    "ImuArray",
    "ImuData",
    "ImuMeta",
    "ImuSample",
    "NoiseCard",
    "North",
    "PlumbobError",
    "PlumbobWarning",
    "Recording",
    "Session",
    "Stream",
    "__version__",
    "allan",
    "apply_card",
    "arm",
    "array",
    "batch",
    "calibrate",
    "calibrate_counts",
    "cite",
    "compare",
    "control",
    "convert",
    "decode",
    "docs",
    "doctor",
    "earth_acceleration",
    "emulate",
    "errors",
    "estimate",
    "evaluate",
    "filter_names",
    "filter_rates",
    "find_format",
    "flags",
    "info",
    "joints",
    "json_schema",
    "load_chain",
    "load_session",
    "noise",
    "open_card",
    "plot",
    "profile",
    "read",
    "read_array",
    "record",
    "register",
    "repair",
    "replay",
    "report",
    "reproduce",
    "rotations",
    "send",
    "simulate",
    "simulate_chain",
    "simulation",
    "tune",
    "units",
    "verify",
    "view",
    "waves",
    "write",
]


_MODULES = {
    "arm": "arm", "array": "arm.array", "errors": "core.errors", "flags": "core.flags", "noise": "noise",
    "rotations": "rotations", "simulation": "simulation", "units": "core.units",
}  # fmt: skip
"""Modules that users take whole, by the names that they have here."""

_name = lazily(__name__, _HOME)[0]


def __getattr__(name: str) -> Any:
    return import_module(f"{__name__}.{_MODULES[name]}") if name in _MODULES else _name(name)


def __dir__() -> list[str]:
    return [*__all__]
