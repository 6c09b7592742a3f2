"""Chains of units: the real one with its peers, simulated ones with truth, and a program that is taught.

``python -m benchmarks.arm [chain] [simulated] [teach] [--seeds N]`` prints tables and bars; `make arm` runs all.
The real chain lies under PLUMBOB_DATA and is left out, with a word, where that is absent.

Metrics, degrees: *C*, the relative attitude of neighbours, rms, mean over the joints; *B*, the attitude of each segment
after one heading constant for the whole chain; *A*, after a constant for each segment, which cannot see what is wrong.
"""

import argparse
import os
import sys
import tempfile
import time
from functools import cache
from pathlib import Path

import numpy as np

import plumbob
from benchmarks.harness.bar import Bar, bar_lines
from benchmarks.harness.section import Section
from plumbob.arm import align, run
from plumbob.core.units import deg, to_deg
from plumbob.data import ImuData
from plumbob.data.array import ImuArray
from plumbob.data.chain import Chain, Joint, Segment
from plumbob.rotations import quat_conjugate, quat_from_rotvec, quat_multiply, quat_rotate, rotvec_from_quat, wrap
from plumbob.simulation.bodies import simulate_chain

REAL = Chain(
    "five segments",
    tuple(Segment(f"s{k}", f"seg{k}") for k in range(1, 6)),
    (
        Joint("12", "s1", "s2", "ball", origin=None),
        Joint("23", "s2", "s3", "hinge", origin=None),
        Joint("34", "s3", "s4", "hinge", origin=None),
        Joint("45", "s4", "s5", "hinge", origin=None),
    ),
)
MAX = 1e9
CHI2_95 = 7.815  # of three degrees of freedom


# --- metrics ---------------------------------------------------------------------------------------------------------


def angle(q):
    return to_deg(2.0 * np.arcsin(np.clip(np.linalg.norm(q[:, 1:], axis=1), 0.0, 1.0)))


def relative(a, b):
    return quat_multiply(quat_conjugate(a), b)


def rms(x):
    return float(np.sqrt(np.nanmean(np.square(x))))


def about_up(a):
    turn = np.zeros((np.size(a), 4))
    turn[:, 0], turn[:, 3] = np.cos(0.5 * a), np.sin(0.5 * a)
    return turn


def metric_c(q, ref, rows=slice(None)):
    pairs = zip(q, q[1:], ref, ref[1:], strict=False)
    return np.mean([rms(angle(relative(relative(c, d), relative(a, b)))[rows]) for a, b, c, d in pairs])


def without_heading(errors):
    """Errors (M, 4) in the navigation frame with the one heading constant taken out that leaves least."""
    errors = errors[np.isfinite(errors[:, 0])]
    heading = 0.0
    for _ in range(20):
        turned = quat_multiply(about_up(-heading), errors)
        off = 2.0 * np.arctan2(turned[:, 3], turned[:, 0])
        heading += np.angle(np.mean(np.exp(1j * off)))
    return quat_multiply(about_up(-heading), errors)


def metric_b(q, ref, rows=slice(None)):
    errors = [quat_multiply(a, quat_conjugate(b))[rows] for a, b in zip(q, ref, strict=True)]
    count = [np.isfinite(e[:, 0]).sum() for e in errors]
    parts = np.split(without_heading(np.concatenate(errors)), np.cumsum(count)[:-1])
    return np.mean([rms(angle(e)) for e in parts])


def metric_a(q, ref, rows=slice(None)):
    errors = [quat_multiply(a, quat_conjugate(b))[rows] for a, b in zip(q, ref, strict=True)]
    return np.mean([rms(angle(without_heading(e))) for e in errors])


def all_metrics(q, ref, rows=slice(None)):
    return metric_a(q, ref, rows), metric_b(q, ref, rows), metric_c(q, ref, rows)


# --- the real chain --------------------------------------------------------------------------------------------------


def real_recording(kind, folder):
    files = {f"seg{k}": plumbob.read(folder / f"diodem_trial1_{kind}_seg{k}.parquet") for k in range(1, 6)}
    return ImuArray({name: one.imu for name, one in files.items()}), [one.track.q_nb for one in files.values()]


def without_mag(array):
    return ImuArray({n: ImuData(t=i.t, gyr=i.gyr, acc=i.acc, meta=i.meta) for n, i in array.units.items()})


def vqf_all(array, *, mag, offline):
    try:
        import vqf
    except ImportError:
        return None
    found = []
    for imu in array.units.values():
        step, args = float(np.median(np.diff(imu.t))), [np.array(imu.gyr), np.array(imu.acc)]
        args += [np.array(imu.mag)] if mag else []
        out = vqf.offlineVQF(*args, None, step) if offline and not mag else None
        if out is None:
            out = vqf.offlineVQF(*args, step) if offline else vqf.VQF(step).updateBatch(*args)
        found.append(out["quat9D" if mag else "quat6D"])
    return found


