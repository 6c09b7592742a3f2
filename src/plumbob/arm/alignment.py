"""From motion to a card: where joints lie and how they turn in the units' axes, how units sit, and how good it is."""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from plumbob import rotations
from plumbob.arm import geometry
from plumbob.arm.array.channels import joined
from plumbob.arm.clocks import UnitClock
from plumbob.arm.filter import Params, UnitSamples
from plumbob.arm.links import FORCE_SD, FORCE_TIME, GROUND, PLAY_TIME, JointLink, chain_links, joint_axes, unit_numbers
from plumbob.arm.smoother import LOST, Attitudes, UnitAttitudes
from plumbob.core import check
from plumbob.core.check import Floats, number
from plumbob.core.errors import CalibrationError, ParameterError, ShapeError
from plumbob.core.files import reading, text_of
from plumbob.core.params import build
from plumbob.core.units import Quantity, deg, dps, given, to_deg
from plumbob.data.array import ImuArray, UnitMount
from plumbob.data.cards.file import Card, built
from plumbob.data.chain import Chain, Joint, Segment, chain_text, parse_chain
from plumbob.filters.smoother.keyframes import trusted
from plumbob.filters.smoother.preprocess import SampleWatch, watched
from plumbob.rotations import quat_conjugate, quat_multiply

if TYPE_CHECKING:
    from plumbob.data.imu import ImuData
    from plumbob.door.reading import Source

ROUNDS: Final = 10  # attitudes and geometry are found in turn, so often at most,
SURE: Final = 0.1  # when less than this share of the first doubt about mounts is left;
SHARP: Final = 30.0  # an arm that is wrong by 1 m makes forces wrong by this, m/s², where joints move briskly: 300 °/s
SETTLED: Final = (5e-4, deg(0.1))  # or until arms, m, and axes, rad, change by less
LONGEST: Final = 600.0  # of a longer recording the first part is used, s
SHORTEST: Final = 5.0  # less motion than this, s, is refused
MOUNT_ANGLE, MOUNT_SHIFT = deg(5.0), 0.02  # a unit sits as the chain says to these standard deviations, rad and m
LENGTH_SD, AXIS_SD = 0.002, deg(0.2)  # the chain's own lengths, m, and axes, rad, are right to these

POOR_ARM, POOR_AXIS = (
    0.015,
    deg(3.0),
)  # a joint is poorly known whose arms, m, or axis, rad, are more uncertain than this
CALIBRATED_BIAS: Final = dps(0.1)
CALIBRATED_SCALE: Final = 0.0005
"""What is left of a calibrated gyroscope's bias, rad/s, and scale: it was some other day, at another temperature."""
NOISE_MARGIN: Final = 2.0  # arms shake units more than a table at rest, where noise cards come from
POSE_SD: Final = deg(1.0)  # a pose is held to this, rad, where nothing else is said
ODD: Final = 3.5  # a mount farther off than so many standard deviations, each of its three components, is not believed;
FAR: Final = 5.0  # nor is a length, an axis or a pose that is farther off

_SCATTER: Final = ("play", "force_sd", "play_time", "force_time")  # what a link and its card both hold

Pose = tuple[float, float, Sequence[float]]  # from when to when, s, which angles were held, rad


@dataclass(frozen=True)
class JointCard:
    """What was found of a joint.

    `arms` (2, 3), `axes` (2, K, 3), `play`, `force_sd`, `play_time`, `force_time`: as of
    `plumbob.arm.links.JointLink`; `arm_sd` (2, 3), `axis_sd` (2,): standard deviations of the arms, m, and of the axes,
    rad; `sway`: how far both segments turn against each other besides, about each axis, as units sway on them, rad;
    `rating`: "good", "fair" or "poor", and why.
    """

    name: str
    arms: Any
    axes: Any
    arm_sd: Any
    axis_sd: Any
    play: float
    force_sd: float
    play_time: float
    force_time: float
    sway: float
    rating: str

    def __post_init__(self) -> None:
        """Validate."""
        for name, shape in (("arms", (2, 3)), ("arm_sd", (2, 3)), ("axis_sd", (2,))):
            value = check.floats(name, getattr(self, name))
            if value.shape != shape or not np.isfinite(value).all():
                raise CalibrationError(f"{name} of the joint '{self.name}' must be finite and of shape {shape}.")
        axes = np.asarray(self.axes, dtype=np.float64).reshape(2, -1, 3)
        object.__setattr__(self, "axes", axes.tolist())
        if not (self.play > 0.0 and self.force_sd > 0.0):
            raise CalibrationError(f"play and force_sd of the joint '{self.name}' must be above 0.")


