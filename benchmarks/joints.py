"""How well the angles of a leg that walks are known: ``python -m benchmarks.joints [--seeds 5] [--chains knee leg]``.

Drawn units sit 15° and 2 cm off, rigidly or on soft tissue, on one clock or on clocks 30 ms and 40 ppm apart each; the
body stands upright to 1° in each angle, which the claims count. *rms* is the error behind the upright pose, whose own
error is the same at all times; *inside* counts the whole error. VQF stands beside it with what it cannot know itself:
the true mounts, one clock, and the best constant heading of each joint; *skin* is what soft tissue makes of
attitudes without any error.
"""

import argparse
import time
from dataclasses import replace

import numpy as np
from vqf import VQF

import plumbob as pb
from plumbob.data.array import ImuArray
from plumbob.rotations import dcm_from_quat, quat_conjugate, quat_multiply
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


def by_vqf(made, names):
    """Errors of the angles by VQF with the true mounts and the best heading of each joint, degrees."""
    attitudes = []
    for name in names:
        imu = made.array.units[name]
        gyr = np.array(imu.gyr - imu.gyr[: int(UPRIGHT[1] / 0.01)].mean(axis=0))
        attitudes.append(VQF(0.01).updateBatch(gyr, np.array(imu.acc))["quat6D"])
    return angle_errors(made, names, attitudes)


def on_skin(made, names):
    """Errors of the angles of perfect attitudes of the units: what soft tissue makes of them, degrees."""
    return angle_errors(made, names, [made.units[name].truth.q_nb for name in names])


def angle_errors(made, names, units):
    """Errors of the angles by attitudes of units with the true mounts and the best heading of each joint, degrees."""
    mounts = [made.mounts[name] for name in names]
    attitudes = [quat_multiply(q, quat_conjugate(np.array(m.q_bs))) for q, m in zip(units, mounts, strict=True)]
    errors = []
    for joint in (joint for joint in named_chain("leg").joints if joint.parent in names and joint.child in names):
        a, b = attitudes[names.index(joint.parent)], attitudes[names.index(joint.child)]
        truth = [made.bodies[part].q_nb for part in (joint.parent, joint.child)]
        off = dcm_from_quat(quat_multiply(a, quat_conjugate(truth[0]))), dcm_from_quat(
            quat_multiply(b, quat_conjugate(truth[1])))  # fmt: skip
        mean = [np.arctan2((m[:, 1, 0] - m[:, 0, 1]).mean(), (m[:, 0, 0] + m[:, 1, 1]).mean()) for m in off]
        turns = [np.array([np.cos(0.5 * angle), 0.0, 0.0, -np.sin(0.5 * angle)]) for angle in mean]
        relative = quat_multiply(quat_conjugate(quat_multiply(turns[0], a)), quat_multiply(turns[1], b))
        errors.append(joint.angles_of(relative) - joint.angles_of(quat_multiply(quat_conjugate(truth[0]), truth[1])))
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
    heads = ("rms", "worst", "claim", "inside", "VQF", "skin")
    print("       units  clocks  stamps  ", *(f"{head:>6}" for head in heads), " CPU s")
    for chain in args.chains:
        names = CHAINS[chain]
        how = {"hinge": "knee"} if chain == "knee" else {"chain": chain}
        for soft in (False, True):
            runs = [walk(seed, soft) for seed in range(1, args.seeds + 1)]
            peers, skin = ([rms(way(made, names)[500:]) for made in runs] for way in (by_vqf, on_skin))
            for clocks, stamps in ((False, "instant"), (False, "unknown"), (True, "instant"), (True, "unknown")):
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
                        f"{rms(peers):5.2f}° {rms(skin):5.2f}°  {np.mean(took):.1f}"
                        + (f"  ({refused} refused)" if refused else ""),
                        flush=True,
                    )


if __name__ == "__main__":
    main()