def qmt_c(array, ref, card, alignment):
    """C of qmt.headingCorrection on VQF 6D, of the hinges alone, given their axes."""
    try:
        import qmt
    except ImportError:
        return None
    tilts, errors = vqf_all(array, mag=False, offline=False), []
    gyr, t = [np.array(i.gyr) for i in array.units.values()], array.t
    settings = {"alignment": alignment}
    for link in card.links():
        if link.joint.kind != "hinge":
            continue
        one, other = link.axes[0, 0], link.axes[1, 0]
        across = np.cross(one, other)
        turn = quat_from_rotvec(
            across / max(np.linalg.norm(across), 1e-12) * np.arctan2(np.linalg.norm(across), one @ other)
        )
        a, b = link.parent, link.child
        turned = quat_multiply(tilts[b], turn)
        corrected = qmt.headingCorrection(
            gyr[a], quat_rotate(quat_conjugate(turn), gyr[b]), tilts[a], turned, t, one, {}, settings
        )[0]
        est = relative(tilts[a], quat_multiply(corrected, quat_conjugate(turn)))
        errors.append(rms(angle(relative(relative(ref[a], ref[b]), est))))
    return float(np.mean(errors))


def inside(found, ref):
    """Share of keyframes at which the relative attitude of neighbours is inside of the claimed 95 %."""
    shares, names = [], list(found.tracks)
    for k, joint in enumerate(found.chain.joints):
        est = relative(found.tracks[names[k]].q_nb, found.tracks[names[k + 1]].q_nb)[found.rows]
        true = relative(ref[k], ref[k + 1])[found.rows]
        known = np.isfinite(true[:, 0])
        off = rotvec_from_quat(quat_multiply(est[known], quat_conjugate(true[known])))  # parent axes
        cov = found.joint_cov[joint.name][known]
        shares.append(
            float(np.mean(np.einsum("ki,ki->k", off, np.linalg.solve(cov, off[..., None])[..., 0]) < CHI2_95))
        )
    return 100.0 * np.array(shares)


def heading_inside(found, ref):
    """Share of samples at which each segment's heading, after one constant, is inside of its claimed 95 %."""
    errors = [quat_multiply(found.tracks[n].q_nb, quat_conjugate(r)) for n, r in zip(found.tracks, ref, strict=True)]
    yaw = np.stack([2.0 * np.arctan2(e[:, 3], e[:, 0]) for e in errors])
    yaw = yaw - np.angle(np.nanmean(np.exp(1j * yaw)))
    yaw = (yaw + np.pi) % (2.0 * np.pi) - np.pi
    sds = []
    for track in found.tracks.values():
        up = quat_rotate(quat_conjugate(track.q_nb), np.array([0.0, 0.0, 1.0]))
        sds.append(np.sqrt(np.einsum("ni,nij,nj->n", up, track.cov_b, up)))
    known = np.isfinite(yaw)
    return 100.0 * float(np.mean(np.abs(yaw[known]) < 1.96 * np.stack(sds)[known]))


BARS = {  # causal, offline
    "rigid": {"C": (1.0, 0.80), "B": (1.2, 1.0)},
    "nonrigid": {"C": (2.5, 2.3), "B": (2.6, 2.3)},
}


def chain_sections(folder):
    for kind, title in (("rigid", "rigid mounting"), ("nonrigid", "soft mounting")):
        array, ref = real_recording(kind, folder)
        rows = peers(array, ref)
        started = time.perf_counter()
        card = align(REAL, array)
        aligned = time.perf_counter() - started
        for alignment in ("backward", "center"):
            if (c := qmt_c(array, ref, card, alignment)) is not None:
                rows[f"qmt.headingCorrection, 3 hinges, {alignment}"] = ("–", "–", c, "–")
        bars, bare = [], without_mag(array)
        for causal in (True, False):
            word = "causal" if causal else "offline"
            for samples, what in ((bare, ""), (array, ", fields")):
                found = run(card, samples, frame="ENU", causal=causal)
                q = [one.q_nb for one in found.tracks.values()]
                share = inside(found, ref)
                rows[f"plumbob {word}{what}"] = (*all_metrics(q, ref), f"{share.mean():.0f} ({share.min():.0f})")
                _, b, c = all_metrics(q, ref)
                if what:
                    bars.append(Bar(f"{kind} B with magnetometers, {word}", b, 0.0, BARS[kind]["B"][not causal]))
                    bars.append(Bar(f"{kind} C inside 95 %, {word}", float(share.mean()), 90.0, 100.0))
                    print(f"  heading of B inside its 95 %, {kind} {word}{what}: {heading_inside(found, ref):.0f} %")
                else:
                    bars.append(Bar(f"{kind} C, {word}", c, 0.0, BARS[kind]["C"][not causal]))
                    print(f"  heading of B inside its 95 %, {kind} {word}: {heading_inside(found, ref):.0f} %")
        first, after = align(REAL, array[: np.searchsorted(array.t, 15.0)]), array.t >= 15.0
        for causal in (True, False):
            found = run(first, bare, frame="ENU", causal=causal)
            q = [one.q_nb for one in found.tracks.values()]
            word = "causal" if causal else "offline"
            rows[f"plumbob {word}, aligned on the first 15 s"] = (*all_metrics(q, ref, after), "–")
            if kind == "rigid":
                bars.append(Bar(f"rigid C behind 15 s of alignment, {word}", metric_c(q, ref, after), 0.0, 1.4))
        print(card.table())
        print(f"  alignment took about {aligned:.1f} s for {array.t[-1]:.0f} s of five units")
        yield Section(f"five-segment chain, {title}", ("A °", "B °", "C °", "in 95 %"), rows, tuple(bars))