@dataclass(frozen=True)
class ArmCard(Card):
    """A chain as its units see it; `plumbob.arm.run` needs it.

    Attributes
    ----------
    chain : Chain
        With the mounts that were found, and a geometry that was found where none was known.
    joints : tuple of JointCard
        In the order of the chain.
    mount_sd : mapping of str to list
        By unit: standard deviations of the turn, rad (3), and of the lever, m (3), of its mount.
    source : str
        What it was found from.
    facing : sequence of (float, float)
        Of `plumbob.joints`: turns about the vertical, rad, by which the axes of all segments may be off together, and
        their probabilities.
    """

    chain: Chain
    joints: tuple[JointCard, ...]
    mount_sd: Mapping[str, Any]
    source: str = ""
    facing: Any = ()

    KIND: ClassVar[str] = "plumbob arm card"
    VERSION: ClassVar[int] = 1
    PARTS: ClassVar[Mapping[str, type]] = {}

    def text(self) -> str:
        """Text of the card's file; the chain stands in it as in a chain's own."""
        joints = [vars(joint) for joint in self.joints]
        content = {
            "kind": self.KIND, "format_version": self.VERSION, "source": self.source, "chain": chain_text(self.chain),
            "joints": joints, "mount_sd": self.mount_sd, "facing": self.facing,
        }  # fmt: skip
        return json.dumps(content, indent=2, default=lambda a: a.tolist(), allow_nan=False) + "\n"

    def __post_init__(self) -> None:
        """Build the parts of a card that was read."""
        if isinstance(self.chain, str):
            object.__setattr__(self, "chain", parse_chain(self.chain, name="chain"))
        joints = tuple(raw if isinstance(raw, JointCard) else built("joints", JointCard, raw) for raw in self.joints)
        object.__setattr__(self, "joints", joints)
        names = [joint.name for joint in self.chain.joints]
        if [joint.name for joint in joints] != names:
            raise CalibrationError(f"the card's joints must be those of its chain, {', '.join(names)}.")

    def facts(self) -> Mapping[str, str]:
        """Chain, source, and the rating of each joint."""
        facts = {"chain": self.chain.name, "source": self.source or "not named"}
        return facts | {joint.name: joint.rating for joint in self.joints}

    def links(self) -> list[JointLink]:
        """The joints as the filter takes them."""
        numbers = unit_numbers(self.chain)
        return [
            JointLink(
                joint, numbers[joint.parent], numbers[joint.child], np.array(card.arms),
                np.array(card.axes, dtype=np.float64).reshape(2, -1, 3),
                **{name: getattr(card, name) for name in _SCATTER},
            )
            for joint, card in zip(self.chain.joints, self.joints, strict=True)
        ]  # fmt: skip

    def summary(self) -> dict[str, Any]:
        """All numbers, as JSON can hold them; SI."""
        return {"chain": self.chain.name, "source": self.source, "joints": [vars(joint) for joint in self.joints],
                "mount_sd": dict(self.mount_sd)}  # fmt: skip

    def table(self) -> str:
        """What was found, as text: a line for each joint and unit."""
        lines = [f"{'joint':<12} {'kind':<10} {'arms, mm (sd)':<24} {'axis sd':<9} {'play':<7} {'sway':<7} rating"]
        for joint, card in zip(self.chain.joints, self.joints, strict=True):
            arms = " · ".join(
                f"{1e3 * np.linalg.norm(arm):.0f} ({1e3 * max(sd):.0f})"
                for arm, sd in zip(card.arms, card.arm_sd, strict=True)
            )
            axis = f"{to_deg(max(card.axis_sd)):.2f}°" if np.size(card.axes) else "–"
            play = f"{to_deg(card.play):.2f}°" if np.size(card.axes) else "–"
            sways = f"{to_deg(card.sway):.2f}°"
            lines.append(f"{joint.name:<12} {joint.kind:<10} {arms:<24} {axis:<9} {play:<7} {sways:<7} {card.rating}")
        return "\n".join(lines)


def opened_chain(chain: Chain | ArmCard | str | Path) -> Chain | ArmCard:
    """Chain of a TOML file or a URDF, or a card; what is none of these files is given back."""
    if not isinstance(chain, str | Path):
        return chain
    if Path(chain).suffix.lower() == ".urdf":
        from plumbob.arm.urdf import chain_from_urdf

        return chain_from_urdf(chain)
    with reading(Path(chain)):
        return parsed_chain(text_of(chain), Path(chain).stem)


def parsed_chain(text: str, name: str) -> Chain | ArmCard:
    """Chain or card of the text of its file."""
    return ArmCard.from_text(text, name) if text.lstrip().startswith("{") else parse_chain(text, name=name)


