"""Which units, axes, signs and delays of a recording's sensors are consistent with physics, with odds."""

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from enum import StrEnum
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from plumbob.core.check import Floats
from plumbob.core.units import deg, to_deg, to_si
from plumbob.data import TRIADS, ImuData
from plumbob.data.imu import TITLES
from plumbob.quality.arrangement import ARRANGEMENTS, VectorFit, fit, means
from plumbob.quality.derotated import fit_force
from plumbob.quality.units import UNITS, rate_error, unit_odds
from plumbob.reporting.content import Table
from plumbob.reporting.report import Report, Reported
from plumbob.rotations import Frame, axes_letters, quat_chained, quat_rotate, signed_axes

if TYPE_CHECKING:
    from plumbob.files.profile import Profile

CERTAIN: Final = math.log(1000.0)
"""Logarithm of the odds above which an answer may be sure."""
_HINT: Final = math.log(10.0)
_EXPLAINED: Final = 0.2
"""Part of the change that the best arrangement must explain to be sure."""
_USUAL: Final = int(np.flatnonzero((np.eye(3) == ARRANGEMENTS).all(axis=(1, 2)))[0])
_MOST: Final = 0.8
"""Part of the change that is to be turning for an answer about the axes as declared, where others fit as well."""
_ENOUGH: Final = {"mag": 30.0, "acc": CERTAIN}
"""Logarithm of the odds that are enough where less is explained: those of an accelerometer allow for pushes already."""
_NOISE: Final = {"mag": -0.5, "acc": -math.inf}
_EXACT: Final = 1e-3
"""Standard deviation of a delay that is sure, s."""
_MATTERS: Final = float(deg(1.0))
"""Tilt or heading that a delay costs, rad, above which it is wrong."""
_AVERAGED: Final = 3.0
"""Time over which filters average gravity, and the field for longer, s [Laidig2023]: turns to and fro cancel."""
_FEWEST: Final = 100
_SLOWEST, _FASTEST = 0.003, 30.0  # usual rates of bodies that turn at all, rad/s
_GAIN: Final = math.log(1.03)
"""What the gain of a gyroscope may be off by, of parts as they leave the line (MPU-6000: ±3 %, PS-MPU-6000A, 6.1)."""
_VAGUE: Final = 0.3
_VAGUE_DELAY: Final = 0.05  # s
_LEAST_DIP: Final = 0.17
"""Part of the field along the vertical below which its sign says nothing."""


_ASSUMED: Final = (
    "Turning shows an axis, not its direction: all three axes of the accelerometer, or of the magnetometer, may be "
    "negated, and turn alike. It is assumed that acc is specific force, which points up at rest: lay the unit flat and "
    "look."
)


class Trust(StrEnum):
    """How far an answer can be trusted."""

    SURE = "sure"
    LIKELY = "likely"
    UNKNOWN = "unknown"


@dataclass(frozen=True)
class Convention:
    """One question about a convention, and its answer.

    Attributes
    ----------
    sensor : str
        ``gyr``, ``acc`` or ``mag``.
    question : str
        ``unit``, ``axes``, ``sign`` or ``delay``.
    answer : Trust
        How far it can be trusted.
    value : str
        The best hypothesis, in words.
    log_odds : float
        Natural logarithm of its odds against the next.
    wrong : bool
        Whether it contradicts what the recording is read as.
    why : str
        What it is known by, or what would tell.
    """

    sensor: str
    question: str
    answer: Trust
    value: str
    log_odds: float
    wrong: bool = False
    why: str = ""

    @property
    def odds(self) -> str:
        """Odds as powers of ten, and no more than a million to one: models are wrong more often than that."""
        if self.question == "delay":
            return ""
        power = self.log_odds / math.log(10.0)
        return "none" if power < 0.05 else f"10^{power:.1f} : 1" if power < 6.0 else "over 10^6 : 1"


