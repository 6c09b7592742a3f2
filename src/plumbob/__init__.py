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
Session, Line
    What a live line is, from a TOML file; and the line: bytes in, samples and attitude out, live or replayed.
Filter
    A named estimator with parameters and a state: ``process(data)`` gives a track, ``update(sample)`` goes on by one.

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
Every sample carries a `flags` integer; `plumbob.flags` names the bits. A flag never removes a value.
"""

from typing import TYPE_CHECKING

from plumbob._lazy import lazily

if TYPE_CHECKING:
    from plumbob.calib.model import apply_card
    from plumbob.cards import CalibrationCard, NoiseCard
    from plumbob.data import AttitudeTrack, ImuData, ImuMeta
    from plumbob.errors import PlumbobError, PlumbobWarning
    from plumbob.evaluate import Evaluation
    from plumbob.filters import Filter, filter_names
    from plumbob.io import Recording, read, write
    from plumbob.io.draft import profile
    from plumbob.pipeline.line import Line
    from plumbob.pipeline.session import Session
    from plumbob.pipeline.session_toml import load_session
    from plumbob.rigs import find_format
    from plumbob.rotations import Frame, North
    from plumbob.sensors.decode import Decoder
    from plumbob.sensors.format import Format
    from plumbob.sim import simulate

__version__ = "0.1.0"

_HOME = {
    "AttitudeTrack": "data",
    "CalibrationCard": "cards",
    "Decoder": "sensors.decode",
    "Evaluation": "evaluate",
    "Filter": "filters",
    "Format": "sensors.format",
    "Frame": "rotations",
    "ImuData": "data",
    "ImuMeta": "data",
    "ImuSample": "sample",
    "Line": "pipeline.line",
    "NoiseCard": "cards",
    "North": "rotations",
    "PlumbobError": "errors",
    "PlumbobWarning": "errors",
    "Recording": "io",
    "Session": "pipeline.session",
    "apply_card": "calib.model",
    "filter_names": "filters",
    "find_format": "rigs",
    "load_session": "pipeline.session_toml",
    "profile": "io.draft",
    "read": "io",
    "simulate": "sim",
    "write": "io",
}

__all__ = [
    "AttitudeTrack",
    "CalibrationCard",
    "Decoder",
    "Evaluation",
    "Filter",
    "Format",
    "Frame",
    "ImuData",
    "ImuMeta",
    "ImuSample",
    "Line",
    "NoiseCard",
    "North",
    "PlumbobError",
    "PlumbobWarning",
    "Recording",
    "Session",
    "apply_card",
    "filter_names",
    "find_format",
    "load_session",
    "profile",
    "read",
    "simulate",
    "write",
]


__getattr__ = lazily(__name__, _HOME)[0]


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