def align(
    chain: Chain | str | Path, array: "ImuArray | Source | Sequence[Source] | Mapping[str, Source]", *,
    poses: Sequence[Pose] = (), pose_sd: float | str = "1 deg", mount_angle: float = MOUNT_ANGLE,
    mount_shift: float = MOUNT_SHIFT, params: Mapping[str, Any] | None = None,
    note: Callable[[str], None] | None = None,
) -> ArmCard:  # fmt: skip
    """Find from motion where joints lie in the units' axes, how they turn, and how the units sit.

    Where the chain says where its joints lie, the units' mounts are found: each starts from what the chain says of it.
    Where it does not, each segment's axes are those of its unit, its origin is its joint, and the geometry is found.

    Parameters
    ----------
    chain : Chain or path
        The chain; of joints of unknown geometry the kind suffices.
    array : ImuArray, or what `plumbob.door.reading.read_array` reads
        A recording in which every joint moves about all its axes for some seconds, briskly.
    poses : sequence of (float, float, sequence of float)
        From when to when, s, the chain was held still at which angles, rad. One at rest with all angles at zero in
        the first seconds says how units sit about axes that motion shows badly.
    pose_sd : float or str
        How exactly they were held, rad, or text with a unit.
    mount_angle, mount_shift : float
        How well the chain's own mounts are known before, rad and m; standard deviations.
    params : mapping, optional
        Of the filter, `plumbob.arm.filter.Params`.
    note : callable, optional
        Called with remarks.

    Returns
    -------
    ArmCard

    Raises
    ------
    ParameterError
        If a segment has no unit, units are missing, or a pose does not fit.
    ShapeError
        If the recording is too short or a unit lacks a gyroscope or an accelerometer.
    """
    from plumbob.door.reading import opened_array

    chain, held = (
        check.kind("chain", opened_chain(chain), Chain),
        number("pose_sd", given("pose_sd", pose_sd, Quantity.ANGLE), "rad"),
    )
    for name, value in (("pose_sd", held), ("mount_angle", mount_angle), ("mount_shift", mount_shift)):
        if not 0.0 < value < np.inf:
            raise ParameterError(f"{name} must be above 0 and finite, but it is {value:g}.")
    array = opened_array(array)
    mounting = _Mounting(poses, held, mount_angle, mount_shift)
    return _aligned(chain, lambda _: array, mounting, params, note)[0]


def align_units(
    chain: Chain, units: Mapping[str, "ImuData"], clocks: Mapping[str, UnitClock] | None, poses: Sequence[Pose],
    params: Mapping[str, Any],
) -> tuple[ArmCard, dict[str, UnitClock], Attitudes]:  # fmt: skip
    """As `align`, of units with clocks of their own that are known roughly, if any; gives clocks and attitudes, too.

    `units`: by name, the chain's; the first has the clock that all are brought to.
    """
    mounting = _Mounting(poses, POSE_SD, MOUNT_ANGLE, MOUNT_SHIFT)
    return _aligned(chain, lambda current: on_one_clock(units, current), mounting, params, None, clocks)


def on_one_clock(units: Mapping[str, "ImuData"], clocks: Mapping[str, UnitClock]) -> ImuArray:
    """Units with their clocks put right, at the times of the first."""
    start = next(iter(units.values())).meta.t0_ns
    return joined({
        name: replace(imu, t=clock.corrected(np.array(imu.t)), meta=replace(imu.meta, t0_ns=start))
        if (clock := clocks.get(name)) is not None else imu
        for name, imu in units.items()
    })  # fmt: skip


def _aligned(
    chain: Chain, at: Callable[[Mapping[str, UnitClock]], ImuArray], mounting: "_Mounting",
    params: Mapping[str, Any] | None, note: Callable[[str], None] | None, clocks: Mapping[str, UnitClock] | None = None,
) -> tuple[ArmCard, dict[str, UnitClock], Attitudes]:  # fmt: skip
    """Card, clocks and attitudes of the units; `at` gives the units with clocks put right."""

    def used(array: ImuArray) -> UnitSamples:
        samples = chain_samples(chain, array)
        return samples.rows(0, int(np.searchsorted(samples.t, samples.t[0] + LONGEST)))

    array = at(clocks or {})
    samples, settings = used(array), filter_params(chain, array, params)
    if samples.t[-1] - samples.t[0] < SHORTEST:
        raise ShapeError(
            f"the motion lasts {samples.t[-1] - samples.t[0]:.3g} s, but {SHORTEST:g} s are needed at least; a minute "
            "in which every joint turns is enough."
        )
    samples_at = None if clocks is None else lambda current: used(at(current))
    search = _AlternatingSearch(chain, samples, settings, mounting, samples_at, clocks)
    fits, mounted, sd = search.solve(), search.chain, search.mount_sd
    if not chain.known:
        mounted, sd = _geometry(chain, fits, mounting.poses), _found_sd(chain, fits)
    units = {segment.name: segment.unit for segment in chain.segments}
    joints = tuple(
        _card(link, fits, k, search.mount_sd, units, search.odd.get(link.joint.child, ""))
        for k, link in enumerate(fits.links)
    )
    for joint in joints:
        if note and not joint.rating.startswith("good"):
            note(f"{joint.name}: {joint.rating}")
    source = f"{samples.t[-1] - samples.t[0]:.3g} s of motion"
    return ArmCard(chain=mounted, joints=joints, mount_sd=sd, source=source), search.clocks, fits.motion