def peers(array, ref):
    rows, bare = {}, without_mag(array)
    for label, mag, offline in (("VQF 9D", True, False), ("VQF 6D", False, False), ("offlineVQF 9D", True, True),
                                ("offlineVQF 6D", False, True)):  # fmt: skip
        if (q := vqf_all(array, mag=mag, offline=offline)) is not None:
            rows[label] = (*all_metrics(q, ref), "–")
    for label, samples, options in (("mekf 9D", array, {"filter": "mekf"}), ("mekf 6D", bare, {"filter": "mekf"}),
                                    ("smoother 9D", array, {}), ("smoother 6D", bare, {})):  # fmt: skip
        q = [plumbob.estimate(one, frame="ENU", **options).track.q_nb for one in samples.units.values()]
        rows[label] = (*all_metrics(q, ref), "–")
    return rows


# --- simulated arms --------------------------------------------------------------------------------------------------

SENSORS = {"sensors": "mpu6000+hmc5983", "unit": "calibrated", "gyr_range": "1000 deg/s", "acc_range": "8 g",
           "frame": "ENU"}  # fmt: skip
INSTANT = {"mean_rate": False}  # the simulator samples instants


def still_until(sim):
    moved = np.flatnonzero(np.abs(sim.angles - sim.angles[0]).max(axis=1) > 1e-4)
    return float(sim.t[moved[0]]) if moved.size else float(sim.t[-1])


def aligned(chain, seed, **world):
    sim = simulate_chain(chain, "calibration", seed=seed, **SENSORS, **world)
    pose = 0.0, 0.9 * still_until(sim), held(sim, seed)
    return align(sim.chain, sim.array, poses=[pose], pose_sd=deg(HELD_DEG), params=INSTANT)


HELD_DEG = 0.5


def held(sim, seed):
    """Angles that somebody believes to hold at the first sample."""
    return (
        sim.angles[0] + deg(HELD_DEG) * np.random.default_rng([seed, 7]).standard_normal(sim.angles.shape[1])
    ).tolist()


def alone(sim):
    """Joint angles and hand of each unit's own nine-axis smoother, mounted as the chain says; for scale."""
    q = {sim.chain.segments[0].name: np.tile([1.0, 0.0, 0.0, 0.0], (len(sim.t), 1))}
    for one in sim.chain.segments:
        if one.unit:
            track = plumbob.estimate(sim.array.units[one.unit], frame="ENU").track
            q[one.name] = quat_multiply(track.q_nb, quat_conjugate(np.array(one.mount.q_bs)))
    angles = sim.chain.angles_of(q)
    hand, at = np.zeros((len(sim.t), 3)), sim.chain.segments[-1].name
    reach, by_child = np.array(sim.chain.hand_b), {joint.child: joint for joint in sim.chain.joints}
    while True:
        hand = hand + quat_rotate(q[at], reach)
        if at not in by_child:
            return angles, hand
        at, reach = by_child[at].parent, np.array(by_child[at].origin)


def scored(angles, hand, sim):
    off = to_deg(wrap(angles - sim.angles))
    return np.sqrt(np.mean(off**2, axis=0)), 100.0 * rms(np.linalg.norm(hand - sim.hand_n, axis=1)) / sim.chain.length


