"""The rod paper [Li2012]: an ADIS16355 on a rod moved by hand, beside an AHRS500GA; each sensor alone, and both fused.

The paper's method is its filter of seven states with its hard switch at rest; ours are the same filter with a soft
switch, and the smoother. One run goes through the bytes of both devices, with a unit as it left the line; runs over
seeds are simulated without bytes: units drawn from the data sheet that warm up, and ideal ones, which have a bias at
turn-on alone.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Final

import numpy as np

import plumbob as pb
from plumbob.papers.studies import PlotCurve, Study, errors_deg, largest, rms

SEEDS: Final = 24
SHAKEN: Final = 400.0  # when the vibration begins, s
SETTLE: Final = 1.0
"""Time from the start that is not scored, s: one look of the accelerometer is 1° off by its own noise."""
BAUD: Final = 115200  # of the line
LIMIT: Final = 1.0  # largest error that the paper claims, °
STARTS: Final = 500  # samples at rest at the begin, of which a fixed bias is taken: 5 s, as long as the rod waits
TURN_ON: Final = 0.2
"""Standard deviation of the bias at turn-on of an ideal unit, °/s: assumed; the data sheet allows as much for 20 K."""
SESSION: Final = '\n[imu]\ndevice = "adis16355 #{seed}"\nframe = "NED"\n\n[reference]\nnorth = "true"\nunit = "ref"\n'
WARM_UP: Final = "15 K, 120 s"
Q_RB: Final = pb.rotations.quat_from_euler_zyx(np.array([0.5 * np.pi, 0.0, 0.0]))
"""From the body's axes to those of the AHRS500GA, whose y axis lies along the body's x axis."""
HARD: Final = {"hard_switch": True}
NARROW: Final = {**HARD, "rest_rate": "1.7 deg/s", "rest_force": "0.08 g"}
"""Thresholds just above the noise of the sensors at rest, for the hard switch; the paper gives none."""
METHODS: Final[Mapping[str, tuple[str, Mapping[str, Any]]]] = {
    "accel": ("tilt_compass", {}),
    "gyro": ("integrate", {}),
    "gyro_kept": ("integrate", {}),
    "hard": ("ekf7", HARD),
    "hard_reset": ("ekf7", {**HARD, "reset": True}),
    "narrow": ("ekf7", NARROW),
    "narrow_reset": ("ekf7", {**NARROW, "reset": True}),
    "ekf7": ("ekf7", {}),
    "mahony": ("mahony", {}),
    "vqf": ("vqf", {}),
    "mekf": ("mekf", {}),
    "mekf_card": ("mekf", {}),
    "smoother": ("smoother", {}),
}
"""What is compared: sensors alone, the paper's filter with its switches, and others."""
BOOM_GAIN, BOOM_SPEED = 4.0, float(pb.units.dps(10.0))
"""Of the control that levels a boom, 1/s, and the highest speed of its actuator, rad/s: assumed."""
RECORDED: Final = ("accel", "gyro_kept", "hard", "ekf7", "mekf", "smoother")


def by_rotation(q_nr: Any) -> Any:
    """Attitude of the body (N, 4) from that of the reference in its own axes."""
    return pb.rotations.quat_multiply(q_nr, Q_RB)


def simulate_rod(seed: int, unit: str, duration: float = 600.0) -> Any:
    """A run of a seed: a unit drawn from the data sheet that warms up, or an "ideal" one with a bias at turn-on."""
    how: dict[str, Any] = {"frame": "NED", "sensors": "adis16355", "seed": seed, "duration": duration}
    if unit == "drawn":
        return pb.simulate("rod", unit="random", warm_up=WARM_UP, **how)
    made: Any = pb.simulate("rod", unit="calibrated", **how)
    turn_on = pb.units.dps(TURN_ON * np.random.default_rng([seed, 2012]).standard_normal(3))
    return replace(made, imu=with_rates(made.imu, made.imu.gyr + turn_on))


def with_rates(imu: Any, gyr: Any) -> Any:
    """Samples with other rates (N, 3), rad/s."""
    return imu.corrected(meta=imu.meta, gyr=gyr)


