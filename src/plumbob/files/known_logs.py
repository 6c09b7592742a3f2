"""Logs and arrays that are known by their names: what their makers say of them and the files do not, as profiles."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Final

from plumbob.files.sniff import Sample


@dataclass(frozen=True, slots=True)
class KnownLog:
    """A kind of log."""

    name: str  # what writes it
    names: tuple[str, ...]  # columns that it has, each a regular expression of a whole name
    answers: Mapping[str, Any]  # keys of a profile
    facts: tuple[str, ...] = ()  # what the lines before the table have, as keys
    in_file: Mapping[str, str] = field(default_factory=dict)  # keys of a profile, and of the facts that answer them
    # whether a reader of its own reads it; then the answers are for a draft, where that one refuses it
    has_reader: bool = False

    def is_named_in(self, text: str) -> bool:
        """Whether a text has all the words of one; a table is taken apart only then."""
        words = (*self.names, *map(re.escape, self.facts))
        return all(re.search(word, text, re.IGNORECASE) for word in words)

    def fits(self, sample: Sample) -> bool:
        """Whether a file is one."""
        return all(key in sample.facts for key in self.facts) and all(
            any(re.fullmatch(pattern, name) for name in sample.names) for pattern in self.names
        )

    def said(self, sample: Sample) -> dict[str, Any]:
        """Its answers, with those that the lines before the table give."""
        facts = {key: sample.facts[fact] for key, fact in self.in_file.items() if fact in sample.facts}
        return {**self.answers, **{key: _value(key, fact) for key, fact in facts.items()}}


def _value(key: str, fact: str) -> str | float:
    if key == "axes":  # of the body, whose lower case turns the sign [Gyroflow]
        return " ".join(f"{'-' if letter.islower() else ''}{letter.lower()}" for letter in fact)
    return float(fact) if re.fullmatch(r"[-+.\deE]+", fact) else fact.split(maxsplit=1)[0]


KNOWN: Final = (
    KnownLog(
        "rostopic echo -p",
        (r"field\.header\.stamp", r"field\.angular_velocity\.x"),
        # REP-103 and REP-145: SI units, ENU, and linear_acceleration is what an accelerometer measures
        {"frame": "ENU", "time.unit": "ns", "gyr.unit": "rad/s", "acc.unit": "m/s2", "acc.sign": "specific-force",
         "reference.frame": "ENU"},
    ),
    KnownLog(
        "PX4's ulog2csv",
        (r"timestamp", r"gyro_rad\[0\]", r"accelerometer_m_s2\[0\]"),
        # sensor_combined.msg: rad/s and m/s2, forward, right, down; at rest z of the accelerometer is -g
        {"time.unit": "us", "gyr.unit": "rad/s", "acc.unit": "m/s2", "acc.sign": "specific-force", "frame": "NED"},
    ),
    KnownLog(
        "a Gyroflow log",
        ("t", "gx", "gy", "gz"),
        {"time.unit": "s", "gyr.unit": "rad/s", "acc.unit": "g", "mag.unit": "gauss"},
        ("gyroflow imu log", "tscale", "gscale"),
        {"time.unit_per_count": "tscale", "gyr.unit_per_count": "gscale", "acc.unit_per_count": "ascale",
         "mag.unit_per_count": "mscale", "axes": "orientation"},
    ),
    KnownLog(
        "MT Manager",
        ("PacketCounter", "Acc_X|Gyr_X"),
        {"gyr.unit": "rad/s", "acc.unit": "m/s2", "acc.sign": "specific-force", "mag.unit": "relative"},
        ("coordinate system", "deviceid"),
        {"frame": "coordinate system"},
        has_reader=True,
    ),
    KnownLog(
        "Movella DOT",
        ("SampleTimeFine", "PacketCounter", "Acc_X|FreeAcc_X|Quat_W|Euler_X"),
        {"time.unit": "us", "gyr.unit": "deg/s", "acc.unit": "m/s2", "acc.sign": "specific-force",
         "reference.frame": "ENU"},
        ("devicetag",),
    ),
    KnownLog(
        "Shimmer's Consensys",
        (r"Shimmer_\w+_Timestamp_\w+", r"Shimmer_\w+_(Accel_(LN|WR)|Gyro)_X_CAL"),
        # 9DoF Calibration user manual: +1 g where an axis points up; the field in units of the local one
        {"acc.sign": "specific-force", "mag.unit": "relative"},
    ),
    KnownLog(
        "MetaBase",
        (r"epoch? \(ms\)", r"elapsed \(s\)", r"x-axis \((g|deg/s|T)\)"),
        {"acc.sign": "specific-force"},  # as the BMI160 and BMI270 give it, +1 g where an axis points up
    ),
    KnownLog(
        "OpenLog Artemis",
        ("aX", "gX", "mX", "imu_degC"),
        # its firmware; DS-000189, Orientation of Axes: y and z of the magnetometer are turned against the others
        {"acc.unit": "mg", "gyr.unit": "deg/s", "mag.unit": "uT", "acc.sign": "specific-force", "mag.axes": "x -y -z"},
    ),
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class KnownArrays:
    """A data set of named arrays."""

    name: str  # what it is called
    names: frozenset[str]  # arrays by which it is known; the others must be there too when it is read
    profile: str  # its profile; ``{name}`` is the single number that the file has under that name


KNOWN_ARRAYS: Final = (
    KnownArrays(
        "BROAD [Laidig2021]",
        frozenset({"imu_gyr", "opt_quat"}),
        """
arrays = true
device = "Myon aktos-t"
frame = "ENU"
north = "magnetic"
notes = ["from the BROAD data set, doi:10.3390/data6070072, CC BY 4.0"]
time.rate = "{sampling_rate} Hz"
gyr = { columns = "imu_gyr", unit = "rad/s" }
acc = { columns = "imu_acc", unit = "m/s2", sign = "specific-force" }
mag = { columns = "imu_mag", unit = "uT" }
[reference]
columns = "opt_quat"
order = "wxyz"
frame = "ENU"
north = "magnetic"
score = "movement"
source = "BROAD optical reference (OptiTrack)"
""",
    ),
)