def filter_params(chain: Chain, array: ImuArray, params: Mapping[str, Any] | None) -> Params:
    """Parameters of the filter: those given, else what is known of the units, else the defaults.

    Of calibrated units little bias and scale is left; noise cards say what their gyroscopes scatter by.
    """
    used = [segment.unit for segment in chain.segments if segment.unit]
    defaults: dict[str, Any] = {}
    if all(array.units[name].meta.calibration is not None for name in used):
        defaults |= {"bias_sd": CALIBRATED_BIAS, "gyr_scale_sd": CALIBRATED_SCALE}
    cards = [array.mounts[name].noise for name in used]
    noises = [card.gyr.n_rms for card in cards if card is not None and card.gyr is not None]
    if len(noises) == len(used):
        defaults["gyro_noise"] = max(NOISE_MARGIN * max(noises), 1e-9)
    return build(Params, defaults | dict(params or {}), of="arm")


def require_units(chain: Chain, names: Sequence[str]) -> None:
    """Refuse units of which one on the chain is missing."""
    for segment in chain.segments:
        if segment.unit and segment.unit not in names:
            raise ParameterError(
                f"the segment '{segment.name}' has the unit '{segment.unit}', but the recording has "
                f"{', '.join(names)}. Name the units as the recording does."
            )


def chain_samples(chain: Chain, array: ImuArray, watches: Mapping[str, SampleWatch] | None = None) -> UnitSamples:
    """Samples of the units of a chain, in the order of its segments; what is stuck or beyond its range is missing.

    Of a stream `watches` have seen what came before, by unit.
    """
    check.kind("array", array, ImuArray)
    if not chain.joints:
        raise ParameterError(f"{chain.name} has no joint, so one unit is all there is; plumbob run estimates one unit.")
    require_units(chain, array.names)
    names = [segment.unit for segment in chain.segments if segment.unit]
    for name in names:
        lacking = [triad for triad in ("gyr", "acc") if triad not in array.units[name].triads]
        if lacking:
            raise ShapeError(f"the unit '{name}' has no {' and no '.join(lacking)}, which a chain needs of every unit.")
    units = [
        watched(imu) if watches is None else imu.flagged(watches[name].words(np.array(imu.t), *trusted(imu, mag=True)))
        for name, imu in ((name, array.units[name]) for name in names)
    ]
    gyr, acc, mag = (np.stack(triad) for triad in zip(*(trusted(imu, mag=True) for imu in units), strict=True))
    words = np.bitwise_or.reduce([imu.flags for imu in units])
    has_mag = watches is not None or np.isfinite(mag).any()
    return UnitSamples(np.array(array.t), gyr, acc, mag if has_mag else None, words)


class _Fits(NamedTuple):
    links: list[JointLink]
    arms: list[geometry.GeometryFit]
    axes: list[geometry.GeometryFit | None]
    motion: Attitudes


class _Mounting(NamedTuple):
    """What is known of mounts before: postures and how exactly they were held, turns, rad, and shifts, m."""

    poses: Sequence[Pose]
    pose_sd: float
    angle: float
    shift: float