def scores(t: Any, errors: Any) -> Any:
    """Of errors (N, 3) of yaw, pitch and roll, °: largest roll and pitch before and after the vibration begins.

    Then their mean squares, and the share of the samples at which both are within 1°; (7,).
    """
    e = np.abs(errors[t >= SETTLE][:, [2, 1]])
    late = t[t >= SETTLE] >= SHAKEN
    share = [(e <= LIMIT).all(axis=1).mean()]
    return np.concatenate((e[~late].max(axis=0), e[late].max(axis=0, initial=0.0), (e**2).mean(axis=0), share))


def jump(q_nb: Any, q_true: Any, rest: Any) -> float:
    """Largest change of the tilt error from one sample to the next about each begin and end of rest, °."""
    error = pb.rotations.quat_multiply(q_nb, pb.rotations.quat_conjugate(q_true))
    turned = np.linalg.norm(np.diff(pb.rotations.quat_rotate(error, np.array([0.0, 0.0, -1.0])), axis=0), axis=1)
    switches = np.flatnonzero(np.diff(rest.astype(int)))
    near = np.unique((switches[:, np.newaxis] + [-1, 0, 1]).ravel())
    return float(pb.units.to_deg(turned[near[(near >= 0) & (near < turned.size)]].max(initial=0.0)))


def over_seeds(study: Study, unit: str, count: int, duration: float) -> tuple[dict[str, Any], dict[str, float]]:
    """Scores (seeds, 7) of every method, and the largest jumps of the switches, °."""
    scored: dict[str, list[Any]] = {name: [] for name in METHODS}
    jumps = {"ekf7": 0.0, "hard": 0.0, "hard_reset": 0.0}
    for seed in study.seeds(count):
        made = simulate_rod(seed, unit, duration)
        started = with_rates(made.imu, made.imu.gyr - made.imu.gyr[:STARTS].mean(axis=0))
        tracks: dict[str, Any] = {}
        for name, (method, params) in METHODS.items():
            noise = made.noise if name in ("mekf_card", "smoother") else None
            imu = started if name == "gyro" else made.imu
            tracks[name] = pb.estimate(imu, method, params=params, noise=noise, frame="NED").track
            scored[name].append(scores(made.imu.t, errors_deg(tracks[name], made.truth)))
        rest = (tracks["ekf7"].flags & pb.flags.AT_REST) != 0
        jumps = {name: max(most, jump(tracks[name].q_nb, made.truth.q_nb, rest)) for name, most in jumps.items()}
    return {name: np.array(each) for name, each in scored.items()}, jumps


def worst(scored: Any) -> Any:
    """Largest error of roll and pitch of each seed, (seeds,), °."""
    return scored[:, :4].max(axis=1)


def share_within(scored: Any) -> float:
    """Share of the seeds whose largest error is within 1°, %."""
    return 100.0 * float(np.mean(worst(scored) <= LIMIT))


def seeds_part(study: Study, count: int, duration: float) -> None:
    """The paper's claims over many seeds: each sensor alone, both fused, and the switch at rest."""
    study.step()
    drawn, jumps = over_seeds(study, "drawn", count, duration)
    study.step()
    ideal, ideal_jumps = over_seeds(study, "ideal", count, duration)
    mean = {name: of.mean(axis=0) for name, of in drawn.items()}
    study.rows({
        "accel.early": mean["accel"][:2].max(),
        "accel.late": drawn["accel"][:, 2:4].max(axis=1).min(),
        "gyro.largest": worst(drawn["gyro"]).mean(),
        "gyro.kept": worst(drawn["gyro_kept"]).mean(),
        "fused.kept": (share_within(drawn["hard"]), share_within(drawn["smoother"])),
        "fused.causal": (None, share_within(drawn["mekf_card"])),
        **{f"fused.{name}": share_within(drawn[name]) for name in ("hard_reset", "narrow", "narrow_reset")},
        **{f"fused.{name}": (mean["hard"][i], mean["smoother"][i])
           for i, name in enumerate(("roll.early", "pitch.early", "roll.late", "pitch.late"))},
        "fused.worst": (worst(drawn["hard"]).max(), worst(drawn["smoother"]).max()),
        "fused.soft": (None, worst(drawn["ekf7"]).max()),
        "drift.ratio": tuple(np.median(worst(drawn["gyro"]) / worst(drawn[k])) for k in ("hard", "smoother")),
        "switch.jump": (jumps["hard"], jumps["ekf7"]),
        "ideal.kept": (share_within(ideal["hard"]), share_within(ideal["ekf7"])),
        "ideal.causal": (None, share_within(ideal["mekf_card"])),
        "ideal.worst": (worst(ideal["hard"]).max(), worst(ideal["smoother"]).max()),
        "ideal.rms": tuple(np.sqrt(ideal[name][:, 4:6].mean(axis=0).max()) for name in ("hard", "smoother")),
        "ideal.drift": tuple(np.median(worst(ideal["gyro"]) / worst(ideal[k])) for k in ("hard", "smoother")),
        "ideal.jump": (ideal_jumps["hard"], ideal_jumps["ekf7"]),
    }, seeds=count)  # fmt: skip
    for unit, scored in (("drawn", drawn), ("ideal", ideal)):
        cells = {name: [*of[:, :4].mean(axis=0), 100.0 * of[:, 6].mean(), worst(of).max(), share_within(of)]
                 for name, of in scored.items()}  # fmt: skip
        study.table(f"methods_{unit}", cells, seeds=count)
    places = [(worst(of), np.full(count, len(METHODS) - k)) for k, of in enumerate(drawn.values())]
    names = study.names("methods_drawn", seeds=count)
    labelled = zip(places, METHODS, strict=True)
    lines = [PlotCurve(x, y, dash="none", mark="|", label=names[name]) for (x, y), name in labelled]
    study.draw("largest_error_of", lines)


