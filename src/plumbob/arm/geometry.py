"""Arms and axes of joints from motion: least squares between what both sides of a joint say."""

from typing import Final, NamedTuple

import numpy as np

from plumbob.arm.filter import UnitSamples
from plumbob.arm.links import GROUND, JointLink
from plumbob.arm.smoother import Attitudes
from plumbob.core.check import Floats
from plumbob.core.constants import G0
from plumbob.core.units import deg
from plumbob.rotations import dcm_from_quat, quat_from_rotvec, quat_multiply, skew

CUT_OFF: Final = 3.0  # forces are compared below this, Hz: above, noise of the angular acceleration would shorten arms
ARM_SD: Final = 0.3  # an arm of which nothing is known is right to this, m
LEAST_FORCE_SD: Final = 0.05  # m/s²; less is not believed of a joint,
LEAST_PLAY: Final = deg(0.2)  # nor is an axis that strays by less, rad
CLOCK_SD: Final = 0.1, 100e-6  # s and s/s: of clocks brought together roughly; quartz is good to 50 ppm
HEADING_SD: Final = deg(40.0)  # of a child's heading against its parent's, rad: iron bends fields by so much
REPEATS: Final = 1.0
"""Limbs repeat their motion after about this, s, and what units on skin say wrongly of it comes again with it."""
LARGE: Final = 2.0  # residuals beyond so many standard deviations count less
UP: Final = np.array([0.0, 0.0, 1.0])
MEAN_OVER: Final = 0.1  # the filter takes means of forces over about this, s


def sway(shake: float, arms: Floats) -> float:
    """How far units on both sides sway against their segments, rad, about each axis, that shake against each other so.

    A unit that is shaken by a force a, m/s², about a joint at the length r of its arm, in the middle of what a hand or
    a soft mounting does, 3 Hz, sways by ``a / ((2π 3 Hz)² r)``.
    """
    reach = max(float(np.linalg.norm(arms, axis=1).mean()), 0.05)
    return float(shake / ((2.0 * np.pi * CUT_OFF) ** 2 * reach))


_STARTS: Final = 5
_UNKNOWN_AXIS: Final = 1.0  # standard deviation of an axis of which nothing is known, rad
_LENGTH_SD: Final = 1e-3  # axes are unit vectors to this
_ROUNDS: Final = 8


class GeometryFit(NamedTuple):
    """What was found.

    `value`: arms (2, 3), m, or axes (2, K, 3), of both sides; `heading`: by which the child's attitudes must turn about
    the vertical against the parent's for these, rad; `cov` (7, 7): covariance of the parent's, then the child's, of the
    first axis, and of the heading; `residual`: what both sides differ by: of forces the standard deviation of one side,
    a mean over 0.1 s, m/s², of axes that of each component of the difference, rad; `lasts`: how long that lasts, s: a
    mean over T has its variance times ``2 lasts / T``; `shake`: of forces, the standard deviation of a component of
    the difference of single samples, m/s².
    """

    value: Floats
    cov: Floats
    residual: float
    lasts: float
    heading: float = 0.0
    shake: float = 0.0
    clock: tuple[float, float, float] = (0.0, 0.0, 0.0)  # of fit_arms: offset, s, drift, s/s, and sd of the offset, s


class Terms(NamedTuple):
    """What forces at joints are made of, in unit axes, at times (M,), s.

    `matrix` (U, M, 3, 3): attitudes at the instants of the samples; `lever` (U, M, 3, 3): ``[ω̇]× + [ω]×²``, to be
    multiplied by an arm; `force` (U, M, 3): specific forces, m/s².
    """

    t: Floats
    matrix: Floats
    lever: Floats
    force: Floats


def lever_matrices(t: Floats, gyr: Floats) -> Floats:
    """``[ω̇]× + [ω]×²`` (U, N, 3, 3) of rates (U, N, 3), rad/s."""
    spin, change = skew(gyr), skew(np.gradient(gyr, t, axis=1))
    return change + spin @ spin


