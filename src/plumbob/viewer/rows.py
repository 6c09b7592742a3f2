"""The rows of the charts: which columns there are, and what samples and attitudes put into them, as they are shown."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import Any, Final, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from plumbob import rotations
from plumbob.core.check import Floats
from plumbob.core.constants import G0
from plumbob.core.errors import FrameError
from plumbob.core.time import to_ns
from plumbob.core.units import to_deg, to_dps
from plumbob.data import AttitudeTrack, ImuData
from plumbob.data.reading import read_at
from plumbob.filters.known import EXTENSIBLE, SMOOTHER
from plumbob.protocols.format import Message
from plumbob.protocols.unpack import counts_for
from plumbob.rotations.frames import HeadingPolicy, euler_sd, heading_policy, turn_heading
from plumbob.viewer.charts import euler_deg
from plumbob.viewer.messages import Column, Estimator, numbers

REFERENCE: Final = "reference"  # Name of the reference among the estimators
Stamps = NDArray[np.int64]
_SENSORS: Final = (("gyr", "rate", "°/s", 3), ("acc", "force", "m/s²", 3), ("mag", "field", "µT", 2))
_ANGLES: Final = ("roll", "pitch", "yaw")
_LAST: Final = slice(-1, None)


@dataclass(frozen=True, eq=False, slots=True)
class Attitudes:
    """Attitudes at samples; NaN where there is none."""

    q_nb: Floats  # (N, 4), body to navigation, wxyz
    frame: rotations.Frame  # navigation frame
    north: rotations.North  # what headings count from
    declination: float | None = None  # of the place, rad, as far as is known
    # bias_b, cov_b: (N, 3), estimated bias, rad/s, and covariance of the error in body axes, rad²
    bias_b: Floats | None = None
    cov_b: Floats | None = None
    flags: NDArray[np.uint32] | None = None  # (N,), of the estimator

    @classmethod
    def from_track(cls, track: AttitudeTrack, rows: NDArray[np.intp] | None, declination: float | None) -> Self:
        """Rows of a track, where −1 stands for no attitude; all of them where `rows` is None."""
        q, bias, cov, words = track.q_nb, track.bias_b, track.cov_b, track.flags
        if rows is not None:
            q = _picked(q, rows)
            bias, cov = (None if values is None else _picked(values, rows) for values in (bias, cov))
            words = None if words is None else np.where(rows < 0, np.uint32(0), words[rows])
        return cls(q, track.frame, track.north, declination, bias, cov, words)

    @classmethod
    def read(cls, track: AttitudeTrack, t: Floats, declination: float | None) -> Self:
        """Attitudes of a track at other times (N,), s, as an evaluation reads a reference."""
        q = read_at(track, to_ns(t)).q_nb
        return cls(q, track.frame, track.north, declination)

    @classmethod
    def unknown(cls, count: int, frame: rotations.Frame, north: rotations.North) -> Self:
        """No attitude at so many samples."""
        return cls(_nothing(count, 4), frame, north)

    def rows(self, which: slice) -> "Attitudes":
        """Some of them."""
        arrays = (None if values is None else values[which] for values in (self.bias_b, self.cov_b, self.flags))
        return Attitudes(self.q_nb[which], self.frame, self.north, self.declination, *arrays)  # type: ignore[arg-type]


def rows_at(wanted: Stamps, available: Stamps) -> NDArray[np.intp]:
    """Rows (N,) of increasing times `available` that are the times `wanted` (N,), ns; −1 where there is none."""
    if not available.size:
        return np.full(wanted.size, -1, dtype=np.intp)
    place = np.minimum(np.searchsorted(available, wanted), available.size - 1)
    return np.where(available[place] == wanted, place, -1)


def _picked(values: Floats, rows: NDArray[np.intp]) -> Floats:
    picked = values[rows]
    picked[rows < 0] = np.nan
    return picked


class ShownEstimator(NamedTuple):
    """An estimator as its columns need it."""

    estimator: Estimator  # what is said of it
    biased: bool  # whether it estimates a bias of the gyroscope
    # whether its heading can be compared with the reference's; where not, the error is that of the inclination
    headed: bool = True

    @property
    def name(self) -> str:
        """Name of the estimator."""
        return self.estimator.name


def shown_estimator(name: str, kind: str, title: str, *, primary: bool) -> ShownEstimator:
    """Estimator of a filter, or of the smoother, by the name of its kind."""
    module = EXTENSIBLE.find(kind)  # BIAS: its step writes that entry of the state
    claims, biased = (kind == SMOOTHER or hasattr(module, part) for part in ("COVARIANCE", "BIAS"))
    return ShownEstimator(Estimator(name=name, title=title, primary=primary, claims=claims), biased)


def shown_of_track(name: str, track: AttitudeTrack, title: str, *, primary: bool) -> ShownEstimator:
    """Estimator of a track that a recording carries."""
    estimator = Estimator(name=name, title=title, primary=primary, claims=track.cov_b is not None)
    return ShownEstimator(estimator, track.bias_b is not None and bool(np.any(track.bias_b)))


@dataclass(frozen=True, slots=True)
class RowLayout:
    """Which columns there are."""

    triads: Sequence[str]  # of the unit
    temperature: bool  # whether it has one
    shown: Sequence[ShownEstimator]  # estimators, the primary one first, without the reference
    reference: str | None = None  # what the reference is; None where there is none
    joints: Sequence[str] = ()  # names of a chain's angles
    columns: list[Column] = field(init=False)

    def __post_init__(self) -> None:
        """Name the columns."""
        columns = [*self._of_sensors(), *self._of_estimators()]
        for chart, end, digits in (("joint", "", 2), ("joint_sd", ".sd", 2)):
            columns += [_column(f"joint.{name}{end}", chart, name, "°", digits, "joints") for name in self.joints]
        object.__setattr__(self, "columns", columns)

    @property
    def estimators(self) -> list[Estimator]:
        """All of them, and the reference."""
        named = [shown.estimator for shown in self.shown]
        if self.reference is None:
            return named
        return [*named, Estimator(name=REFERENCE, title=self.reference, primary=False, claims=False)]

    def _of_sensors(self) -> Iterator[Column]:
        for name, chart, unit, digits in _SENSORS:
            if name in self.triads:
                for axis in "xyz":
                    yield _column(f"{name}.{axis}", chart, axis, unit, digits, name)
        if self.temperature:
            yield _column("temp", "temperature", "temperature", "°C", 2, "temp")
        if "acc" in self.triads:
            yield _column("acc.excess", "residual", "|force| − g", "m/s²", 3, "acc")

    def _of_estimators(self) -> Iterator[Column]:
        for shown in self.shown:
            name = shown.name
            yield from (_column(f"{name}.{angle}", "attitude", angle, "°", 2, name) for angle in _ANGLES)
            if shown.estimator.claims:
                yield from (_column(f"{name}.sd.{angle}", "sd", angle, "°", 3, name) for angle in _ANGLES)
            if shown.biased:
                yield from (_column(f"{name}.bias.{axis}", "bias", axis, "°/s", 4, name) for axis in "xyz")
            if "acc" in self.triads:
                yield _column(f"{name}.force_angle", "residual", "force to up", "°", 2, name)
            if "mag" in self.triads:
                yield _column(f"{name}.field_angle", "residual", "field to North", "°", 2, name)
            if self.reference is not None:
                yield _column(f"{name}.error", "error", "error" if shown.headed else "inclination", "°", 3, name)
        if self.reference is not None:
            yield from (_column(f"{REFERENCE}.{angle}", "attitude", angle, "°", 2, REFERENCE) for angle in _ANGLES)

    def values(
        self, imu: ImuData | None, count: int, attitudes: Mapping[str, Attitudes], reference: Attitudes | None,
        joints: Floats | None = None,
    ) -> Floats:  # fmt: skip
        """Values (N, M) of the columns, in their units, of calibrated samples, and attitudes and joints at them."""
        blocks = [] if imu is None else list(self._sensed(imu))
        true = None
        if self.reference is not None:
            primary = attitudes[self.shown[0].name] if self.shown else None
            true = _nothing(count, 4) if reference is None else in_primary_frame(primary, reference)
        for shown in self.shown:
            blocks += self._estimated(shown, attitudes[shown.name], imu, true)
        if true is not None:
            blocks.append(euler_deg(true))
        if joints is not None:
            blocks.append(joints)
        return np.concatenate(blocks, axis=1) if blocks else _nothing(count, 0)

    def _sensed(self, imu: ImuData) -> Iterator[Floats]:
        for name, *_ in _SENSORS:
            if name in self.triads:
                values = imu.usable(name)
                yield to_dps(values) if name == "gyr" else values
        if self.temperature:
            yield (np.full(len(imu), np.nan) if imu.temp_c is None else imu.temp_c)[:, np.newaxis]
        if "acc" in self.triads:
            yield np.sqrt(np.einsum("ij,ij->i", imu.usable("acc"), imu.usable("acc")))[:, np.newaxis] - G0

    def _estimated(
        self, shown: ShownEstimator, at: Attitudes, imu: ImuData | None, true: Floats | None
    ) -> Iterator[Floats]:
        count = len(at.q_nb)
        yield euler_deg(at.q_nb)
        if shown.estimator.claims:
            yield claimed_sd(at)
        if shown.biased:
            yield _nothing(count, 3) if at.bias_b is None else to_dps(at.bias_b)
        if imu is not None and "acc" in self.triads:
            yield _from_up(at, imu.usable("acc"))[:, np.newaxis]
        if imu is not None and "mag" in self.triads:
            yield _from_north(at, imu.usable("mag"))[:, np.newaxis]
        if true is not None:
            yield angle_errors(at.q_nb, true, headed=shown.headed)[:, np.newaxis]


def claimed_sd(at: Attitudes) -> Floats:
    """Claimed standard deviations of roll, pitch and yaw (N, 3), degrees; none of a yaw that is free."""
    if at.cov_b is None:
        return _nothing(len(at.q_nb), 3)
    sd = to_deg(euler_sd(at.q_nb, at.cov_b))[:, ::-1]
    if at.north is rotations.North.FREE:
        sd[:, 2] = np.nan
    return sd


def angle_errors(q_nb: Floats, true: Floats, *, headed: bool) -> Floats:
    """Angle to the reference (N,), degrees, in one frame; of the inclination alone where headings have other zeros."""
    from plumbob.evaluation.metrics import attitude_errors

    return to_deg(attitude_errors(q_nb, true)["total" if headed else "inclination"])


def attitudes_now(
    layout: RowLayout, attitudes: Mapping[str, Attitudes], reference: Attitudes | None
) -> dict[str, dict[str, Any]]:
    """Newest attitude of each estimator that has one, and of the reference, as `messages.Batch` has them."""
    now: dict[str, dict[str, Any]] = {}
    primary = attitudes[layout.shown[0].name] if layout.shown else None
    true = None if reference is None or not len(reference.q_nb) else in_primary_frame(primary, reference.rows(_LAST))
    for shown in layout.shown:
        at = attitudes[shown.name].rows(_LAST)
        if not len(at.q_nb) or not np.isfinite(at.q_nb).all():
            continue
        sd = numbers(claimed_sd(at)[0]) if shown.estimator.claims else None
        error = None if true is None else numbers(angle_errors(at.q_nb, true, headed=shown.headed))[0]
        now[shown.name] = {"q_nb": at.q_nb[0].tolist(), "sd": sd, "error": error}
    if true is not None and np.isfinite(true).all():
        now[REFERENCE] = {"q_nb": true[0].tolist(), "sd": None, "error": None}
    return now


def newest(values: Floats) -> list[float] | None:
    """Last row (K,) that is known; None where none is."""
    complete = np.flatnonzero(np.isfinite(values).all(axis=1))
    return None if not complete.size else list(map(float, values[complete[-1]]))


def headed_estimators(
    shown: Sequence[ShownEstimator], norths: Mapping[str, Attitudes], reference: rotations.North | None
) -> list[ShownEstimator]:
    """Estimators, with whether their headings can be compared with the reference's."""
    if reference is None:
        return list(shown)
    return [est._replace(headed=_policy(norths[est.name].north, reference, norths[est.name].declination).comparable)
            for est in shown]  # fmt: skip