def level_boom(seed: int, duration: float) -> tuple[float, float]:
    """Roll of a boom on a chassis that rolls over ground, and of the same boom levelled by its own angle, rms, °.

    A drawn unit on the boom, zeroed for 5 s on a level floor, speaks 100 times a second. Each attitude becomes a speed
    of the actuator, which acts two samples later, 20 ms: against the angle, and against what the ground adds to the
    rate. It turns the boom by 10 °/s at most. The first 10 s are not counted.
    """
    how: dict[str, Any] = {"frame": "NED", "sensors": "adis16355", "unit": "random", "rate": 100.0}
    rest: Any = pb.simulate("static", seed=seed, duration=duration, **how)
    t, rng, dt, g = rest.imu.t, np.random.default_rng([seed, 4]), 0.01, pb.units.g(1.0)
    waves, phases = 2.0 * np.pi * rng.uniform(0.05, 0.5, 5), rng.uniform(0.0, 2.0 * np.pi, 5)
    ground = pb.units.deg(1.0) * np.sin(np.outer(t, waves) + phases).sum(axis=1)
    gyr, acc = rest.imu.gyr - rest.imu.gyr[:STARTS].mean(axis=0), rest.imu.acc - rest.imu.acc[:STARTS].mean(axis=0)
    live, turned, speeds, rolls = pb.Filter("mekf", frame="NED", noise=rest.noise), 0.0, [0.0, 0.0], [float(ground[0])]
    for k in range(1, len(t)):
        turned += dt * speeds[k - 1]
        rolls.append(float(ground[k]) + turned)
        rate = float(gyr[k, 0]) + (rolls[k] - rolls[k - 1]) / dt
        felt = acc[k] - g * np.array([0.0, np.sin(rolls[k]), np.cos(rolls[k])])
        live.update(pb.ImuSample(t_ns=round(1e9 * t[k]), gyr=[rate, *gyr[k, 1:]], acc=felt))
        roll = float(pb.rotations.euler_zyx_from_quat(live.q_nb)[2])
        speed = -BOOM_GAIN * roll - (rate - float(live.bias_b[0]) - speeds[k - 1])
        speeds.append(float(np.clip(speed, -BOOM_SPEED, BOOM_SPEED)))
    use = t >= 10.0
    return rms(pb.units.to_deg(ground[use])), rms(pb.units.to_deg(np.array(rolls)[use]))