@dataclass(frozen=True, repr=False)
class Diagnosis(Reported):
    """What the motion of a recording says about its conventions.

    Attributes
    ----------
    name : str
        Of the recording.
    findings : tuple of Convention
        Every question.
    lines : tuple of str
        Lines of the profile, as TOML.
    remarks : tuple of str
        What is assumed, and what cannot be known.
    values : mapping
        Numbers by sensor: ``scale``, ``delay_s``, ``axes`` and their odds.
    """

    name: str
    findings: tuple[Convention, ...]
    lines: tuple[str, ...]
    remarks: tuple[str, ...]
    values: Mapping[str, Any]

    @property
    def wrong(self) -> bool:
        """Whether something contradicts what the recording is read as."""
        return any(finding.wrong for finding in self.findings)

    def facts(self) -> Mapping[str, str]:
        """The recording, and what is wrong."""
        wrong = [f"{finding.sensor} {finding.question}" for finding in self.findings if finding.wrong]
        return {"recording": self.name, "wrong": ", ".join(wrong) or "nothing found"}

    def summary(self) -> dict[str, Any]:
        """All that is known, as JSON can hold it."""
        rows = [asdict(finding) for finding in self.findings]
        for row in rows:
            row |= {"answer": str(row["answer"]), "log10_odds": min(row.pop("log_odds") / math.log(10.0), 6.0)}
        return {"recording": self.name, "wrong": self.wrong, "findings": rows, "profile": list(self.lines),
                "remarks": list(self.remarks), "values": dict(self.values)}  # fmt: skip

    def report(self) -> Report:
        """Verdicts, lines of the profile, and remarks."""
        rows = [
            (
                f"{finding.sensor} {finding.question}",
                str(finding.answer),
                finding.odds,
                ("WRONG: " if finding.wrong else "") + finding.value + (f" ({finding.why})" if finding.why else ""),
            )
            for finding in self.findings
        ]
        profile = (
            [Table("Lines of the profile", ("",), [(line,) for line in self.lines], words=(0,))] if self.lines else []
        )
        return Report(
            title="Conventions",
            facts=tuple(self.facts().items()),
            tables=(Table("Answers", ("question", "answer", "odds", "found"), rows, words=(1, 3)), *profile),
            remarks=self.remarks,
        )


@dataclass
class _Sensor:
    """One vector sensor: its fit, and how far that can be trusted."""

    name: str
    found: VectorFit | None
    answer: Trust = Trust.UNKNOWN

    def __post_init__(self) -> None:
        fitted = self.found
        if fitted is None or fitted.torn:
            return
        explains = fitted.explained >= _EXPLAINED
        if fitted.agrees and explains and not fitted.contradicted and fitted.margin >= _HINT:
            self.answer = Trust.SURE if fitted.margin >= CERTAIN else Trust.LIKELY
        elif fitted.explained >= _NOISE[self.name] and fitted.margin >= _ENOUGH[self.name]:
            self.answer = Trust.LIKELY  # most of it is pushes, as in the pocket of who walks

    @property
    def axes(self) -> Floats:
        """Arrangement (3, 3) of the rates in its axes."""
        assert self.found is not None
        return np.asarray(ARRANGEMENTS[self.found.best])

    @property
    def known(self) -> bool:
        return self.answer is not Trust.UNKNOWN

    def declared_odds(self) -> tuple[float, ...]:
        """Logarithm of the odds of the declared axes against the best, by all and by either half; empty where open."""
        fitted = self.found
        if fitted is None or fitted.torn or fitted.explained < _MOST:
            return ()
        return tuple(float(log[_USUAL]) for log in (fitted.log_odds, *fitted.halves))

    @property
    def usual(self) -> bool:
        return bool((self.axes == np.eye(3)).all())

    @property
    def mirrored(self) -> bool:
        return bool(np.linalg.det(self.axes) < 0.0)


class Declared:
    """What the recording is read as."""

    def __init__(self, profile: "Profile | None") -> None:
        self.profile = profile

    def unit(self, name: str) -> str:
        """Unit that the values were taken for; that of SI where they were counts or no profile says it."""
        group = None if self.profile is None else self.profile.triads.get(name)
        if group is None or group.unit_per_count != 1.0 or group.unit == "relative":
            return UNITS[name][0]
        return group.unit

    def counts(self, name: str) -> float | None:
        """What one count was taken for, where the values are counts."""
        group = None if self.profile is None else self.profile.triads.get(name)
        return None if group is None or group.unit_per_count == 1.0 else group.unit_per_count

    def axes(self, name: str, turn: Floats) -> list[str]:
        """Lines of a triad whose vectors as read have to be turned."""
        group = None if self.profile is None else self.profile.triads.get(name)
        case_turn = None if self.profile is None else self.profile.turn
        case = np.eye(3) if case_turn is None else signed_axes(case_turn)
        declared = np.eye(3) if group is None else signed_axes(group.axes)
        total = case.T @ turn @ case @ declared
        lines = [f'axes = "{axes_letters(total)}"']
        return [*lines, "mirrored = true"] if np.linalg.det(total) < 0.0 else lines


