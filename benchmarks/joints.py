"""How well the angles of a leg that walks are known: ``python -m benchmarks.joints [--seeds 5] [--chains knee leg]``.

Drawn units sit 15° and 2 cm off, rigidly or on soft tissue, on one clock or on clocks 30 ms and 40 ppm apart each; the
body stands upright to 1° in each angle, which the claims count. *rms* is the error behind the upright pose, whose own
error is the same at all times; *inside* counts the whole error. Beside it, on one clock:

* *VQF* with what it cannot know itself: the true mounts, and the best constant heading of each joint;
* *qmt*, of a hinge: VQF, `jointAxisEstHingeOlsson` (signs of the axes from truth) and `headingCorrection`, less
  the best constant, as it needs some seconds of motion to begin;
* *OpenSense*, the way of its IMU placer and inverse kinematics in a few lines of ours: VQF with an ideal
  magnetometer, each unit registered to its segment by the upright pose, and the angles that fit both attitudes best;
* *skin*: what soft tissue makes of attitudes without any error.
"""

import argparse
import contextlib
import io
import time
from dataclasses import replace

import numpy as np
from vqf import VQF

import plumbob as pb
from plumbob.data.array import ImuArray
from plumbob.rotations import (
    dcm_from_quat,
    quat_conjugate,
    quat_from_dcm,
    quat_from_rotvec,
    quat_multiply,
    quat_rotate,
    wrap,
)
from plumbob.simulation.chains import named_chain

CHAINS = {"knee": ("thigh", "shank"), "hip": ("pelvis", "thigh"), "leg": ("pelvis", "thigh", "shank", "foot")}
UPRIGHT = (0.0, 1.8)


def walk(seed: int, soft: bool, rate: float = 100.0):
    """A simulated leg."""
    return pb.simulate_chain(
        "leg", "walk", frame="ENU", sensors="icm20948", unit="random", seed=seed, rate=rate, duration=60.0, soft=soft,
        gyr_range="2000 deg/s", acc_range="16 g", mount_angle="15 deg", mount_shift="2 cm",
    )  # fmt: skip


def sources(made, names, clocks: bool):
    """Units by name on clocks of their own, or on one."""
    units = {name: made.array.units[name] for name in names}
    if not clocks:
        return ImuArray(units)
    return {name: replace(imu, t=np.array(imu.t) * (1 + 40e-6 * k) + 0.03 * k)
            for k, (name, imu) in enumerate(units.items())}  # fmt: skip


def compared(made, estimate, chain: str):
    """Errors (N, K) of the angles, and claims, degrees."""
    joints = {joint.name: joint for joint in named_chain("leg").joints}
    places, first = {}, 0
    for name, joint in joints.items():
        places[name] = range(first, first + len(joint.axes))
        first += len(joint.axes)
    columns = [k for joint in estimate.chain.joints for k in places[joint.name[:-2]]]
    true = np.stack([np.interp(estimate.joints.t, made.t, made.angles[:, k]) for k in columns], axis=1)
    return np.degrees(estimate.joints.angles - true), np.degrees(estimate.joints.sd)


def attitudes(made, names, mag: bool = False):
    """Attitudes of units by VQF, less their bias when upright; with `mag`, of ideal magnetometers in an even field."""
    found = []
    for name in names:
        imu = made.array.units[name]
        signals = [imu.gyr - imu.gyr[: int(UPRIGHT[1] / 0.01)].mean(axis=0), np.array(imu.acc)]
        if mag:
            signals.append(quat_rotate(quat_conjugate(made.units[name].truth.q_nb), np.array([0.0, 20.0, -45.0])))
        found.append(VQF(0.01).updateBatch(*signals)["quat9D" if mag else "quat6D"])
    return found


def by_vqf(made, names):
    """Errors of the angles by VQF with the true mounts and the best heading of each joint, degrees."""
    return angle_errors(made, names, attitudes(made, names))


def on_skin(made, names):
    """Errors of the angles of perfect attitudes of the units: what soft tissue makes of them, degrees."""
    return angle_errors(made, names, [made.units[name].truth.q_nb for name in names])


def by_opensense(made, names):
    """Errors of the angles by attitudes that the upright pose registers to segments, degrees."""
    middle, bodies = int(50 * UPRIGHT[1]), []
    ahead = quat_rotate(made.bodies[names[0]].q_nb[middle], np.eye(3)[0]) * [1.0, 1.0, 0.0]
    ahead, up = ahead / np.linalg.norm(ahead), np.eye(3)[2]  # of the base, which a user gives by an axis of a unit
    upright = quat_from_dcm(np.stack([ahead, up, np.cross(ahead, up)], axis=1))
    for q in attitudes(made, names, mag=True):
        bodies.append(quat_multiply(q, quat_multiply(quat_conjugate(q[middle]), upright)))
    errors = np.hstack([joint.angles_of(quat_multiply(quat_conjugate(bodies[a]), bodies[b])) - true
                        for joint, a, b, true in joints_of(made, names)])  # fmt: skip
    return np.degrees(errors - errors[middle])