def in_primary_frame(primary: Attitudes | None, reference: Attitudes) -> Floats:
    """Attitudes (N, 4) of a reference in the frame of the primary estimator, from its North as far as is known."""
    if primary is None:
        return reference.q_nb
    q = rotations.change_frame(reference.q_nb, to=primary.frame, from_=reference.frame)
    turn = _policy(primary.north, reference.north, primary.declination).turn
    return turn_heading(q, turn, primary.frame) if turn else q


@cache  # every flush asks
def _policy(estimate: rotations.North, reference: rotations.North, declination: float | None) -> HeadingPolicy:
    try:
        return heading_policy(estimate, reference, aligned=False, declination=declination)
    except FrameError as error:
        return HeadingPolicy(comparable=False, reason=str(error))


def _from_up(at: Attitudes, acc: Floats) -> Floats:
    """Angle (N,) of the specific force to the estimate's up, degrees."""
    force_n = rotations.quat_rotate(at.q_nb, acc)
    return to_deg(np.arctan2(np.hypot(force_n[:, 0], force_n[:, 1]), force_n @ at.frame.up))


def _from_north(at: Attitudes, mag: Floats) -> Floats:
    """Angle (N,) from the estimate's magnetic North to the field's level direction, clockwise, degrees."""
    if at.north is rotations.North.FREE or (at.north is rotations.North.TRUE and at.declination is None):
        return np.full(len(mag), np.nan)
    field_n = rotations.quat_rotate(at.q_nb, mag)
    heading = np.arctan2(field_n @ at.frame.east, field_n @ at.frame.north)
    return to_deg(rotations.wrap(heading - (at.declination or 0.0 if at.north is rotations.North.TRUE else 0.0)))