class Examination:
    """All sensors of one recording, and what they say about each other."""

    def __init__(self, imu: ImuData, name: str, declared: Declared, hemisphere: str | None) -> None:
        self.name, self.declared, self.hemisphere = name, declared, hemisphere
        self.t, self.up = imu.t, (imu.meta.frame or Frame.ENU).up
        self.values = {triad: _finite(getattr(imu, triad)) for triad in imu.triads}
        self.findings: list[Convention] = []
        self.lines: dict[str, list[str]] = {}
        self.remarks: list[str] = []
        self.numbers: dict[str, Any] = {}
        self.sensors: dict[str, _Sensor] = {}

    def diagnosis(self) -> Diagnosis:
        """Ask every question."""
        self._fit()
        for name in TRIADS:
            if name not in self.values:
                self.remarks.append(f"The recording has no {TITLES[name]}.")
        if "gyr" in self.values:
            self._axes()
        for name in filter(self.values.__contains__, TRIADS):
            self._unit(name, *self._size(name))
        for sensor in self.sensors.values():
            self._delay(sensor)
        order = {name: i for i, name in enumerate(TRIADS)}
        findings = sorted(self.findings, key=lambda finding: order[finding.sensor])
        lines = [line for name in TRIADS if name in self.lines for line in (f"[{name}]", *self.lines[name])]
        return Diagnosis(self.name, tuple(findings), tuple(lines), tuple(self.remarks), self.numbers)

    def _fit(self) -> None:
        gyr = self.values.get("gyr")
        if gyr is None or len(self.t) < _FEWEST:
            return
        if "mag" in self.values:
            self.sensors["mag"] = _Sensor("mag", fit(self.t, gyr, self.values["mag"], offset=0.5))
        if "acc" in self.values:
            mag = self.sensors.get("mag")
            acc, trials = self.values["acc"], [gyr, gyr - _resting(self.t, gyr)]
            signs: tuple[float, ...] = (1.0, -1.0)
            if mag is not None and mag.answer is Trust.SURE and mag.found is not None:
                scales: tuple[float, ...] = (mag.found.scale,)
                scales += (1.0,) if abs(math.log(mag.found.scale)) > _GAIN else ()  # iron that turns along misleads it
                trials.append(gyr + mag.axes.T @ mag.found.bias / mag.found.scale)
                signs = (-1.0,) if mag.mirrored else (1.0,)
            else:
                scales = self._scales(gyr, acc)
            self.sensors["acc"] = _Sensor("acc", fit_force(self.t, trials, acc, scales, signs))

    def _scales(self, gyr: Floats, acc: Floats) -> tuple[float, ...]:
        """Scales that the rates may have: of units with which a body turns as bodies do, and one by regression."""
        usual = float(np.sqrt(np.nanmean(np.sum(gyr * gyr, axis=1)))) if np.isfinite(gyr).any() else 0.0
        declared = float(to_si(1.0, self.declared.unit("gyr")))
        units = [float(to_si(1.0, unit)) / declared for unit in UNITS["gyr"]]
        scales = [scale for scale in units if _SLOWEST < scale * usual < _FASTEST]
        rough = fit(self.t, gyr, acc, offset=0.1)
        if (
            rough is not None
            and rough.margin > CERTAIN
            and rough.agrees
            and all(abs(math.log(rough.scale / scale)) > 0.3 for scale in scales)
        ):
            scales.append(rough.scale)
        return tuple(scales) or (1.0,)

    def _axes(self) -> None:
        """Whose axes are wrong, by majority."""
        trusted = {name: sensor for name, sensor in self.sensors.items() if sensor.known}
        for name, sensor in self.sensors.items():
            if not sensor.known:
                self._unknown_axes(name, sensor)
        if not trusted:
            return
        answer = Trust.LIKELY if any(sensor.answer is Trust.LIKELY for sensor in trusted.values()) else Trust.SURE
        if len({sensor.mirrored for sensor in trusted.values()}) > 1:
            for name in trusted:
                why = "accelerometer and magnetometer contradict each other about the gyroscope's handedness"
                self._find(name, "axes", Trust.UNKNOWN, "contradiction", 0.0, why=why)
            return
        turns = {name: sensor.axes for name, sensor in trusted.items()}
        apart = len(trusted) == 2 and not (turns["acc"] == turns["mag"]).all()
        if apart and answer is Trust.LIKELY and not any(sensor.usual for sensor in trusted.values()):
            for name, sensor in trusted.items():
                why = "gyroscope, accelerometer and magnetometer all contradict each other, so no two can be believed"
                self._find(name, "axes", Trust.UNKNOWN, "contradiction", 0.0, why=why)
                sensor.answer = Trust.UNKNOWN
            return
        reference = np.eye(3)
        if len(trusted) == 2 and (turns["acc"] == turns["mag"]).all():
            reference = turns["acc"]
        elif any(sensor.mirrored for sensor in trusted.values()):
            reference = turns["acc"] if "acc" in turns else turns["mag"]
        log_odds = min(sensor.found.margin for sensor in trusted.values() if sensor.found is not None)
        self._gyr_axes(reference, trusted, answer, log_odds)
        for sensor in trusted.values():
            self._own_axes(sensor, sensor.axes @ reference.T, alone=len(trusted) == 1)
        self._sign(trusted, reference)

    def _gyr_axes(self, turn: Floats, trusted: Mapping[str, _Sensor], answer: Trust, log_odds: float) -> None:
        by = " and ".join(TITLES[name] for name in trusted)
        if (turn == np.eye(3)).all():
            self._find("gyr", "axes", answer, "right-handed, as declared", log_odds, why=f"by {by}")
            return
        both = len(trusted) == 2
        kind = "mirrored" if np.linalg.det(turn) < 0.0 else "turned"
        value = f"{kind}: axes = '{axes_letters(turn)}' in those of the {'others' if both else by}"
        why = "both others agree" if both else "its sign is wrong or an axis is; the handedness is that of the rates"
        self._find("gyr", "axes", answer, value, log_odds, wrong=True, why=why)
        self.lines.setdefault("gyr", []).extend(self.declared.axes("gyr", turn))

    def _own_axes(self, triad: _Sensor, turn: Floats, *, alone: bool) -> None:
        """Axes of one vector sensor in those of the case; `turn` takes the case's to its own."""
        assert triad.found is not None
        if triad.name == "acc" and not (turn == np.eye(3)).all() and self._upside_down(turn.T):
            turn = -turn
        self.numbers.setdefault(triad.name, {})["axes"] = axes_letters(turn.T)
        if (turn == np.eye(3)).all():
            self._find(triad.name, "axes", triad.answer, "as declared, but for a sign of all three", triad.found.margin)
            return
        value = f"axes = '{axes_letters(turn.T)}' in those of the gyroscope"
        why = ""
        if alone:
            other = axes_letters(turn)
            why = f"or the gyroscope's are '{other}': two sensors do not show which of them it is"
        self._find(triad.name, "axes", triad.answer, value, triad.found.margin, wrong=True, why=why)
        self.lines.setdefault(triad.name, []).extend(self.declared.axes(triad.name, turn.T))

    def _upside_down(self, turn: Floats) -> bool:
        """Whether the accelerometer, so turned, shows the body upside down on the whole: negated, it is upright."""
        mean = turn @ np.nanmean(self.values["acc"], axis=0)
        return bool(mean @ self.up < -0.5 * np.linalg.norm(mean))

    def _unknown_axes(self, name: str, sensor: _Sensor) -> None:
        odds = sensor.declared_odds()
        wrong = bool(odds) and odds[0] < -CERTAIN and max(odds) < -_HINT
        value = "not as declared, or the gyroscope's are not; which others" if wrong else ""
        value = f"{value} cannot be known from this motion".lstrip()
        self._find(name, "axes", Trust.UNKNOWN, value, 0.0, wrong=wrong, why=self._would_tell(sensor))

    def _would_tell(self, sensor: _Sensor) -> str:
        """Which motion would tell what this one does not."""
        advice = "turn it by hand about each of its axes in turn, by 90° to and fro, for half a minute"
        if sensor.found is None:
            return f"nothing turns; {advice}"
        tied = ARRANGEMENTS[sensor.found.log_odds > -CERTAIN]
        if sensor.found.explained < _EXPLAINED or len(tied) > 8:
            return advice
        open_ = [letter for j, letter in enumerate("xyz") if np.ptp(tied[:, :, j], axis=0).any()]
        return f"turn it about the gyroscope's {' and '.join(open_)}, too" if open_ else advice

    def _sign(self, trusted: Mapping[str, _Sensor], reference: Floats) -> None:
        """Sign of the field along the vertical; that of the specific force is assumed."""
        self.remarks.append(_ASSUMED)
        if len(trusted) < 2:
            return
        down = self._downward(trusted, reference)
        if down is None:
            self._find("mag", "sign", Trust.UNKNOWN, "the field is level, or changes", 0.0)
            return
        pointing = "down" if down > 0.0 else "up"
        if self.hemisphere is None:
            there = "north" if down > 0.0 else "south"
            value = f"right {there} of the magnetic equator, where the field points {pointing}"
            why = "elsewhere all its axes have to be negated; --hemisphere says where"
            self._find("mag", "sign", Trust.UNKNOWN, value, 0.0, why=why)
            return
        right = (down > 0.0) == (self.hemisphere == "north")
        certain = all(sensor.answer is Trust.SURE for sensor in trusted.values()) and abs(down) > 2.0 * _LEAST_DIP
        answer = Trust.SURE if certain else Trust.LIKELY
        value = f"the field points {pointing}" + (
            "" if right else f", {self.hemisphere} of the magnetic equator: negated"
        )
        log_odds = min(sensor.found.margin for sensor in trusted.values() if sensor.found is not None)
        why = "if acc is specific force" + ("" if right else "; if it shows gravity, write its sign instead")
        self._find("mag", "sign", answer, value, log_odds, wrong=not right, why=why)
        if not right:
            lines = [line for line in self.lines.get("mag", []) if not line.startswith(("axes", "mirrored"))]
            turn = (trusted["mag"].axes @ reference.T).T
            self.lines["mag"] = [*lines, *self.declared.axes("mag", -turn)]

    def _downward(self, trusted: Mapping[str, _Sensor], reference: Floats) -> float | None:
        """Part of the field that points down, by the mean of its product with the specific force; None near zero."""
        assert trusted["mag"].found is not None
        turned = {name: (sensor.axes @ reference.T).T for name, sensor in trusted.items()}
        force = self.values["acc"] @ turned["acc"].T
        field = (self.values["mag"] - trusted["mag"].found.offset) @ turned["mag"].T
        size = np.sqrt(np.sum(force**2, axis=1) * np.sum(field**2, axis=1))
        down = -np.sum(force * field, axis=1) / np.where(size > 0.0, size, np.nan)
        middle = float(np.nanmedian(down)) if np.isfinite(down).any() else 0.0
        return middle if abs(middle) > _LEAST_DIP else None

    def _size(self, name: str) -> tuple[float, float, Trust, str]:
        """Size by which the unit of a triad is known, the deviation of its logarithm, how sure, and by what."""
        if name == "gyr":
            return self._turning()
        vector, sensor = self.values[name], self.sensors.get(name)
        if name == "mag" and sensor is not None and sensor.answer is Trust.SURE and sensor.found is not None:
            vector = vector - sensor.found.offset
        norm = np.sqrt(np.sum(vector * vector, axis=1))
        norm = norm[np.isfinite(norm)]
        if norm.size < _FEWEST or not np.median(norm) > 0.0:
            return 0.0, 0.0, Trust.UNKNOWN, "nothing is measured"
        middle = float(np.median(norm))
        low, high = np.quantile(norm, (0.16, 0.84))
        sd = 0.5 * math.log(float(high) / max(float(low), 1e-3 * middle))
        by = "the size of gravity" if name == "acc" else "the size of the Earth's field"
        return middle, 0.3 * sd, Trust.SURE, by

    def _turning(self) -> tuple[float, float, Trust, str]:
        """By both vector sensors; where they differ, by half of the difference the answer is uncertain."""
        trusted = [sensor for sensor in self.sensors.values() if sensor.known] or [
            sensor for sensor in self.sensors.values() if max(sensor.declared_odds(), default=-math.inf) > -_HINT
        ]
        fits = {s.name: s.found for s in trusted if s.found is not None and s.found.scale_sd < _VAGUE * s.found.scale}
        if not fits:
            why = self._would_tell(next(iter(self.sensors.values()))) if self.sensors else "acc and mag do not turn"
            return 0.0, 0.0, Trust.UNKNOWN, why
        logs = np.log([fitted.scale for fitted in fits.values()])
        weights = np.array([(fitted.scale / fitted.scale_sd) ** 2 for fitted in fits.values()])
        scale, sd = float(np.exp(logs @ weights / weights.sum())), math.hypot(weights.sum() ** -0.5, 0.5 * np.ptp(logs))
        self.numbers.setdefault("gyr", {}).update(scale=scale, scale_sd=scale * sd, by=" and ".join(fits))
        for other in self._better_explained(fits):
            if abs(math.log(other.scale / scale)) > _GAIN + 3.0 * math.hypot(sd, other.scale_sd / other.scale):
                why = f"a sensor that turns with it says × {scale:.3g}, one that the rates explain better "
                return 0.0, 0.0, Trust.UNKNOWN, f"{why}× {other.scale:.3g}; {self._would_tell(trusted[0])}"
        by = " and ".join(TITLES[name] for name in fits) + (" say" if len(fits) > 1 else " says")
        by = f"it turns {1.0 / scale:.4g} times as fast as the {by}"
        if not trusted[0].known:
            return 1.0 / scale, sd, Trust.LIKELY, f"{by}, if the axes are as declared"
        sure = any(sensor.answer is Trust.SURE for sensor in trusted)
        return 1.0 / scale, sd, Trust.SURE if sure else Trust.LIKELY, by

    def _better_explained(self, fits: Mapping[str, VectorFit]) -> list[VectorFit]:
        """Fits of other sensors whose change the rates explain mostly, and more of it than of those in `fits`."""
        least = max(_MOST, *(fitted.explained for fitted in fits.values()))
        others = [sensor.found for name, sensor in self.sensors.items() if name not in fits]
        return [other for other in others if other is not None and other.explained > least]

    def _unit(self, name: str, size: float, sd: float, sure: Trust, by: str) -> None:
        declared = self.declared.unit(name)
        if sure is Trust.UNKNOWN:
            self._find(name, "unit", Trust.UNKNOWN, "cannot be known from this recording", 0.0, why=by)
            return
        odds = unit_odds(name, size, sd, declared)
        if name == "gyr" and abs(rest := rate_error(size, odds.unit or declared, declared)) > _GAIN + 3.0 * sd:
            self._factor(size, sd, sure, rest, by)
            return
        if odds.unit is None:
            self._find(
                name, "unit", Trust.UNKNOWN, f"no unit in use; multiply by {odds.factor:.4g}", 0.0, wrong=True, why=by
            )
            return
        answer = sure if odds.log_odds >= CERTAIN else Trust.LIKELY if odds.log_odds >= _HINT else Trust.UNKNOWN
        wrong = odds.unit != declared and (answer is not Trust.UNKNOWN or odds.declared_odds < -CERTAIN)
        value = f"unit = '{odds.unit}'" if answer is not Trust.UNKNOWN else f"'{odds.unit}' or '{odds.next}'"
        self.numbers.setdefault(name, {})["unit"] = odds.unit
        self._find(name, "unit", answer, value, odds.log_odds, wrong=wrong, why=by)
        if answer is Trust.UNKNOWN:
            return  # that it is wrong is certain, which of two is right is not
        counts = self.declared.counts(name)
        if wrong and counts is not None:
            self.lines.setdefault(name, []).append(f"unit_per_count = {counts * odds.factor:.6g}")
        elif wrong:
            self.lines.setdefault(name, []).append(f'unit = "{odds.unit}"')

    def _factor(self, size: float, sd: float, sure: Trust, rest: float, by: str) -> None:
        """Rates that are wrong by a factor that no unit explains: units are exact, and gains are not so far off."""
        what = (
            "the full scale, the sampling rate or the unit of time (time.unit; or a counter of samples taken for time)"
        )
        if sure is not Trust.SURE and any(sensor.known for sensor in self.sensors.values()):
            self._find("gyr", "unit", Trust.UNKNOWN, f"perhaps × {size:.3g} ± {size * sd:.2g}", 0.0, why=by)
            return
        value = f"no unit, but × {size:.3g} ± {size * sd:.2g}: {what} is wrong"
        self._find("gyr", "unit", sure, value, 0.5 * (rest / max(sd, _GAIN)) ** 2, wrong=True, why=by)

    def _delay(self, sensor: _Sensor) -> None:
        fitted = sensor.found
        sd = math.inf if fitted is None else math.hypot(fitted.delay_sd, fitted.in_step)
        if fitted is None or not sensor.known or not sd <= _VAGUE_DELAY:
            why = "turn it faster, to and fro"
            self._find(sensor.name, "delay", Trust.UNKNOWN, "cannot be known from this motion", 0.0, why=why)
            return
        apart = abs(fitted.delay_halves[0] - fitted.delay_halves[1])
        agree = apart <= max(2.0 * _EXACT, 6.0 * fitted.delay_sd)
        sure = sensor.answer is Trust.SURE and sd <= _EXACT and agree
        answer = Trust.SURE if sure else Trust.LIKELY if agree else Trust.UNKNOWN
        angle = abs(fitted.delay) * _steady_rate(self.t, self.values["gyr"] * fitted.scale)
        clear = abs(fitted.delay) > max(5.0 * fitted.delay_sd, _EXACT, fitted.in_step)
        wrong = sensor.answer is Trust.SURE and agree and clear and angle > _MATTERS
        side = "late" if fitted.delay > 0.0 else "early"
        value = f"stamps {1e3 * abs(fitted.delay):.1f} ± {1e3 * sd:.1f} ms {side} against the gyroscope's"
        odds = 0.5 * min((fitted.delay / sd) ** 2, 1e3) if answer is not Trust.UNKNOWN else 0.0
        self.numbers.setdefault(sensor.name, {}).update(delay_s=fitted.delay, delay_sd_s=sd)
        why = f"{to_deg(angle):.1g}° of attitude in this motion" if clear and agree and not wrong else ""
        self._find(sensor.name, "delay", answer, value, odds, wrong=wrong, why=why)
        if wrong:
            self.lines.setdefault(sensor.name, []).append(f'delay = "{1e3 * fitted.delay:.1f} ms"')

    def _find(
        self,
        sensor: str,
        question: str,
        answer: Trust,
        value: str,
        log_odds: float,
        *,
        wrong: bool = False,
        why: str = "",
    ) -> None:
        self.findings.append(Convention(sensor, question, answer, value, log_odds, wrong, why))