def interpolated(values: Floats, t: Floats) -> Floats:
    """Values (U, N, 3) whose missing ones are filled in on straight lines."""
    filled = np.array(values)
    for signal in filled:
        finite = ~np.isnan(signal[:, 0])
        for axis in signal.T:
            axis[:] = np.interp(t, t[finite], axis[finite]) if finite.any() else 0.0
    return filled


def force_terms(samples: UnitSamples, motion: Attitudes, *, mean_rate: bool) -> Terms:
    """Terms of a recording whose attitudes are known."""
    gyr, acc = interpolated(samples.gyr, samples.t), interpolated(samples.acc, samples.t)
    gyr = gyr - np.stack([_bias(motion, samples.t, u) for u in range(len(gyr))])
    q = motion.q
    if mean_rate:  # attitudes are half a step later than the rates and forces
        half = -0.5 * np.diff(samples.t, prepend=2.0 * samples.t[0] - samples.t[1])
        q = quat_multiply(q, quat_from_rotvec(gyr * half[:, np.newaxis]))
    return Terms(samples.t, dcm_from_quat(q), lever_matrices(samples.t, gyr), acc)


def _bias(motion: Attitudes, t: Floats, u: int) -> Floats:
    times = motion.t[motion.rows]
    return np.stack([np.interp(t, times, motion.bias[:, u, axis]) for axis in range(3)], axis=1)


def below(values: Floats, t: Floats, cut_off: float = CUT_OFF) -> tuple[Floats, int]:
    """Values (N, …) below a cut-off, Hz, thinned out, and of how many one is left."""
    from scipy.signal import butter, sosfiltfilt

    rate = 1.0 / float(np.median(np.diff(t)))
    if rate > 2.5 * cut_off and len(t) > 30:
        values = sosfiltfilt(butter(2, cut_off, fs=rate, output="sos"), values, axis=0)
    every = max(1, int(rate / (4.0 * cut_off)))
    return values[::every], every


