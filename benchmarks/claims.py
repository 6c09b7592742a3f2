"""Does the claimed uncertainty know the calibration? Simulated units, each with a card of known covariance or none.

Each unit is drawn anew and calibrated with a card whose errors are drawn from the covariance that it states; the claim
is judged once per unit, at the end of its recording, so that the units are independent. Prints, for each case and
motion, the rms errors beside the claimed ones, the mean NEES (3 is expected) and the share inside its 95 % bounds with
the two-sided 95 % limits of a binomial count. Run: python -m benchmarks.claims [units]
"""

import sys
from dataclasses import replace

import numpy as np
from scipy.stats import binom

from plumbob import CalibrationCard, Filter, Frame, simulate
from plumbob.data.calibrated import apply_card
from plumbob.data.cards import TriadCalibration
from plumbob.evaluation.metrics import BOUNDS, nees
from plumbob.rotations import quat_conjugate, quat_multiply, rotvec_from_quat
from plumbob.rotations.frames import claimed_sd

SENSORS = "mpu6000+hmc5983"
CASES = {  # standard deviations of the parameters: offset of acc, m/s², and mag, µT; entries of both matrices
    "good card": (0.01, 0.1, 0.001),
    "poor card": (0.15, 1.5, 0.02),
    "uncalibrated": None,
}
MOTIONS = {"static": {"roll": "10 deg", "pitch": "-20 deg"}, "buoy": {}}


def flawed(model: TriadCalibration, offset_sd: float, matrix_sd: float, rng: np.random.Generator) -> TriadCalibration:
    """A perfect calibration with errors drawn from the covariance that it states."""
    sd = np.array([offset_sd] * 3 + [matrix_sd] * 9)
    error = sd * rng.standard_normal(12)
    return replace(
        model,
        bias=model.bias + error[:3],
        matrix=model.matrix + error[3:].reshape(3, 3),
        covariance=np.diag(sd * sd),
    )


def card_of(perfect: CalibrationCard, case: str, seed: int) -> CalibrationCard:
    """Card of a case: the gyroscope is perfect, the others are as the case says."""
    if CASES[case] is None:
        return perfect.without("acc", "mag")
    rng = np.random.default_rng((seed, list(CASES).index(case)))
    acc_sd, mag_sd, matrix_sd = CASES[case]
    acc, mag = flawed(perfect.acc, acc_sd, matrix_sd, rng), flawed(perfect.mag, mag_sd, matrix_sd, rng)
    return replace(perfect, acc=acc, mag=mag)


def judged(case: str, motion: str, seed: int, duration: float = 40.0) -> tuple[float, float, float, float, float]:
    """NEES at the end, inclination and heading error there, and what is claimed of both, rad."""
    run = simulate(
        motion, frame=Frame.ENU, sensors=SENSORS, unit="random", seed=seed, duration=duration, rate=50.0,
        **MOTIONS[motion],
    )  # fmt: skip
    imu = apply_card(card_of(run.calibration, case, seed), run.imu)
    f = Filter("mekf", frame=Frame.ENU, params={"mag_noise": "0.3 uT"})
    track = f.process(imu, covariance=True)
    q, cov, truth = track.q_nb[-1:], track.cov_b[-1:], run.truth.q_nb[-1:]
    error = rotvec_from_quat(quat_multiply(truth, quat_conjugate(q)))[0]
    tilt, heading = claimed_sd(q, cov)
    return float(nees(q, truth, cov)[0]), float(np.hypot(*error[:2])), abs(error[2]), float(tilt[0]), float(heading[0])


def limits(units: int) -> tuple[int, int]:
    """Counts inside the 95 % bounds between which a consistent filter stays in 95 % of the tries."""
    return int(binom.ppf(0.025, units, 0.95)), int(binom.ppf(0.975, units, 0.95))


def main() -> None:
    """Print the table."""
    units = int(sys.argv[1]) if len(sys.argv) > 1 else 40
    low, high = limits(units)
    print(f"{units} units each; a consistent claim has {low} to {high} inside")
    for motion in MOTIONS:
        for case in CASES:
            found = np.array([judged(case, motion, seed) for seed in range(units)])
            inside = int(((found[:, 0] >= BOUNDS[0]) & (found[:, 0] <= BOUNDS[1])).sum())
            tilt, heading, tilt_sd, heading_sd = np.degrees(np.sqrt(np.mean(found[:, 1:] ** 2, axis=0)))
            print(
                f"{motion:7} {case:13} inclination {tilt:7.3f}° claimed {tilt_sd:7.3f}°  heading {heading:7.3f}° "
                f"claimed {heading_sd:7.3f}°  NEES {found[:, 0].mean():8.2f}  inside {inside}/{units}"
            )


if __name__ == "__main__":
    main()