def one_arm(chain, program, seed, *, exact):
    """Figures of one seed, by causal: joints ° (K,), hand %, share within one sd %, and of each unit alone."""
    world = {"bend": "20 uT"} | ({} if exact else {"mount_angle": "5 deg", "mount_shift": "20 mm"})
    sim = simulate_chain(chain, program, seed=seed, duration="60 s", **SENSORS, **world)
    known, found = sim.chain if exact else card_of(chain, seed), {}
    for causal in (False, True):
        pose = sim.angles[0].tolist() if exact else held(sim, seed)
        sd = deg(0.01 if exact else HELD_DEG)
        est = run(known, sim.array, frame="ENU", causal=causal, pose=pose, pose_sd=sd, params=INSTANT)
        joints, hand = scored(est.joints.angles, est.joints.hand, sim)
        off = [np.abs(wrap(est.joints.angles - sim.angles)) < est.joints.sd]
        off.append(np.abs(est.joints.hand - sim.hand_n) < est.joints.hand_sd)
        found[causal] = joints, hand, 100.0 * np.mean(np.hstack(off))
    return found, scored(*alone(sim), sim)


@cache
def card_of(chain, seed):
    return aligned(chain, seed, bend="20 uT", mount_angle="5 deg", mount_shift="20 mm")


def simulated_sections(seeds):
    for chain in ("arm", "teach"):
        rows, bars = {}, []
        for exact, limit in ((False, 2.0), (True, 1.0)):
            for program in ("teach", "fast", "slow"):
                all_ = [one_arm(chain, program, seed, exact=exact) for seed in range(1, seeds + 1)]
                own = rms([one[1][0] for one in all_]), rms([one[1][1] for one in all_])
                for causal in (False, True):
                    joints, hand, covered = (np.array([one[0][causal][k] for one in all_]) for k in range(3))
                    word = f"{'exact' if exact else 'aligned'}, {program}, {'causal' if causal else 'offline'}"
                    rows[word] = rms(joints), joints.max(), rms(hand), hand.max(), covered.mean(), *own
                    bars.append(Bar(f"{chain}, {word}: joints ° rms", rms(joints), 0.0, limit))
                    bars.append(Bar(f"{chain}, {word}: hand % of the arm", rms(hand), 0.0, limit))
                    if not exact:
                        bars.append(Bar(f"{chain}, {word}: inside one sd, %", covered.mean(), 60.0, 78.0))
        yield Section(
            f"simulated '{chain}', 20 µT bent, {seeds} seeds; mounted up to 5° and 2 cm off and aligned, or exactly",
            ("joints °", "worst", "hand %", "worst ", "in 1 sd %", "alone °", "alone %"), rows, tuple(bars),
        )  # fmt: skip


# --- a program that is taught ----------------------------------------------------------------------------------------


def teach_section(seeds):
    from plumbob.arm import export, replay, taught, urdf_text

    rows, shares, used = {}, [], []
    for seed in range(1, seeds + 1):
        world = {"bend": "20 uT", "mount_angle": "5 deg", "mount_shift": "20 mm"}
        sim = simulate_chain("teach", "teach", seed=seed, duration="40 s", **SENSORS, **world)
        found = run(
            card_of("teach", seed), sim.array, frame="ENU", pose=held(sim, seed), pose_sd=deg(HELD_DEG), params=INSTANT
        )
        program = taught(found.joints, sim.chain, rate="100 Hz")
        with tempfile.TemporaryDirectory() as folder:
            model = Path(folder) / "arm.urdf"
            model.write_text(urdf_text(sim.chain))
            export(program, Path(folder) / "program.yaml")
            done = replay(program, model)
        error = done.against(sim.t, sim.hand_n)
        shares.append(100.0 * error.rms_share)
        used.append(100.0 * max(program.used(sim.chain).values()))
        rows[f"seed {seed}"] = (shares[-1], 100.0 * error.max_share, used[-1], f"{program.slowed:.3f}")
    bars = (
        Bar("hand of the taught program against the simulated truth, % of the arm", float(np.mean(shares)), 0.0, 1.0),
        Bar("limits used, %", max(used), 0.0, 100.0),
    )
    title = "teach-in: simulated units, aligned → angles → program → URDF → hand"
    return Section(title, ("hand %", "greatest %", "limits %", "slowed"), rows, bars)


def sections(parts, seeds):
    if "chain" in parts:
        folder = Path(os.environ.get("PLUMBOB_DATA", "")) / "foreign" / "chain"
        if folder.is_dir():
            yield from chain_sections(folder)
        else:
            print("the real chain is left out: PLUMBOB_DATA has no foreign/chain", file=sys.stderr)
    if "simulated" in parts:
        yield from simulated_sections(seeds)
    if "teach" in parts:
        yield teach_section(seeds)


def main():
    known = ("chain", "simulated", "teach")
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("parts", nargs="*", metavar="PART", help=", ".join(known))
    parser.add_argument("--seeds", type=int, default=10)
    args = parser.parse_args()
    missed = 0
    for section in sections(args.parts or known, args.seeds):
        print("\n".join([*section.lines(), "", *bar_lines(section.bars), ""]), flush=True)
        missed += sum(not bar.met for bar in section.bars)
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