class _AlternatingSearch:
    """Attitudes and geometry in turn.

    Where the chain says where its joints lie, arms and axes are those of units that are mounted a little differently:
    what motion shows badly, a neighbouring joint or a posture may show well.
    """

    def __init__(
        self, chain: Chain, samples: UnitSamples, params: Params, mounting: "_Mounting",
        at: Callable[[Mapping[str, UnitClock]], UnitSamples] | None = None,
        clocks: Mapping[str, UnitClock] | None = None,
    ) -> None:  # fmt: skip
        self._at, self.clocks = at, dict(clocks or {})
        self._samples, self._params, self._chain, self._mounting = samples, params, chain, mounting
        self._links = chain_links(chain) if chain.known else _unknown_links(chain, samples)
        self.chain, self.mount_sd, self.odd = chain, dict[str, Any](), dict[str, str]()
        self._begin: Floats | None = None  # first attitudes (U, 4), where headings are known from the round before

    def solve(self) -> _Fits:
        """What it comes to."""
        rounds = 0
        while True:
            doubt = 0.5**rounds if self._chain.known else 0.0  # of the first one about mounts
            motion = self._motion(doubt)
            terms = geometry.force_terms(self._samples, motion, mean_rate=self._params.mean_rate)
            if not self._chain.known:
                self._first_axes(terms)
            arms = [
                geometry.fit_arms(
                    terms, link, link.arms if self._chain.known else np.zeros((2, 3)),
                    clocks=self._at is not None and link.parent != GROUND,
                )
                for link in self._links
            ]  # fmt: skip
            axes = [None if link.joint.kind == "ball" else geometry.fit_axes(terms, link) for link in self._links]
            new = [_fitted(link, arm, axis) for link, arm, axis in zip(self._links, arms, axes, strict=True)]
            fits = _Fits(new, arms, axes, motion)
            if self._chain.known:
                fits = fits._replace(links=self._mounted(fits, doubt))
            else:
                self._begin = _with_headings(fits)
            moved, turned = _change(self._links, fits.links)
            self._links, rounds = fits.links, rounds + 1
            late = 0.0 if self._at is None else self._set_clocks(fits)
            if (max(moved, late) < SETTLED[0] and turned < SETTLED[1] and doubt < SURE) or rounds == ROUNDS:
                return fits

    def _set_clocks(self, fits: _Fits) -> float:
        """Put right the clock of each unit against its neighbour's; gives the largest change, s."""
        assert self._at is not None
        units, changes = {segment.name: segment.unit for segment in self._chain.segments}, dict[str, Floats]()
        for link, arm in zip(fits.links, fits.arms, strict=True):
            offset, drift, sd = arm.clock
            changes[link.joint.child] = changes.get(link.joint.parent, np.zeros(2)) + (offset, drift)
            if (unit := units[link.joint.child]) in self.clocks:
                self.clocks[unit] = self.clocks[unit].changed(changes[link.joint.child], sd)
        self._samples = self._at(self.clocks)
        return max(float(abs(change[0])) for change in changes.values())

    def _mounted(self, fits: _Fits, doubt: float) -> list[JointLink]:
        """Links of the chain whose mounts explain best what was found."""
        both = np.repeat([(doubt * self._mounting.shift) ** 2, (doubt * self._mounting.angle) ** 2], 7).reshape(2, 7)
        both[0, 6] = both[1, 6]
        fits = fits._replace(
            arms=[fit._replace(cov=fit.cov + np.diag(both[0])) for fit in fits.arms],
            axes=[None if fit is None else fit._replace(cov=fit.cov + np.diag(both[1])) for fit in fits.axes],
        )
        self.chain, self.mount_sd, self.odd = _mounts(self._chain, fits, self._mounting)
        return [
            replace(link, arms=nominal.arms, axes=nominal.axes)
            for link, nominal in zip(fits.links, chain_links(self.chain), strict=True)
        ]

    def _motion(self, doubt: float) -> Attitudes:
        angle, force = doubt * self._mounting.angle, doubt * self._mounting.shift * SHARP
        links = [
            replace(link, play=float(np.hypot(link.play, angle)), force_sd=float(np.hypot(link.force_sd, force)))
            for link in self._links
        ]
        attitudes = UnitAttitudes(links, self._params, pose=self._begin, pose_sd=LOST, smooth=True)
        completed = attitudes.take(self._samples, end=True)
        assert completed is not None  # at the end
        return completed[0]

    def _first_axes(self, terms: geometry.Terms) -> None:
        """First axes of joints that have none yet."""
        for k, link in enumerate(self._links):
            if link.joint.kind in ("hinge", "universal") and not link.axes.shape[1]:
                self._links[k] = replace(link, axes=geometry.first_axes(terms, link))
            elif link.joint.kind == "fixed" and not link.axes.shape[1]:
                self._links[k] = replace(link, axes=np.stack([np.eye(3), np.eye(3)]))


def _with_headings(fits: _Fits) -> Floats:
    """First attitudes of the units, each turned by the heading that the arms and axes before it ask for."""
    turns = np.zeros(len(fits.motion.q))
    for link, arm, axis in zip(fits.links, fits.arms, fits.axes, strict=True):
        turns[link.child] = turns[link.parent] + min((arm, axis or arm), key=lambda fit: float(fit.cov[6, 6])).heading
    return quat_multiply(rotations.quat_from_rotvec(np.outer(turns, geometry.UP)), fits.motion.q[:, 0])


def _unknown_links(chain: Chain, samples: UnitSamples) -> list[JointLink]:
    numbers = unit_numbers(chain)
    links = []
    for joint in chain.joints:
        if joint.known:
            raise ParameterError(
                f"{chain.name} says where {joint.name} lies, but not where every joint does. Give all, or none."
            )
        if numbers[joint.parent] == GROUND:
            raise ParameterError(
                f"{joint.name} hangs on the ground; its place must be known: give its origin and axes."
            )
        link = JointLink(joint, numbers[joint.parent], numbers[joint.child], np.zeros((2, 3)), np.zeros((2, 0, 3)))
        links.append(replace(link, arms=geometry.arms_from_sizes(samples, link)))
    return links


def _fitted(link: JointLink, arm: geometry.GeometryFit, axis: geometry.GeometryFit | None) -> JointLink:
    force = min(max(arm.residual, geometry.LEAST_FORCE_SD), 10.0 * FORCE_SD)
    link = replace(link, arms=arm.value, force_sd=force, force_time=max(arm.lasts, FORCE_TIME))
    if axis is None:
        return link
    play, lasts = max(axis.residual, geometry.LEAST_PLAY), max(axis.lasts, PLAY_TIME)
    return replace(link, axes=axis.value, play=play, play_time=lasts)