def by_qmt(made, names):
    """Errors of the angle of a hinge by qmt, degrees."""
    import qmt

    ((joint, _, _, true),) = joints_of(made, names)
    one, other = (made.array.units[name] for name in names)
    gyr = [np.array(imu.gyr - imu.gyr[: int(UPRIGHT[1] / 0.01)].mean(axis=0)) for imu in (one, other)]
    with contextlib.redirect_stdout(io.StringIO()):  # it prints each step
        axes = qmt.jointAxisEstHingeOlsson(np.array(one.acc), np.array(other.acc), *gyr)
    hinge, turned, rates = np.array(joint.axes[0]), [], []
    for name, q, rate, estimated in zip(names, attitudes(made, names), gyr, axes, strict=True):
        axis = np.ravel(estimated)
        axis = axis * np.sign(axis @ quat_rotate(quat_conjugate(np.array(made.mounts[name].q_bs)), hinge))
        across = np.cross(hinge, axis)
        angle = np.arctan2(np.linalg.norm(across), hinge @ axis)
        turn = quat_from_rotvec(across / np.linalg.norm(across) * angle)
        turned.append(quat_multiply(q, turn))  # of axes that share the hinge's
        rates.append(quat_rotate(quat_conjugate(turn), rate))
    corrected = qmt.headingCorrection(*rates, *turned, np.array(one.t), np.abs(hinge), {})[0]  # it refuses −z
    angles = joint.angles_of(quat_multiply(quat_conjugate(turned[0]), corrected))
    return np.degrees(wrap(angles - true - np.mean((angles - true)[500:])))


def joints_of(made, names):
    """Joints between segments that have units: the joint, both numbers, and true angles (N, K), rad."""
    for joint in named_chain("leg").joints:
        if joint.parent in names and joint.child in names:
            true = quat_multiply(quat_conjugate(made.bodies[joint.parent].q_nb), made.bodies[joint.child].q_nb)
            yield joint, names.index(joint.parent), names.index(joint.child), joint.angles_of(true)


def angle_errors(made, names, units):
    """Errors of the angles by attitudes of units with the true mounts and the best heading of each joint, degrees."""
    mounts = [made.mounts[name] for name in names]
    bodies = [quat_multiply(q, quat_conjugate(np.array(m.q_bs))) for q, m in zip(units, mounts, strict=True)]
    errors = []
    for joint, parent, child, true in joints_of(made, names):
        turned = []
        for q, name in ((bodies[parent], joint.parent), (bodies[child], joint.child)):
            off = dcm_from_quat(quat_multiply(q, quat_conjugate(made.bodies[name].q_nb)))
            mean = np.arctan2((off[:, 1, 0] - off[:, 0, 1]).mean(), (off[:, 0, 0] + off[:, 1, 1]).mean())
            turned.append(quat_multiply(np.array([np.cos(0.5 * mean), 0.0, 0.0, -np.sin(0.5 * mean)]), q))
        errors.append(joint.angles_of(quat_multiply(quat_conjugate(turned[0]), turned[1])) - true)
    return np.degrees(np.hstack(errors))


def rms(errors) -> float:
    """Root of the mean square."""
    return float(np.sqrt(np.mean(np.square(errors))))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--chains", nargs="*", default=list(CHAINS))
    args = parser.parse_args()
    heads = ("rms", "worst", "claim", "inside", "VQF", "qmt", "OpenSense", "skin")
    print("       units  clocks  stamps  ", *(f"{head:>6}" for head in heads), " CPU s")
    for chain in args.chains:
        names = CHAINS[chain]
        how = {"hinge": "knee"} if chain == "knee" else {"chain": chain}
        for soft in (False, True):
            runs = [walk(seed, soft) for seed in range(1, args.seeds + 1)]
            ways = (by_vqf, by_qmt if chain == "knee" else None, by_opensense, on_skin)
            peers = [rms([rms(way(made, names)[500:]) for made in runs]) if way else np.nan for way in ways]
            for clocks, stamps in ((False, "instant"), (True, "unknown")):
                errors, claims, inside, took, refused = [], [], [], [], 0
                for made in runs:
                    begun = time.process_time()
                    try:
                        estimate = pb.joints(sources(made, names, clocks), upright=UPRIGHT, stamps=stamps, **how)
                    except pb.PlumbobError as error:
                        refused += 1
                        print(f"  refused: {error}")
                        continue
                    took.append(time.process_time() - begun)
                    error, sd = compared(made, estimate, chain)
                    rows = estimate.joints.t < UPRIGHT[1]
                    errors.append(rms(error - error[rows].mean(axis=0)))
                    claims.append(rms(sd))
                    inside.append(100.0 * np.mean(np.abs(error) < sd))
                if errors:
                    print(
                        f"{chain:6} {'soft' if soft else 'rigid':6} {'own' if clocks else 'one':7} {stamps:8} "
                        f"{rms(errors):5.2f}° {max(errors):5.2f}° {rms(claims):5.2f}° {np.mean(inside):5.0f} % "
                        f"{' '.join(f'{peer:5.2f}°' for peer in peers)}  {np.mean(took):.1f}"
                        + (f"  ({refused} refused)" if refused else ""),
                        flush=True,
                    )


if __name__ == "__main__":
    main()