def raw_columns(message: Message, names: Mapping[str, Any]) -> list[Column]:
    """Columns of what stands in a frame of a message."""
    return [
        Column(key=entry.name, chart="raw", label=entry.name, unit="counts" if entry.physical else entry.role, digits=0,
               source=entry.name.rpartition(".")[0])
        for entry in message.fields if entry.name in names
    ]  # fmt: skip


def raw_fields(message: Message, columns: Mapping[str, NDArray[Any]]) -> dict[str, Floats]:
    """Fields of a message as they stood in the frames, (N,) in counts or words; NaN where one was absent."""
    raw = {}
    for entry in message.fields:
        if entry.name in columns:
            values = np.asarray(columns[entry.name], dtype=np.float64)
            counts = counts_for(entry, values)[0] if entry.physical else values
            raw[entry.name] = np.where(np.isfinite(values), counts, np.nan)
    return raw


def sensed_rows(sensed: ImuData) -> Floats:
    """Uncalibrated samples (N, 10): rate, rad/s, specific force, m/s², field, µT, and temperature, °C."""
    temp = np.full(len(sensed), np.nan) if sensed.temp_c is None else sensed.temp_c
    return np.column_stack([*(sensed.usable(name) for name, *_ in _SENSORS), temp])


def _nothing(count: int, width: int) -> Floats:
    return np.full((count, width), np.nan)


def _column(key: str, chart: str, label: str, unit: str, digits: int, source: str) -> Column:
    return Column(key=key, chart=chart, label=label, unit=unit, digits=digits, source=source)