def _change(old: Sequence[JointLink], new: Sequence[JointLink]) -> tuple[float, float]:
    """Largest changes of an arm, m, and of an axis, rad."""
    moved = max(float(np.abs(a.arms - b.arms).max()) for a, b in zip(old, new, strict=True))
    turned = [
        float(np.abs(a.axes - b.axes).max()) if a.axes.shape == b.axes.shape else 1.0
        for a, b in zip(old, new, strict=True)
        if b.axes.size
    ]
    return moved, max(turned, default=0.0)


def _card(
    link: JointLink, fits: _Fits, k: int, mounts: Mapping[str, Any], units: Mapping[str, str], odd: str
) -> JointCard:
    """Card of a joint; where mounts were found, `mounts` by unit, arms and axes are as uncertain as these."""
    arm, axis = fits.arms[k], fits.axes[k]
    arm_sd = np.sqrt(np.diag(arm.cov))[:6].reshape(2, 3)
    axis_sd = np.zeros(2)
    if axis is not None:
        axis_sd = np.array([_across(axis.cov[:3, :3], link.axes[0, 0]), _across(axis.cov[3:6, 3:6], link.axes[1, 0])])
    for side, segment in enumerate((link.joint.parent, link.joint.child) if mounts else ()):
        sd = np.array(mounts.get(units[segment], np.zeros(6)))
        turn = float(sd[:3].max())
        arm_sd[side] = np.hypot(sd[3:], turn * float(np.linalg.norm(link.arms[side])))
        axis_sd[side] = turn if axis is not None else 0.0
    return JointCard(
        link.joint.name, link.arms.tolist(), link.axes.tolist(), arm_sd.tolist(), axis_sd.tolist(),
        **{name: getattr(link, name) for name in _SCATTER},
        sway=geometry.sway(arm.shake, link.arms), rating=_rating(link, arm_sd, axis_sd, odd),
    )  # fmt: skip


def _across(cov: Floats, axis: Floats) -> float:
    """Larger standard deviation across an axis."""
    flat = np.eye(3) - np.outer(axis, axis)
    return float(np.sqrt(max(np.linalg.eigvalsh(flat @ cov @ flat)[-1], 0.0)))


def _rating(link: JointLink, arm_sd: Floats, axis_sd: Floats, odd: str) -> str:
    """Word for how much a joint can be relied on, and what it lacks."""
    arm_sds = arm_sd if link.parent != GROUND else arm_sd[1:]
    lacks = [odd] if odd else []
    # along an axis about which alone a unit turns, an arm moves nothing, and is not needed; what a fixed joint leaves
    # open of its arms, both have in common, and nothing needs it
    if link.joint.kind != "fixed" and np.sort(arm_sds, axis=1)[:, :2].max() > POOR_ARM:
        lacks.append("too little motion to find its arms")
    if link.joint.kind != "fixed" and axis_sd.max(initial=0.0) > POOR_AXIS:
        lacks.append("too little motion to find its axis")
    if link.axes.size and link.play > deg(4.0):
        lacks.append(f"its axis strays by {to_deg(link.play):.1f}°: much play, or not a {link.joint.kind}")
    if link.force_sd > 1.0:
        lacks.append(f"forces differ by {link.force_sd:.1f} m/s²: units that shake, or not a joint")
    if lacks:
        return "poor: " + "; ".join(lacks)
    if link.axes.size and link.play > deg(1.5):
        return f"fair: play of {to_deg(link.play):.1f}°"
    return "good"


def _geometry(chain: Chain, fits: _Fits, poses: Sequence[Pose]) -> Chain:
    """Chain whose geometry was found: each segment's axes are those of its unit, its origin is its joint."""
    levers = {chain.segments[0].name: np.zeros(3)} | {link.joint.child: -link.arms[1] for link in fits.links}
    segments = tuple(
        replace(segment, mount=UnitMount(lever_b=tuple(levers[segment.name].tolist()))) for segment in chain.segments
    )
    joints = []
    for link in fits.links:
        origin = levers[link.joint.parent] + link.arms[0]
        joints.append(_found_joint(link, origin, fits.motion, poses))
    return replace(chain, segments=segments, joints=tuple(joints))


def _found_joint(link: JointLink, origin: Floats, motion: Attitudes, poses: Sequence[Pose]) -> Joint:
    """Joint whose angles are zero in the first posture, or at the first sample."""
    first = 0 if not poses else int(np.searchsorted(motion.t, 0.5 * (poses[0][0] + poses[0][1])))
    zero = quat_multiply(quat_conjugate(motion.q[link.parent, first]), motion.q[link.child, first])
    axes = link.joint.axes
    if link.joint.kind == "fixed":
        zero = rotations.quat_from_dcm(link.axes[0].T @ link.axes[1])
    elif link.joint.kind != "ball":
        axis = ahead = link.axes[1, 0]
        axes = (tuple(axis.tolist()),)
        if link.joint.kind == "universal":
            ahead = rotations.dcm_from_quat(quat_conjugate(zero)) @ link.axes[0, 0]
            ahead = ahead - axis * (axis @ ahead)
            axes = (tuple((ahead / np.linalg.norm(ahead)).tolist()), *axes)
        zero = _carried(zero, ahead, link.axes[0, 0])
    return replace(link.joint, origin=tuple(origin.tolist()), q_pc=tuple(zero.tolist()), axes=axes)