def _resting(t: Floats, gyr: Floats) -> Floats:
    """Rates (3,) of the quietest tenth of the recording's seconds, which are their bias if the body rests in them."""
    size = max(2, round(1.0 / float(np.median(np.diff(t)))))
    rows = np.nan_to_num(gyr[: len(gyr) // size * size]).reshape(-1, size, 3)
    if len(rows) < 2:
        return np.zeros(3)
    spread = np.sum(np.var(rows, axis=1), axis=1)
    quiet = np.argsort(spread)[: max(1, len(rows) // 10)]
    return np.asarray(np.median(rows[quiet].mean(axis=1), axis=0))


def _steady_rate(t: Floats, gyr: Floats) -> float:
    """Rate in space, averaged as a filter averages a vector: what a delay turns it by for good, rad/s rms."""
    rate = np.nan_to_num(gyr)
    q = quat_chained(0.5 * (rate[1:] + rate[:-1]) * np.diff(t)[:, np.newaxis])
    edges = np.arange(t[0], t[-1], min(_AVERAGED, 0.5 * float(t[-1] - t[0])))
    return float(np.sqrt(np.nanmean(np.sum(means(t, quat_rotate(q, rate), edges) ** 2, axis=1))))


def _finite(values: Floats) -> Floats:
    """Rows with a value on all axes; others are NaN, as are those too large to be squared."""
    with np.errstate(invalid="ignore"):
        finite = np.asarray((np.abs(values) < 1e12).all(axis=1))
    return np.where(finite[:, np.newaxis], values, np.nan)