def recorded_part(study: Study, duration: float, booms: int) -> None:
    """One run through bytes, compared as the paper compares, with an AHRS500GA, and as it could not, with the truth."""
    study.step()
    how: dict[str, Any] = {"unit": "random", "warm_up": WARM_UP, "mount_error": "0.2 deg", "duration": duration}
    taken = study.recorded("rod", "rod", session=SESSION.format(seed=study.seed), **how)
    study.rows({"live.same": study.live(taken)})
    recording = pb.read(taken.recording)
    runs = {name: pb.estimate(recording, METHODS[name][0], params=METHODS[name][1]) for name in RECORDED}
    tracks: dict[str, Any] = {name: run.track for name, run in runs.items()}
    truth: Any = pb.read(taken.truth).track
    ahrs: Any = runs["ekf7"].reference
    by_ahrs, soft = by_rotation(ahrs.q_nb), tracks["ekf7"]
    t, rest = soft.t - soft.t[0], (soft.flags & pb.flags.AT_REST) != 0
    use = t >= SETTLE
    against = {name: errors_deg(track, truth) for name, track in tracks.items()}
    differences = {name: errors_deg(track.q_nb, by_ahrs)[use] for name, track in tracks.items()}
    reference = errors_deg(by_ahrs, truth.q_nb)
    most = {name: largest(e[use]) for name, e in against.items()}
    apart = {name: largest(e) for name, e in differences.items()}
    late, bias = t > t[-1] - 100.0, pb.units.to_dps(truth.bias_b)
    drift = pb.units.to_dps(soft.bias_b) - bias
    tilt = reference[use][:, 1:]
    share = [100.0 * (rms(tilt) / rms(differences[name][:, 1:])) ** 2 for name in ("hard", "smoother")]
    study.rows({
        "chain.synchronous": 100.0 * np.isfinite(ahrs.q_nb).all(axis=1).mean(),
        **{f"bytes.{by}.{axis}": (of["hard"][i], of["smoother"][i])
           for by, of in (("ahrs", apart), ("truth", most)) for i, axis in ((2, "roll"), (1, "pitch"))},
        "bytes.accel": most["accel"][1:].max(),
        "bytes.gyro": most["gyro_kept"][1:].max(),
        "bytes.share.reference": tuple(share),
        "bytes.bias": (None, rms(drift[late])),
    }, was=rms(bias[late]), soft=apart["ekf7"][1:].max(), step=jump(tracks["hard"].q_nb, truth.q_nb, rest))  # fmt: skip
    levelled = np.array([level_boom(seed, min(duration, 60.0)) for seed in study.seeds(booms)])
    late = 1e3 * (np.median(np.diff(t)) + 10.0 * taken.capture.stat().st_size / len(t) / BAUD)
    study.rows({"boom.level": (None, levelled[:, 1].mean()), "boom.late": (None, late)}, ground=levelled[:, 0].mean())
    study.values.update(mean=100.0 * rest.mean(), seeds=SEEDS)
    parts = {"truth": against, "ahrs": {name: differences[name] for name in ("hard", "ekf7", "mekf", "smoother")}}
    named = {
        study.text(f"difference_{kind}", name=study.text(name)): e[-use.sum() :]
        for kind, each in parts.items()
        for name, e in each.items()
    } | {study.text("ahrs_truth"): reference[use]}
    rows = [[name, *largest(e)[[2, 1]], *rms(e, 0)[[2, 1]]] for name, e in named.items()]
    study.table("what_the_paper", rows)
    shown = [(tracks["accel"].q_nb, "soft"), (by_ahrs, "ink"), (tracks["hard"].q_nb, "blue")]
    shown += [(tracks["smoother"].q_nb, "green")]
    angles = [(pb.units.to_deg(pb.rotations.euler_zyx_from_quat(q_nb)), colour) for q_nb, colour in shown]
    windows = [(t >= begin) & (t <= end) for begin, end in ((0.0, 600.0), (380.0, 420.0), (405.5, 409.5))]
    for column, key in ((2, "figure_6"), (1, "figure_6_c")):
        study.draw(key, *([PlotCurve(t[w], angle[w, column], colour) for angle, colour in angles] for w in windows))

    def pair(e: Any) -> list[PlotCurve]:
        return [PlotCurve(t[-len(e) :], e[:, 2]), PlotCurve(t[-len(e) :], e[:, 1], "red")]

    study.draw("errors_against_the", *(pair(against[name]) for name in ("accel", "gyro_kept", "hard", "smoother")))
    study.draw("differences_to_the", pair(differences["hard"]), pair(reference))
    estimated, resting = pb.units.to_dps(soft.bias_b), PlotCurve(t, np.where(rest, -0.3, np.nan), "muted", width=3.0)
    panels = ([resting, PlotCurve(t, bias[:, i], "soft"), PlotCurve(t, estimated[:, i])] for i in range(3))
    study.draw("motion_state_and", *panels)


def measure(study: Study, *, seeds: int = SEEDS, duration: float = 600.0, booms: int = 8) -> None:
    """Measure every figure of the paper."""
    recorded_part(study, duration, booms)
    seeds_part(study, seeds, duration)