def _carried(q: Floats, axis: Floats, to: Floats) -> Floats:
    """Rotation nearest to q that carries an axis exactly to another."""
    rotated = rotations.quat_rotate(q, axis)
    across = np.cross(rotated, to)
    sine = float(np.linalg.norm(across))
    angle = float(np.arctan2(sine, rotated @ to)) / max(sine, 1e-12)
    return quat_multiply(rotations.quat_from_rotvec(across * angle), q)


def _found_sd(chain: Chain, fits: _Fits) -> dict[str, Any]:
    """Mounts of a chain that was found: its axes are the unit's, and its lever is the child's arm."""
    sd = {segment.unit: [0.0] * 6 for segment in chain.segments if segment.unit}
    units = {segment.name: segment.unit for segment in chain.segments}
    for link, arm in zip(fits.links, fits.arms, strict=True):
        sd[units[link.joint.child]][3:] = np.sqrt(np.diag(arm.cov))[3:6].tolist()
    return sd


def _mounts(chain: Chain, fits: _Fits, mounting: _Mounting) -> tuple[Chain, dict[str, Any], dict[str, str]]:
    """Chain with the mounts that explain arms, axes and postures best, their standard deviations, and what is odd.

    A damped least squares over a small turn and a shift of each unit's mount, a turn of each unit's attitudes about the
    vertical, as these were found with the mounts of the round before and have turned with them, and the heading of the
    ground in their frame. What contradicts all else, as a wrong length does, counts less.
    """
    from scipy.optimize import least_squares

    mounted = [segment for segment in chain.segments if segment.unit]
    problem = _MountProblem(chain, mounted, fits, mounting)
    fit = least_squares(
        problem.residuals, np.zeros(problem.size), x_scale="jac", loss="soft_l1", f_scale=geometry.LARGE
    )
    jacobian = np.asarray(fit.jac)
    cov = np.linalg.inv(jacobian.T @ jacobian)
    sd = np.sqrt(np.diag(cov))
    mounts = problem.mounts(fit.x)
    segments = tuple(replace(segment, mount=mounts.get(segment.name, segment.mount)) for segment in chain.segments)
    return (
        replace(chain, segments=segments),
        {segment.unit: sd[6 * k : 6 * k + 6].tolist() for k, segment in enumerate(mounted)},
        problem.odd(fit.x),
    )


