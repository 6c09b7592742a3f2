"""Which units, axes, signs and delays of a recording's sensors are consistent with physics, with odds."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from plumbob.core import check
from plumbob.core.check import Floats
from plumbob.core.constants import G0
from plumbob.core.findings import Finding, as_json, info
from plumbob.core.result import Reported
from plumbob.core.units import QUANTITY_BY_TRIAD, deg, to_deg, to_si
from plumbob.data import TRIADS, ImuData
from plumbob.data.imu import TRIAD_FLAGS, median, norms
from plumbob.data.plausibility import ALL_AXES, LONGEST_STEP, NOT_KNOWN, statistics, stuck_runs
from plumbob.data.recording import findings as sample_findings
from plumbob.quality.arrangement import ARRANGEMENTS, CERTAIN, FLOOR, Samples, VectorFit, fit
from plumbob.quality.derotated import fit_force
from plumbob.rotations import Frame, axes_letters, quat_chained, quat_rotate, signed_axes

if TYPE_CHECKING:
    from plumbob.files.profile import Profile


UNITS: Final = {
    "gyr": ("rad/s", "deg/s", "rpm", "mrad/s", "mdeg/s"),
    "acc": ("m/s2", "g", "mg", "cm/s2"),
    "mag": ("uT", "nT", "mgauss", "gauss", "mT", "T"),
}
"""Units in use, by triad; that of SI as it is used inside comes first."""
_USUAL_SIZE: Final = {"gyr": 1.0, "acc": G0, "mag": 40.0}  # [Alken2021]: the Earth's field has 22 to 67 µT
_SPREAD: Final = {"gyr": 0.2, "acc": 0.06, "mag": 0.35}
"""Standard deviation of the logarithm of the size in the right unit: gain and bias of gravity (MPU-6000: ±3 %, ±50 mg,
PS-MPU-6000A, 6.2), pushes, places on the Earth."""
_NONE_FITS: Final = 3.5


@dataclass(frozen=True)
class UnitOdds:
    """The unit that fits best."""

    unit: str | None  # its name; None where no unit in use fits
    factor: float  # what the values as declared have to be multiplied by
    log_odds: float  # against the next unit
    next: str
    declared_odds: float  # of the declared unit, against the best


def unit_odds(name: str, size: float, sd: float, declared: str) -> UnitOdds:
    """Odds of the units of a triad whose values were taken for the unit `declared`.

    `size` is, with that unit, gravity, m/s², the field, µT, or the turning that the rates say over that which the other
    sensors show; `sd` is the standard deviation of its logarithm.
    """
    kind = QUANTITY_BY_TRIAD[name]
    scale = float(to_si(1.0, declared, kind))
    spread = math.hypot(_SPREAD[name], sd)
    candidates = tuple(dict.fromkeys((declared, *UNITS[name])))
    away = {
        unit: abs(math.log(size * float(to_si(1.0, unit, kind)) / scale / _USUAL_SIZE[name]) / spread)
        for unit in candidates
    }
    best, second, *_ = sorted(away, key=away.__getitem__)
    odds = 0.5 * (away[second] ** 2 - away[best] ** 2)
    against = 0.5 * (away[best] ** 2 - away[declared] ** 2)
    if away[best] > _NONE_FITS:
        return UnitOdds(None, _USUAL_SIZE[name] / size, 0.0, best, against)
    return UnitOdds(best, float(to_si(1.0, best, kind)) / scale, odds, second, against)


_HINT: Final = math.log(10.0)
_EXPLAINED: Final = 0.2  # Part of the change that the best arrangement must explain to be sure
_USUAL: Final = int(np.flatnonzero((np.eye(3) == ARRANGEMENTS).all(axis=(1, 2)))[0])
_MOST: Final = 0.8  # part of the change that is turning where declared axes are answered for and others fit as well
_ENOUGH: Final = {"mag": 30.0, "acc": CERTAIN}
"""Logarithm of the odds that are enough where less is explained: those of an accelerometer allow for pushes already."""
_NOISE: Final = {"mag": -0.5, "acc": -math.inf}
_EXACT: Final = 1e-3  # Standard deviation of a delay that is sure, s
_MATTERS: Final = float(deg(1.0))  # Tilt or heading that a delay costs, rad, above which it is wrong
_AVERAGED: Final = 3.0
"""Time over which filters average gravity, and the field for longer, s [Laidig2023]: turns to and fro cancel."""
_FEWEST: Final = 100
_SHORT_STEP, _USUAL_STEP = 2e-3, 1e-2  # s; loggers do not write faster than the first, most of them at the second
_SLOWEST, _FASTEST = 0.003, 30.0  # usual rates of bodies that turn at all, rad/s
_GAIN: Final = math.log(1.03)  # of gyroscopes as they leave the line (MPU-6000: ±3 %, PS-MPU-6000A, 6.1)
_VAGUE, _VAGUE_DELAY = 0.3, 0.05  # of a scale, and of a delay, s
_PUSHED: Final = 0.25
"""Part of the usual specific force by which half of the samples differ from it where pushes rule, as of a runner's arm:
pushes in step with the turning imitate gravity in other axes, so that these take sure odds, and are likely at best."""
_LEAST_DIP: Final = 0.17  # Part of the field along the vertical below which its sign says nothing
EXAMINED: Final = 300.0  # Of a longer recording the time of so many seconds in which it turns most is examined
_SHORTEST_RUN: Final = 5  # Repeats in fewer samples cost an examination nothing


class Trust(StrEnum):
    """How far an answer can be trusted."""

    SURE = "sure"
    LIKELY = "likely"
    UNKNOWN = "unknown"


@dataclass(frozen=True)
class Convention:
    """One question about a convention, and its answer."""

    sensor: str  # ``gyr``, ``acc`` or ``mag``
    question: str  # ``unit``, ``axes``, ``sign`` or ``delay``
    answer: Trust  # how far it can be trusted
    finding: Finding  # the best hypothesis
    log_odds: float = 0.0  # natural logarithm of its odds against the next
    wrong: bool = False  # whether it contradicts what the recording is read as
    reasons: tuple[Finding, ...] = ()  # what it is known by, or what would tell

    @property
    def value(self) -> str:
        """The best hypothesis, in words."""
        return str(self.finding)

    @property
    def why(self) -> str:
        """The reasons, in words."""
        return "; ".join(map(str, self.reasons))

    @property
    def odds(self) -> str:
        """Odds as powers of ten, and no more than a million to one: models are wrong more often than that."""
        if self.question == "delay":
            return ""
        power = self.log_odds / math.log(10.0)
        return "none" if power < 0.05 else f"10^{power:.1f} : 1" if power < 6.0 else "over 10^6 : 1"


@dataclass(frozen=True, repr=False)
class Diagnosis(Reported):
    """What the motion of a recording says about its conventions."""

    name: str
    findings: tuple[Convention, ...]  # every question
    lines: tuple[str, ...]  # of the profile, as TOML
    remarks: tuple[Finding, ...]  # what is assumed, what cannot be known, and which samples say nothing
    values: Mapping[str, Any]  # numbers by sensor: ``scale``, ``delay_s``, ``axes`` and their odds

    @property
    def wrong(self) -> bool:
        """Whether something contradicts what the recording is read as, or an axis is dead."""
        return bool(self._faults())

    def _faults(self) -> list[str]:
        """Questions whose answers are wrong, and axes that never change while the others do."""
        dead = [f"{it.values['sensor']} {it.values['axis']}" for it in self.remarks if it.code == "samples.stuck_axis"]
        return [f"{it.sensor} {it.question}" for it in self.findings if it.wrong] + dead

    def facts(self) -> Mapping[str, str]:
        """The recording, and what is wrong."""
        return {"recording": self.name, "wrong": ", ".join(self._faults()) or "nothing found"}

    def summary(self) -> dict[str, Any]:
        """All that is known, as JSON can hold it."""
        rows = [
            {
                "sensor": it.sensor, "question": it.question, "answer": str(it.answer), "code": it.finding.code,
                "value": it.value, "log10_odds": min(it.log_odds / math.log(10.0), 6.0), "wrong": it.wrong,
                "why": it.why, "values": it.finding.to_dict()["values"],
            }
            for it in self.findings
        ]  # fmt: skip
        return {"recording": self.name, "wrong": self.wrong, "findings": rows, "profile": list(self.lines),
                "remarks": as_json(self.remarks), "values": dict(self.values)}  # fmt: skip


@dataclass(eq=False)
class _Sensor:
    """One vector sensor: its fit, and how far that can be trusted."""

    name: str
    found: VectorFit | None
    answer: Trust = Trust.UNKNOWN
    axes: Floats = field(init=False)  # arrangement (3, 3) of the rates in its axes
    margin: float = field(init=False)  # logarithm of the odds of these axes against the next
    usual: bool = field(init=False)
    mirrored: bool = field(init=False)
    has_scale: bool = field(init=False)  # it turns by the rates at a scale, and not by what bias and offset explain
    # logarithm of the odds of the declared axes against the best, by all and by either half; empty where open
    declared_odds: tuple[float, ...] = ()
    fits_declared: bool = field(init=False)  # it turns as the rates do in the declared axes; others may fit as well
    would_tell: Finding = field(init=False)  # which motion would tell what this one does not

    def __post_init__(self) -> None:
        fitted = self.found
        best, self.margin = (_USUAL, 0.0) if fitted is None else (fitted.best, fitted.margin)
        self.axes = np.asarray(ARRANGEMENTS[best])
        self.usual, self.mirrored = bool((self.axes == np.eye(3)).all()), bool(np.linalg.det(self.axes) < 0.0)
        self.has_scale = fitted is not None and fitted.scale_sd < _VAGUE * fitted.scale
        turns: list[str] = []
        if fitted is not None:
            explains = fitted.explained >= _EXPLAINED
            pushed = fitted.explained >= _NOISE[self.name] and self.margin >= _ENOUGH[self.name]
            if fitted.agrees and explains and not fitted.contradicted and self.margin >= _HINT:
                self.answer = Trust.SURE if self.margin >= CERTAIN else Trust.LIKELY
            elif pushed and not fitted.torn:
                self.answer = Trust.LIKELY  # most of it is pushes, as in the pocket of who walks
            if not fitted.torn and fitted.explained >= _MOST and self.has_scale:
                self.declared_odds = tuple(float(log[_USUAL]) for log in (fitted.log_odds, *fitted.halves))
            tied = ARRANGEMENTS[fitted.log_odds > -CERTAIN]
            if explains and len(tied) <= 8:
                turns = [axis for j, axis in enumerate("xyz") if np.ptp(tied[:, :, j], axis=0).any()]
        self.fits_declared = max(self.declared_odds, default=-math.inf) > -_HINT
        self.would_tell = info("doctor.turn_about", axes=tuple(turns)) if turns else info("doctor.turn_by_hand")
        if fitted is None:
            self.would_tell = info("doctor.nothing_turns")

    @property
    def known(self) -> bool:
        return self.answer is not Trust.UNKNOWN


@dataclass(frozen=True)
class Declared:
    """What the recording is read as."""

    profile: "Profile | None"

    def unit(self, name: str) -> tuple[str, float | None]:
        """Unit that the values were taken for, that of SI where no profile says it; of counts what one was taken for.

        Values relative to something are taken for those of SI.
        """
        group = None if self.profile is None else self.profile.triads.get(name)
        if group is None or group.unit_per_count != 1.0 or group.unit == "relative":
            return UNITS[name][0], None if group is None or group.unit_per_count == 1.0 else group.unit_per_count
        return group.unit, None

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
        whole = imu
        if "gyr" in imu.triads and imu.t[-1] - imu.t[0] > EXAMINED:  # the part in which the unit turns most
            parts = imu.chunks(max(_FEWEST, round(EXAMINED / median(np.diff(imu.t)))))
            imu = max(parts, key=lambda it: float(np.nansum(np.minimum(norms(np.asarray(it.gyr)), _FASTEST) ** 2)))
        self.imu, self.name, self.declared, self.hemisphere = imu, name, declared, hemisphere
        step = np.diff(imu.t, prepend=imu.t[:1])  # nothing spans a pause, so a long one is as good as a short one
        self.t, self.up = np.cumsum(np.minimum(step, LONGEST_STEP + 1.0)), (imu.meta.frame or Frame.ENU).up
        self.values: dict[str, Floats] = {}
        for triad in imu.triads:  # rows that can be squared and are not clipped, unless most are, as in another unit
            values, clipped = getattr(imu, triad), imu.flags & np.uint32(TRIAD_FLAGS[triad][1]) != 0
            with np.errstate(invalid="ignore"):
                usable = (np.abs(values) < 1e12).all(axis=1) & ~(clipped & (np.mean(clipped) < 0.5))
            self.values[triad] = np.where(usable[:, np.newaxis], values, np.nan)
        self.answers: dict[tuple[str, str], Convention] = {}
        self.lines: dict[tuple[str, str], list[str]] = {}
        self.remarks = [info("doctor.examined", start=float(imu.t[0]), stop=float(imu.t[-1]))] * (len(imu) < len(whole))
        self.numbers: dict[str, Any] = {}
        self.sensors: dict[str, _Sensor] = {}

    def diagnosis(self) -> Diagnosis:
        """Ask every question; and where something looks wrong, ask again without the samples that say nothing."""
        self.remarks += (stuck := [it for it in sample_findings(self.imu) if it.code.startswith("samples.stuck")])
        self._ask()
        parts = [sensor.found.explained for sensor in self.sensors.values() if sensor.known and sensor.found]
        if any(answer.wrong for answer in self.answers.values()) and min(parts, default=0.0) < 1.0 - FLOOR:
            self._without_unusable(stuck)
        if self.t.size >= _FEWEST and (step := float(np.median(np.diff(self.imu.t)))) < _SHORT_STEP:
            self._slower(_USUAL_STEP / step)
        if self.lines.get(("mag", "sign")):
            self.lines.pop(("mag", "axes"), None)  # those of the sign say both
        findings = [answer for name in TRIADS for answer in self.answers.values() if answer.sensor == name]
        by_triad = {name: [line for at, of in self.lines.items() if at[0] == name for line in of] for name in TRIADS}
        lines = [line for name, of in by_triad.items() if of for line in (f"[{name}]", *of)]
        return Diagnosis(self.name, tuple(findings), tuple(lines), tuple(self.remarks), self.numbers)

    def _ask(self) -> None:
        self._fit()
        self.remarks += [info("doctor.no_sensor", sensor=name) for name in TRIADS if name not in self.values]
        if "gyr" in self.values:
            self._axes()
        for name in filter(self.values.__contains__, TRIADS):
            self._unit(name, *self._size(name))
        for sensor in self.sensors.values():
            self._delay(sensor)

    def _slower(self, times: float) -> None:
        """Ask for the unit of the rates as if rows came at the usual step of a logger, instead of a counter of them.

        Windows are as long as bodies need to turn; where rows were counted for time, none is.
        """
        unit = self.answers.get(("gyr", "unit"))
        if unit is None or (unit.answer is Trust.SURE and not unit.wrong):
            return
        again = Examination(self.imu, self.name, self.declared, self.hemisphere)
        again.t = again.t * times
        again.values["gyr"] = again.values["gyr"] / times
        again._ask()
        if again.answers["gyr", "unit"].wrong:
            self.answers |= {at: answer for at, answer in again.answers.items() if at[1] != "delay"}
            self.lines, self.numbers = again.lines, again.numbers

    def _without_unusable(self, stuck: list[Finding]) -> None:
        """Held and clipped samples, and dead axes, imitate other conventions: what rests on them is open.

        What the usable samples answer is believed; what they leave open stands only where it is not called wrong.
        """
        masks = {name: mask for name in self.imu.triads if (mask := unusable(self.imu, name)).any()}
        if all(sensor.fits_declared for sensor in self._trusted()):  # no axis is dead: nothing turns about it
            masks = {name: mask for name, mask in masks.items() if not mask.all()}
        if not masks:
            return
        usable: dict[str, Any] = {
            name: np.where(mask[:, np.newaxis], np.nan, getattr(self.imu, name)) for name, mask in masks.items()
        }
        again = Examination(self.imu.corrected(meta=self.imu.meta, **usable), self.name, self.declared, self.hemisphere)
        again._ask()
        faults = [
            info("doctor.unusable", sensor=name, percent=100.0 * float(np.mean(mask)))
            for name, mask in masks.items()
            if name not in {fault.values["sensor"] for fault in stuck}
        ]
        for at, answer in self.answers.items():
            other = again.answers.get(at)
            taken_back = answer.wrong and answer.finding.code != "doctor.unit"  # no held sample imitates another unit
            if other is not None and (taken_back or other.answer is not Trust.UNKNOWN):
                mended = answer.wrong and not other.wrong
                self.answers[at] = replace(other, reasons=(*other.reasons, *stuck, *faults)) if mended else other
                self.lines[at] = again.lines.get(at, [])
        self.sensors, self.numbers = again.sensors, self.numbers | again.numbers
        self.remarks += faults

    def _fit(self) -> None:
        gyr = self.values.get("gyr")
        if gyr is None or len(self.t) < _FEWEST or float(np.median(np.diff(self.t))) > LONGEST_STEP:
            return
        if "mag" in self.values:
            self.sensors["mag"] = _Sensor("mag", fit(self.t, gyr, self.values["mag"], offset=0.5))
        if "acc" in self.values:
            mag = self.sensors.get("mag")
            acc, rest = self.values["acc"], np.zeros(3)
            # rates of the quietest tenth of the recording's seconds, which are their bias if the body rests in them
            second = max(2, round(1.0 / float(np.median(np.diff(self.t)))))
            rows = np.nan_to_num(gyr[: len(gyr) // second * second]).reshape(-1, second, 3)
            if len(rows) > 1:
                quiet = np.argsort(np.sum(np.var(rows, axis=1), axis=1))[: max(1, len(rows) // 10)]
                rest = np.median(rows[quiet].mean(axis=1), axis=0)
            trials = [gyr, gyr - rest]
            signs: tuple[float, ...] = (1.0, -1.0)
            if mag is not None and mag.answer is Trust.SURE and mag.found is not None:
                scales: tuple[float, ...] = (mag.found.scale,)
                scales += (1.0,) if abs(math.log(mag.found.scale)) > _GAIN else ()  # iron that turns along misleads it
                trials.append(gyr + mag.axes.T @ mag.found.bias / mag.found.scale)
                signs = (-1.0,) if mag.mirrored else (1.0,)
            else:
                scales = self._scales(gyr, acc)
            self.sensors["acc"] = force = _Sensor("acc", fit_force(self.t, trials, acc, scales, signs))
            size = norms(acc)
            if force.known and np.nanmedian(np.abs(size - np.nanmedian(size))) > _PUSHED * np.nanmedian(size):
                force.answer = Trust.LIKELY
        sure = {name for name, sensor in self.sensors.items() if sensor.usual and sensor.answer is Trust.SURE}
        for name, sensor in self.sensors.items():  # axes are as declared unless a thousand to one is against them,
            least = 2.0 * CERTAIN if sure - {name} else CERTAIN  # and a million where another sensor's surely are
            clear = sensor.margin >= least and (sensor.answer is Trust.SURE or sensor.has_scale)
            if sensor.known and not sensor.usual and not clear:
                sensor.answer = Trust.UNKNOWN
            if max(sensor.declared_odds[:1], default=0.0) > -least:
                sensor.declared_odds = ()

    def _scales(self, gyr: Floats, acc: Floats) -> tuple[float, ...]:
        """Scales that the rates may have: of units with which a body turns as bodies do, and one by regression."""
        usual = float(np.sqrt(np.nanmean(np.sum(gyr * gyr, axis=1)))) if np.isfinite(gyr).any() else 0.0
        declared = float(to_si(1.0, self.declared.unit("gyr")[0]))
        units = [float(to_si(1.0, unit)) / declared for unit in UNITS["gyr"]]
        scales = [scale for scale in units if _SLOWEST < scale * usual < _FASTEST]
        rough = fit(self.t, gyr, acc, offset=0.1)
        if rough is not None and rough.scale > 0.0:
            apart = min([abs(math.log(rough.scale / scale)) for scale in scales], default=math.inf)
            fits_declared = rough.explained >= _MOST and float(rough.log_odds[_USUAL]) > -_HINT
            if (apart > _GAIN and fits_declared) or (apart > 0.3 and rough.margin > CERTAIN and rough.agrees):
                scales.append(rough.scale)
        return tuple(scales) or (1.0,)

    def _axes(self) -> None:
        """Whose axes are wrong, by majority."""
        trusted = {name: sensor for name, sensor in self.sensors.items() if sensor.known}
        for name, sensor in self.sensors.items():
            if not sensor.known:
                odds = sensor.declared_odds
                wrong = bool(odds) and max(odds) < -_HINT
                finding = info("doctor.axes_wrong") if wrong else info("doctor.axes_open")
                self._find(name, "axes", Trust.UNKNOWN, finding, 0.0, sensor.would_tell, lines=[] if wrong else None)
        if not trusted:
            return
        answer = Trust.LIKELY if any(sensor.answer is Trust.LIKELY for sensor in trusted.values()) else Trust.SURE
        turns = [sensor.axes for sensor in trusted.values()]
        log_odds = min(sensor.margin for sensor in trusted.values())
        if len({sensor.mirrored for sensor in trusted.values()}) > 1:
            for name in trusted:
                self._find(name, "axes", Trust.UNKNOWN, info("doctor.contradiction_of_two"))
            return
        mirrored, alike = bool(np.linalg.det(turns[-1]) < 0.0), bool((turns[0] == turns[-1]).all())
        reference = turns[-1] if mirrored or (alike and len(turns) == 2) else np.eye(3)
        if (reference == np.eye(3)).all():
            self._find("gyr", "axes", answer, info("doctor.gyr_axes_right", by=tuple(trusted)), log_odds)
        else:
            code = "doctor.gyr_mirrored" if np.linalg.det(reference) < 0.0 else "doctor.gyr_turned"
            finding = info(code, axes=axes_letters(reference), by=tuple(trusted))
            why = info("doctor.both_agree") if len(trusted) == 2 else info("doctor.handedness")
            self._find("gyr", "axes", answer, finding, log_odds, why, lines=self.declared.axes("gyr", reference))
        for sensor in trusted.values():
            self._own_axes(sensor, sensor.axes @ reference.T, alone=len(trusted) == 1)
        self._sign(trusted, reference)

    def _own_axes(self, triad: _Sensor, turn: Floats, *, alone: bool) -> None:
        """Axes of one vector sensor in those of the case; `turn` takes the case's to its own."""
        if triad.name == "acc" and not (turn == np.eye(3)).all():
            mean = turn.T @ np.nanmean(self.values["acc"], axis=0)
            if mean @ self.up < -0.5 * np.linalg.norm(mean):  # so turned, the body is upside down on the whole
                turn = -turn
        self.numbers.setdefault(triad.name, {})["axes"] = axes_letters(turn.T)
        if (turn == np.eye(3)).all():
            self._find(triad.name, "axes", triad.answer, info("doctor.axes_right"), triad.margin)
            return
        why = [info("doctor.or_gyr_axes", axes=axes_letters(turn))] if alone else []
        self._find(triad.name, "axes", triad.answer, info("doctor.axes", axes=axes_letters(turn.T)), triad.margin,
                   *why, lines=self.declared.axes(triad.name, turn.T))  # fmt: skip

    def _sign(self, trusted: Mapping[str, _Sensor], reference: Floats) -> None:
        """Sign of the field along the vertical; that of the specific force is assumed."""
        self.remarks.append(info("doctor.assumed"))
        if len(trusted) < 2:
            return
        down = self._downward(trusted, reference)
        if down is None:
            self._find("mag", "sign", Trust.UNKNOWN, info("doctor.sign_open"))
            return
        if self.hemisphere is None:
            finding = info("doctor.sign_north") if down > 0.0 else info("doctor.sign_south")
            self._find("mag", "sign", Trust.UNKNOWN, finding, 0.0, info("doctor.say_hemisphere"))
            return
        right = (down > 0.0) == (self.hemisphere == "north")
        certain = all(sensor.answer is Trust.SURE for sensor in trusted.values()) and abs(down) > 2.0 * _LEAST_DIP
        finding = info("doctor.sign_right") if right else info("doctor.sign_negated")
        log_odds = min(sensor.margin for sensor in trusted.values())
        lines = None if right else self.declared.axes("mag", -(trusted["mag"].axes @ reference.T).T)
        why = info("doctor.if_force") if right else info("doctor.if_gravity")
        self._find("mag", "sign", Trust.SURE if certain else Trust.LIKELY, finding, log_odds, why, lines=lines)

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

    def _size(self, name: str) -> tuple[float, float, Trust, tuple[Finding, ...]]:
        """Size by which the unit of a triad is known, the deviation of its logarithm, how sure, and by what."""
        if name == "gyr":
            return self._turning()
        vector, sensor = self.values[name], self.sensors.get(name)
        if name == "mag" and sensor is not None and sensor.answer is Trust.SURE and sensor.found is not None:
            vector = vector - sensor.found.offset
        norm = np.sqrt(np.sum(vector * vector, axis=1))
        norm = norm[np.isfinite(norm)]
        if norm.size < _FEWEST or not np.median(norm) > 0.0:
            return 0.0, 0.0, Trust.UNKNOWN, (info("doctor.nothing_measured"),)
        middle = float(np.median(norm))
        low, high = np.quantile(norm, (0.16, 0.84))
        sd = 0.5 * math.log(float(high) / max(float(low), 1e-3 * middle))
        by = info("doctor.by_gravity") if name == "acc" else info("doctor.by_field")
        return middle, 0.3 * sd, Trust.SURE, (by,)

    def _turning(self) -> tuple[float, float, Trust, tuple[Finding, ...]]:
        """By both vector sensors; where they differ, by half of the difference the answer is uncertain."""
        trusted = self._trusted()
        fits = {s.name: s.found for s in trusted if s.found is not None and s.has_scale}
        if not fits:
            why = next((it.would_tell for it in self.sensors.values()), info("doctor.nothing_turns"))
            return 0.0, 0.0, Trust.UNKNOWN, (why,)
        if len(fits) == 2 and min(fitted.explained for fitted in fits.values()) < _MOST:
            best = max(fits, key=lambda name: fits[name].explained)  # a straight line through noise is too flat
            fits = {best: fits[best]} if fits[best].explained >= _MOST else fits
        logs = np.log([fitted.scale for fitted in fits.values()])
        weights = np.array([(fitted.scale / fitted.scale_sd) ** 2 for fitted in fits.values()])
        weights /= (total := weights.sum())
        scale, sd = float(np.exp(logs @ weights)), math.hypot(total**-0.5, 0.5 * np.ptp(logs))
        in_step = 0.0  # what a field feigns whose direction changes in step with the turning, as much as its size does
        if "mag" in fits:
            vector = self.values["mag"] - fits["mag"].offset
            low, middle, high = np.nanquantile(size := norms(vector), (0.16, 0.5, 0.84))
            swing = math.sqrt(1.0 - float(np.sum(np.nanmean(vector / size[:, np.newaxis], axis=0) ** 2)))
            in_step = weights[list(fits).index("mag")] * 0.5 * float(high - low) / (float(middle) * swing)
        stated = scale * math.hypot(sd, in_step)
        self.numbers.setdefault("gyr", {}).update(scale=scale, scale_sd=stated, by=" and ".join(fits))
        least = max(_MOST, *(fitted.explained for fitted in fits.values()))
        others = (sensor.found for name, sensor in self.sensors.items() if name not in fits)
        for other in (it for it in others if it is not None and it.explained > least):
            if abs(math.log(other.scale / scale)) > _GAIN + 3.0 * math.hypot(sd, other.scale_sd / other.scale):
                why = info("doctor.turns_along", scale=scale, other=other.scale)
                return 0.0, 0.0, Trust.UNKNOWN, (why, trusted[0].would_tell)
        sure = any(sensor.answer is Trust.SURE for sensor in trusted)
        assumed = "" if trusted[0].known else "yes"
        by = info("doctor.by_turning", times=1.0 / scale, by=tuple(fits), assumed=assumed)
        return 1.0 / scale, sd, Trust.SURE if sure and not assumed else Trust.LIKELY, (by,)

    def _trusted(self) -> list[_Sensor]:
        """Sensors whose axes are known, or else those that turn as declared."""
        sensors = self.sensors.values()
        return [it for it in sensors if it.known] or [it for it in sensors if it.fits_declared]

    def _unit(self, name: str, size: float, sd: float, sure: Trust, by: tuple[Finding, ...]) -> None:
        declared, counts = self.declared.unit(name)
        if sure is Trust.UNKNOWN:
            self._find(name, "unit", Trust.UNKNOWN, info("doctor.unit_open"), 0.0, *by)
            return
        odds = unit_odds(name, size, sd, declared)
        rest = math.log(size * (odds.factor if odds.unit else 1.0)) if name == "gyr" else 0.0  # that no unit explains
        beyond = max(abs(rest) - _GAIN, 0.0)
        near = beyond <= 3.0 * sd
        if not near and (odds.unit in (None, declared) or 0.5 * (beyond / sd) ** 2 >= CERTAIN):
            self._factor(size, sure, beyond, by)
            return
        if odds.unit is None:
            finding = info("doctor.no_unit", factor=odds.factor)
            self._find(name, "unit", Trust.UNKNOWN, finding, 0.0, *by, lines=[])
            return
        answer = Trust.UNKNOWN if odds.log_odds < _HINT else sure if near and odds.log_odds >= CERTAIN else Trust.LIKELY
        self.numbers.setdefault(name, {})["unit"] = odds.unit
        wrong = odds.unit != declared and (answer is not Trust.UNKNOWN or odds.declared_odds < -CERTAIN)
        if answer is Trust.UNKNOWN:  # that it is wrong is certain, which of two is right is not
            finding = info("doctor.unit_of_two", unit=odds.unit, next=odds.next)
            self._find(name, "unit", answer, finding, odds.log_odds, *by, lines=[] if wrong else None)
            return
        line = f'unit = "{odds.unit}"' if counts is None else f"unit_per_count = {counts * odds.factor:.6g}"
        factor = math.exp(rest) if abs(rest) > 3.0 * sd else None
        finding = info("doctor.unit", unit=odds.unit, factor=factor, sd=sd)
        self._find(name, "unit", answer, finding, odds.log_odds, *by, lines=[line] if wrong else None)

    def _factor(self, size: float, sure: Trust, beyond: float, by: tuple[Finding, ...]) -> None:
        """Rates that are wrong by a factor that no unit explains, `beyond` what gains are off by, as a logarithm."""
        sd = float(self.numbers["gyr"]["scale_sd"]) * size
        if sure is not Trust.SURE and not all(sensor.fits_declared for sensor in self._trusted()):
            finding = info("doctor.factor_perhaps", factor=size, sd=size * sd)
            self._find("gyr", "unit", Trust.UNKNOWN, finding, 0.0, *by)
            return
        odds = 0.5 * (beyond / sd) ** 2
        answer = sure if odds >= CERTAIN else Trust.LIKELY
        self._find("gyr", "unit", answer, info("doctor.factor", factor=size, sd=size * sd), odds, *by, lines=[])

    def _delay(self, sensor: _Sensor) -> None:
        fitted = sensor.found
        sd = math.inf if fitted is None else math.hypot(fitted.delay_sd, fitted.in_step)
        if fitted is None or not sensor.known or not sd <= _VAGUE_DELAY:
            self._find(sensor.name, "delay", Trust.UNKNOWN, info("doctor.delay_open"), 0.0, info("doctor.turn_faster"))
            return
        apart = abs(fitted.delay_halves[0] - fitted.delay_halves[1])
        agree = apart <= max(2.0 * _EXACT, 6.0 * fitted.delay_sd)
        sure = sensor.answer is Trust.SURE and sd <= _EXACT and agree
        answer = Trust.SURE if sure else Trust.LIKELY if agree else Trust.UNKNOWN
        rate = self.values["gyr"] * fitted.scale
        # stamps follow what they stamp, so where a vector comes early the rates are late, and the attitude with them
        usual = float(np.sqrt(np.nanmean(np.sum(rate * rate, axis=1))))
        angle = abs(fitted.delay) * (usual if fitted.delay < 0.0 else _steady_rate(self.t, rate))
        clear = abs(fitted.delay) > max(5.0 * fitted.delay_sd, _EXACT, 3.0 * fitted.in_step)
        wrong = sensor.answer is Trust.SURE and agree and clear and angle > _MATTERS
        code = "doctor.late" if fitted.delay > 0.0 else "doctor.early"
        finding = info(code, delay_ms=1e3 * abs(fitted.delay), sd_ms=1e3 * sd)
        odds = 0.5 * min((fitted.delay / sd) ** 2, 1e3) if answer is not Trust.UNKNOWN else 0.0
        self.numbers.setdefault(sensor.name, {}).update(delay_s=fitted.delay, delay_sd_s=sd)
        why = [info("doctor.turned_meanwhile", angle_deg=to_deg(angle))] if clear and agree and not wrong else []
        lines = [f'delay = "{1e3 * fitted.delay:.1f} ms"'] if wrong else None
        self._find(sensor.name, "delay", answer, finding, odds, *why, lines=lines)

    def _find(
        self, sensor: str, question: str, answer: Trust, finding: Finding, log_odds: float = 0.0, *reasons: Finding,
        lines: Sequence[str] | None = None,
    ) -> None:  # fmt: skip
        """Answer a question; with lines, which may be none, what the recording is read as is wrong."""
        wrong = lines is not None
        self.answers[sensor, question] = Convention(sensor, question, answer, finding, log_odds, wrong, reasons)
        if lines:
            self.lines[sensor, question] = list(lines)