def lasting(values: Floats, step: float) -> float:
    """How long values (N, M), one each `step`, s, stay alike: from how the variance of their means falls."""
    duration, variance = 0.5 * step, float(np.mean(np.var(values, axis=0)))
    for count in (3, 10, 30, 100):
        if len(values) < 5 * count or variance == 0.0:
            break
        means = values[: len(values) // count * count].reshape(-1, count, values.shape[1]).mean(axis=1)
        duration = max(duration, 0.5 * step * count * float(np.mean(np.var(means, axis=0))) / variance)
    return duration


def arms_from_sizes(samples: UnitSamples, link: JointLink) -> Floats:
    """Arms (2, 3) that make the forces of both sides equally large at the joint, which needs no attitude.

    Several beginnings are tried, as the forces have the same sizes for some wrong arms too.
    """
    from scipy.optimize import least_squares

    pair = [link.parent, link.child]
    gyr, acc = interpolated(samples.gyr[pair], samples.t), interpolated(samples.acc[pair], samples.t)
    every = max(1, len(samples) // 3000)
    lever = lever_matrices(samples.t, gyr)[:, ::every]
    force = acc[:, ::every]

    def off(x: Floats) -> Floats:
        ends = force + np.einsum("unij,uj->uni", lever, x.reshape(2, 3))
        sizes = np.linalg.norm(ends, axis=2)
        return np.asarray(sizes[0] - sizes[1])

    rng = np.random.default_rng(1)
    begins = [np.zeros(6), *rng.normal(0.0, 0.15, (_STARTS - 1, 6))]
    fits = [least_squares(off, begin, loss="soft_l1", f_scale=0.3) for begin in begins]
    best: Floats = min(fits, key=lambda fit: float(fit.cost)).x
    return best.reshape(2, 3)


def fit_arms(terms: Terms, link: JointLink, before: Floats, *, clocks: bool = False) -> GeometryFit:
    """Arms that give both sides of a joint one force; linear least squares that a few bad moments do not disturb.

    `before`: arms (2, 3), m, near which those stay that motion does not show; `clocks`: whether the child's clock may
    differ from the parent's; `clock` is by how much its stamps must grow. What the forces leave, over how fast they
    change, says how well that is known, of as many values as differ in `REPEATS`.
    """
    child = terms.matrix[link.child] @ terms.lever[link.child]
    ours = np.einsum("nij,nj->ni", terms.matrix[link.child], terms.force[link.child])
    if link.parent == GROUND:
        parent, theirs = np.zeros_like(child), np.broadcast_to([0.0, 0.0, G0], ours.shape)
    else:
        parent = -terms.matrix[link.parent] @ terms.lever[link.parent]
        theirs = np.einsum("nij,nj->ni", terms.matrix[link.parent], terms.force[link.parent])
    felt = ours + child @ link.arms[1]
    both, off = np.concatenate((parent, child, (felt @ skew(UP).T)[:, :, np.newaxis]), axis=2), theirs - ours
    if clocks:  # what was felt at t + c is felt at t: less by c times its change
        change = -np.gradient(felt, terms.t, axis=0)[:, :, np.newaxis]
        since = (terms.t - 0.5 * (terms.t[0] + terms.t[-1]))[:, np.newaxis, np.newaxis]
        both = np.concatenate((both, change, change * since), axis=2)
    a, every = below(both, terms.t)
    y, _ = below(off, terms.t)
    alike = max(1.0, 1.0 / float(np.median(np.diff(terms.t))) / every / (2.0 * CUT_OFF))
    fit, x = _solved(a.reshape(-1, a.shape[2]), y.ravel(), before, alike, LEAST_FORCE_SD)
    if clocks:
        rate = float(np.sqrt(np.mean(a[:, :, 7] ** 2)))
        offset_sd = fit.residual / max(rate, 1e-6) / float(np.sqrt(3.0 * 2.0 * CUT_OFF * REPEATS))
        fit = fit._replace(clock=(float(x[7]), float(x[8]), offset_sd))
    residual = off - both @ x
    count = max(1, round(MEAN_OVER / float(np.median(np.diff(terms.t)))))
    means = residual[: len(residual) // count * count].reshape(-1, count, 3).mean(axis=1)
    sides = 1.0 if link.parent == GROUND else 2.0
    return fit._replace(
        residual=max(float(np.sqrt(np.mean(means**2) / sides)), LEAST_FORCE_SD),
        lasts=lasting(means, MEAN_OVER),
        shake=float(np.sqrt(np.mean(residual**2))),
    )


def _solved(a: Floats, y: Floats, near: Floats, alike: float, least: float) -> tuple[GeometryFit, Floats]:
    """Least squares with a prior in which large residuals count less: the fit, and all its numbers."""
    before, weight, sd = np.zeros(a.shape[1]), np.ones(len(y)), 10.0 * least
    before[:6] = near.ravel()
    information = np.diag(np.array([*(ARM_SD,) * 6, HEADING_SD, *CLOCK_SD][: a.shape[1]]) ** -2.0)
    for _ in range(_ROUNDS):
        w = weight / (alike * sd**2)
        normal = (a * w[:, np.newaxis]).T @ a + information
        x = np.linalg.solve(normal, (a * w[:, np.newaxis]).T @ y + information @ before)
        off = np.abs(y - a @ x)
        sd = max(1.4826 * float(np.median(off)), least)
        weight = 1.0 / np.maximum(1.0, off / (LARGE * sd))
    cov = np.asarray(np.linalg.inv(normal))[:7, :7]
    return GeometryFit(np.asarray(x[:6]).reshape(2, 3), cov, sd, MEAN_OVER, float(x[6])), np.asarray(x)


def first_axes(terms: Terms, link: JointLink) -> Floats:
    """Axes (2, 1, 3) of a hinge of which nothing is known: what both sides have most in common."""
    mean = np.mean(np.swapaxes(_parent(terms, link), 1, 2) @ terms.matrix[link.child], axis=0)
    if link.joint.kind == "universal":
        return _crossed(np.swapaxes(_parent(terms, link), 1, 2) @ terms.matrix[link.child])
    u, _, vt = np.linalg.svd(mean)
    return np.stack((u[:, :1].T, vt[:1]))


def _crossed(turns: Floats) -> Floats:
    """Axes of a universal joint: the pair that stays at right angles, of relative rotation matrices (N, 3, 3)."""
    flat = turns.reshape(-1, 9)
    least = np.linalg.eigh(flat.T @ flat)[1][:, 0].reshape(3, 3)
    u, _, vt = np.linalg.svd(least)
    return np.stack((u[:, :1].T, vt[:1]))


def _parent(terms: Terms, link: JointLink) -> Floats:
    return np.broadcast_to(np.eye(3), terms.matrix[0].shape) if link.parent == GROUND else terms.matrix[link.parent]


def fit_axes(terms: Terms, link: JointLink) -> GeometryFit:
    """Axes of a hinge, a universal or a fixed joint; the search begins at the link's."""
    parent, child = _parent(terms, link), terms.matrix[link.child]
    every = max(1, len(terms.t) // 3000)
    parent, child = parent[::every], child[::every]
    step = float(np.median(np.diff(terms.t))) * every
    alike = max(1.0, 2.0 * link.play_time / step)
    if link.joint.kind == "fixed":
        return _fixed(parent, child, link, alike, step)
    before, value, heading = link.axes[:, 0], link.axes[:, 0], 0.0
    for _ in range(_ROUNDS):
        information = np.diag([*(_UNKNOWN_AXIS**-2.0,) * 6, HEADING_SD**-2.0])
        for side, v in enumerate(value):
            information[3 * side : 3 * side + 3, 3 * side : 3 * side + 3] += np.outer(v, v) / _LENGTH_SD**2
        turned = dcm_from_quat(quat_from_rotvec(heading * UP)) @ child
        ones, others = parent @ value[0], turned @ value[1]
        aside = others @ skew(UP).T
        if link.joint.kind == "universal":
            a = np.concatenate((
                np.einsum("nji,nj->ni", parent, others), np.einsum("nji,nj->ni", turned, ones),
                np.einsum("ni,ni->n", ones, aside)[:, np.newaxis],
            ), axis=1)  # fmt: skip
            off = -np.einsum("ni,ni->n", ones, others)
        else:
            a = np.concatenate((parent, -turned, -aside[:, :, np.newaxis]), axis=2).reshape(-1, 7)
            off = (others - ones).ravel()
        sd = max(float(np.sqrt(np.mean(off**2))), LEAST_PLAY)
        normal = a.T @ a / (alike * sd**2) + information
        change = np.append((before - value).ravel(), -heading)
        step_by = np.linalg.solve(normal, a.T @ off / (alike * sd**2) + information @ change)
        value, heading = value + step_by[:6].reshape(2, 3), heading + float(step_by[6])
        value = value / np.linalg.norm(value, axis=1, keepdims=True)
    # of a hinge, two of three components vary
    share = 3.0 / 2.0 if link.joint.kind == "hinge" else 1.0
    lasts = lasting(off.reshape(len(parent), -1), step)
    return GeometryFit(value[:, np.newaxis], np.linalg.inv(normal), sd * float(np.sqrt(share)), lasts, heading)


def _fixed(parent: Floats, child: Floats, link: JointLink, alike: float, step: float) -> GeometryFit:
    mean = np.mean(np.swapaxes(parent, 1, 2) @ child, axis=0)
    u, _, vt = np.linalg.svd(mean)
    turn = u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt
    off = parent @ turn - child
    sd = max(float(np.sqrt(np.mean(off**2))), LEAST_PLAY)
    axes = np.stack((link.axes[0], link.axes[0] @ turn))
    return GeometryFit(axes, np.eye(7) * sd**2 * alike / len(parent), sd, lasting(off.reshape(len(parent), -1), step))