class _MountProblem:
    """Residuals, in standard deviations, of mounts that are off by small turns and shifts."""

    def __init__(self, chain: Chain, mounted: Sequence[Segment], fits: _Fits, mounting: _Mounting) -> None:
        self._chain, self._mounted, self._fits = chain, mounted, fits
        mounts = np.tile(np.repeat([mounting.angle, mounting.shift], 3), len(mounted))
        self._prior_sd = np.concatenate((mounts, np.full(len(mounted), geometry.HEADING_SD), [np.pi]))
        self._pose_sd = mounting.pose_sd
        self._poses = [
            (self._attitudes(pose), chain.split(np.array(pose[2], dtype=np.float64)[np.newaxis]))
            for pose in mounting.poses
        ]
        self.size = len(self._prior_sd)

    def _attitudes(self, pose: Pose) -> Floats:
        """Attitudes of the units (U, 4) in the middle of a posture."""
        start, end, angles = pose
        if len(angles) != len(self._chain.angles):
            raise ParameterError(
                f"a pose of {self._chain.name} has {len(self._chain.angles)} angles "
                f"({', '.join(self._chain.angles)}), but {len(angles)} were given."
            )
        if not np.isfinite(np.array(angles, dtype=np.float64)).all():
            raise ParameterError(f"the angles of a pose must be finite, but they are {check.said(angles)}.")
        t = self._fits.motion.t
        if not t[0] <= start < end <= t[-1]:
            raise ParameterError(
                f"a pose from {start:g} to {end:g} s is not in the recording, which goes from {t[0]:g} to {t[-1]:g} s."
            )
        return self._fits.motion.q[:, int(np.searchsorted(t, 0.5 * (start + end)))]

    def mounts(self, x: Floats) -> dict[str, UnitMount]:
        """Mounts by segment."""
        mounts = {}
        for k, body in enumerate(self._mounted):
            turn, moved = x[6 * k : 6 * k + 3], x[6 * k + 3 : 6 * k + 6]
            q = quat_multiply(rotations.quat_from_rotvec(turn), np.array(body.mount.q_bs))
            lever = np.array(body.mount.lever_b) + moved
            mounts[body.name] = replace(body.mount, q_bs=tuple(q.tolist()), lever_b=tuple(lever.tolist()))
        return mounts

    def odd(self, x: Floats) -> dict[str, str]:
        """What is farther off than can be believed, in words, by segment."""
        mounts, reasons = self.mounts(x), dict[str, str]()
        for k, segment in enumerate(self._mounted):
            error, prior = x[6 * k : 6 * k + 6], self._prior_sd[6 * k : 6 * k + 6]
            if np.linalg.norm(error[:3]) > ODD * prior[0] or np.linalg.norm(error[3:]) > ODD * prior[3]:
                reasons[segment.name] = (
                    f"the unit '{segment.unit}' sits {to_deg(float(np.linalg.norm(error[:3]))):.0f}° and "
                    f"{1e3 * float(np.linalg.norm(error[3:])):.0f} mm away from where the chain says: a wrong length, "
                    "axis, pose or unit"
                )
        for link, arm, axis in zip(self._fits.links, self._fits.arms, self._fits.axes, strict=True):
            off = np.concatenate(self._of_joint(link, arm, axis, mounts, x))
            if np.abs(off).max() > FAR:
                reasons.setdefault(link.joint.child, "motion shows another place or axis than the chain says")
        for attitudes, angles in self._poses:
            for joint, off in zip(self._chain.joints, self._of_pose(attitudes, angles, mounts, x), strict=True):
                if np.abs(off).max() > FAR:
                    reasons.setdefault(joint.child, "a pose is not the one that was held")
        return reasons

    def residuals(self, x: Floats) -> Floats:
        """All of them."""
        mounts = self.mounts(x)
        rows = [x / self._prior_sd]
        for link, arm, axis in zip(self._fits.links, self._fits.arms, self._fits.axes, strict=True):
            rows += self._of_joint(link, arm, axis, mounts, x)
        for attitudes, angles in self._poses:
            rows += self._of_pose(attitudes, angles, mounts, x)
        return np.concatenate(rows)

    def _of_joint(
        self, link: JointLink, arm: geometry.GeometryFit, axis: geometry.GeometryFit | None,
        mounts: Mapping[str, UnitMount], x: Floats,
    ) -> list[Floats]:  # fmt: skip
        joint, headings = link.joint, np.append(x[6 * len(self._mounted) : -1], 0.0)  # the ground's is the last
        turn = headings[link.child] - headings[link.parent]
        expected = joint_axes(joint, mounts.get(joint.parent, UnitMount()), mounts[joint.child])
        use = np.repeat([joint.parent in mounts, True, True], (3, 3, 1))
        reach = [
            mounts[name].dcm.T @ (place - np.array(mounts[name].lever_b)) if name in mounts else np.zeros(3)
            for name, place in ((joint.parent, np.array(joint.place)), (joint.child, np.zeros(3)))
        ]
        moves = 0.0 if axis is None else link.play * float(np.linalg.norm(reach, axis=1).max())  # as the unit sways
        rows = [_whitened(arm, np.append(arm.value - reach, arm.heading - turn), np.hypot(LENGTH_SD, moves), use)]
        if axis is not None and joint.kind != "fixed":
            off = np.append(axis.value[:, 0] - expected[:, 0], axis.heading - turn)
            rows.append(_whitened(axis, off, AXIS_SD, use))
        elif axis is not None:
            apart = rotations.quat_from_dcm((axis.value[0].T @ axis.value[1]).T @ expected[0].T @ expected[1])
            rows.append(np.append(rotations.rotvec_from_quat(apart), turn) / AXIS_SD)
        return rows

    def _of_pose(
        self, attitudes: Floats, angles: Sequence[Floats], mounts: Mapping[str, UnitMount], x: Floats
    ) -> list[Floats]:
        """How far attitudes in a posture are from what mounts and angles make of it."""
        numbers, rows = unit_numbers(self._chain), []
        turns = rotations.quat_from_rotvec(np.outer(x[6 * len(self._mounted) :], geometry.UP))
        attitudes, ground = quat_multiply(turns[:-1], attitudes), turns[-1]
        for joint, joint_angles in zip(self._chain.joints, angles, strict=True):
            parent, child = numbers[joint.parent], numbers[joint.child]
            before = ground if parent == GROUND else quat_multiply(
                attitudes[parent], quat_conjugate(np.array(mounts[joint.parent].q_bs))
            )  # fmt: skip
            after = quat_multiply(attitudes[child], quat_conjugate(np.array(mounts[joint.child].q_bs)))
            off = quat_multiply(quat_conjugate(quat_multiply(before, joint.rotation(joint_angles)[0])), after)
            rows.append(rotations.rotvec_from_quat(off) / self._pose_sd)
        return rows


def _whitened(fit: geometry.GeometryFit, off: Floats, sd: float, use: NDArray[np.bool_]) -> Floats:
    """What is in use of a fit's differences (7,), in standard deviations; the chain itself is right to `sd`."""
    cov = fit.cov + np.diag(np.repeat([sd**2, 0.0], (6, 1)))
    return np.asarray(np.linalg.solve(np.linalg.cholesky(cov[np.ix_(use, use)]), off[use]))