def _steady_rate(t: Floats, gyr: Floats) -> float:
    """Rate in space, averaged as a filter averages a vector: what a delay turns it by for good, rad/s rms.

    That of all samples where a pause is in each average.
    """
    rate = np.nan_to_num(gyr)
    q = quat_chained(0.5 * (rate[1:] + rate[:-1]) * np.diff(t)[:, np.newaxis])
    edges = np.arange(t[0], t[-1], min(_AVERAGED, 0.5 * float(t[-1] - t[0])))
    averages = Samples(t, quat_rotate(q, rate)).means(edges)
    averages = averages[np.isfinite(averages[:, 0])]
    return float(np.sqrt(np.mean(np.sum((averages if averages.size else rate) ** 2, axis=1))))


def unusable(imu: ImuData, name: str) -> NDArray[np.bool_]:
    """Samples (N,) of a triad that say nothing of its turning: held on an axis or on all.

    An axis that repeats to the bit while the others change is at the end of its range, or dead. A coarse step repeats,
    too: runs count that chance makes once in a hundred recordings, and after which the axis moves by more than its
    smallest step; and then all samples of that value.
    """
    out = np.zeros(len(imu), dtype=np.bool_)
    repeats = statistics(imu, name).repeats
    rows = np.flatnonzero(repeats != NOT_KNOWN)
    repeats = repeats[rows]
    moving = np.flatnonzero(repeats != ALL_AXES)
    if moving.size < 2:  # it never changes: a simulation without noise, at rest
        return out
    for start, stop in stuck_runs(repeats == ALL_AXES):
        out[rows[start] : rows[stop - 1] + 1] = True
    values = np.asarray(getattr(imu, name))
    for axis, column in enumerate(values[rows[moving]].T):
        again = repeats[moving] >> axis & 1 != 0
        share = float(np.mean(again[(column > column.min()) & (column < column.max())])) if np.ptp(column) else 0.0
        by_chance = math.log(0.01 / again.size) / math.log(share) if 0.0 < share < 1.0 else 0.0
        moves = np.abs(np.diff(column, append=math.inf))
        least = 1.5 * float(np.min(moves, where=moves > 0.0, initial=math.inf))
        long = [(a, b) for a, b in check.runs(again) if b - a >= max(by_chance, _SHORTEST_RUN)]
        out |= np.isin(values[:, axis], [column[a] for a, b in long if moves[b - 1] > least or b == again.size])
    return out
