"""How well waves are known by a drawn unit on a hull: ``python -m benchmarks.waves [--seeds 20] [--seas …]``.

Each sea is Gaussian: sinusoids of random phases *and* amplitudes, apart by less than a burst can tell, of a spectrum
and a cos-2s spread that are known. What is measured is compared with the hull's true way in the same burst, by the same
spectra; and the band that is claimed with the sea's own Hm0, of which the burst is a sample, through the hull.

Chance gives a burst several peaks, and two may be the highest to a thousandth: the peak's period is compared with that
of the nearest true peak that is the highest to `UNDECIDED`, and *ties* counts where that is another one.
"""

import argparse
import math
import time
from dataclasses import dataclass

import numpy as np

import plumbob as pb
from plumbob.overview.report_entry import read_subject
from plumbob.quality.spectra import segment_length
from plumbob.quality.waves import WaveSettings, sea_state
from plumbob.reporting.overview import make_gatherer
from plumbob.simulation.motion import Sea, jonswap, oscillator
from plumbob.simulation.scenarios import Buoy

APART = 1.0 / 3600.0  # of the sinusoids, Hz
UNDECIDED = 0.04  # of a density: what the bar of Hm0, 2 %, leaves open
HULLS = {  # natural periods of way and tilt, s, and damping of the tilt: floats of .2, .9 and 3 m
    "small": (0.6, 1.0, 0.4), "medium": (1.3, 2.0, 0.3), "large": (2.4, 3.2, 0.25),
}  # fmt: skip
SEAS = {  # Hs, m, Tp, s, γ, direction the waves come from and spread, degrees; of each train of waves
    "wind sea": [(1.5, 6.0, 3.3, 240.0, 25.0)],
    "swell": [(2.0, 14.0, 5.0, 300.0, 12.0)],
    "bimodal": [(1.2, 13.0, 5.0, 290.0, 12.0), (0.9, 5.0, 2.0, 200.0, 28.0)],
    "storm": [(6.0, 11.0, 2.0, 270.0, 30.0)],
    "calm": [(0.2, 4.0, 3.3, 180.0, 30.0)],
    "low swell": [(0.2, 20.0, 5.0, 250.0, 12.0)],
}


@dataclass(frozen=True, kw_only=True)
class GaussianSea(Buoy):
    """A buoy in trains of waves."""

    trains: tuple[tuple[float, float, float, float, float], ...] = ()

    def sea(self, rng):
        """One drawn sea of all trains."""
        omegas, phasors, directions = [], [], []
        for train, (*_, come_from, spread) in zip(map(spectrum, self.trains), self.trains, strict=True):
            f, energy = train
            f = f + APART * rng.uniform(-0.5, 0.5, f.size)
            omegas.append(2.0 * np.pi * f)
            phasors.append(np.sqrt(energy) * (rng.standard_normal(f.size) + 1j * rng.standard_normal(f.size)))
            directions.append(np.radians(come_from + 180.0) + np.radians(spread) * rng.standard_normal(f.size))
        return Sea(*(np.concatenate(parts) for parts in (omegas, phasors, directions)))

    def of_hull(self, high: float) -> tuple[float, float]:
        """Hm0, m, and mean direction that waves come from, rad, of the hull's way in such seas, up to a frequency."""
        m0, mean = 0.0, 0.0j
        for train, (*_, come_from, spread) in zip(map(spectrum, self.trains), self.trains, strict=True):
            f, energy = train
            follows = np.abs(oscillator(2.0 * np.pi * f, period=self.way_period, damping=self.way_damping)) ** 2
            of_all = float(np.sum((energy * follows)[f <= high]))
            m0 += of_all
            mean += of_all * math.exp(-0.5 * math.radians(spread) ** 2) * np.exp(1j * math.radians(come_from))
        return 4.0 * math.sqrt(m0), float(np.angle(mean))


def spectrum(train):
    """Frequencies of a train of waves, Hz, and the energy of each, m²."""
    height, period, peakedness, *_ = train
    f = np.arange(0.5 / period, min(4.0 / period, 1.0), APART)
    density = jonswap(f, peak=1.0 / period, peakedness=peakedness)
    return f, density * (height / 4.0) ** 2 / np.sum(density)


def one(trains, hull, seed, *, sensors, unit, rate, duration):
    """Sea state that is measured, the true one, Hm0 and direction of the sea through the hull, and CPU time, s."""
    way, tilt, damping = HULLS[hull]
    plan = GaussianSea(trains=tuple(trains), way_period=way, tilt_period=tilt, tilt_damping=damping,
                       heading=float(np.random.default_rng(seed).uniform(-3.0, 3.0)))  # fmt: skip
    made = pb.simulate(plan, frame="NED", sensors=sensors, unit=unit, seed=seed, rate=rate, duration=duration)
    began = time.process_time()
    gatherer = make_gatherer(burst=duration, waves=WaveSettings())
    subject = read_subject(made.imu, gatherer, {}, graded=False)
    spent = time.process_time() - began
    measured = subject.gathered.bursts[0].waves
    axes = np.stack((made.truth.frame.east, made.truth.frame.north, made.truth.frame.up), axis=1)
    settings = WaveSettings(low=measured.low if math.isfinite(measured.low) else None)
    true = sea_state(made.imu.t, made.kinematics.acc_n @ axes, step=1.0 / rate, segment=segment_length(duration),
                     settings=settings, heading_sd=0.0)  # fmt: skip
    return measured, true, plan.of_hull(measured.high), spent


def off_peak(got, true) -> tuple[float, bool]:
    """By how many bins the peak is off, and whether the nearest true peak ties with a higher one."""
    measured, density = (np.nan_to_num(state.density) for state in (got, true))
    top, highest = int(measured.argmax()), int(density.argmax())
    inner = np.flatnonzero((density[1:-1] >= density[:-2]) & (density[1:-1] >= density[2:])) + 1
    peaks = inner[density[inner] >= (1.0 - UNDECIDED) * density[highest]]
    nearest = int(peaks[np.abs(peaks - top).argmin()])
    if nearest != highest:
        return float(top - nearest), True
    return (1.0 / got.tp - 1.0 / true.tp) / got.frequency[0], False


def main() -> None:
    """Print a row for each sea and hull."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--seas", default=",".join(SEAS))
    parser.add_argument("--hulls", default=",".join(HULLS))
    parser.add_argument("--sensors", default="icm20948")
    parser.add_argument("--unit", default="calibrated", choices=("calibrated", "random"))
    parser.add_argument("--rate", type=float, default=10.0)
    parser.add_argument("--duration", type=float, default=1200.0)
    args = parser.parse_args()
    print(f"{'sea':10} {'hull':7} {'Hm0 rms %':>9} {'Tm02 %':>7} {'Tp bins':>7} {'ties':>4} {'dir °':>6} "
          f"{'spread °':>8} {'in band %':>9} {'dir in 2σ %':>11} {'flags':>6} {'none':>4} {'CPU s':>6}")  # fmt: skip
    every = []
    for sea in args.seas.split(","):
        for hull in args.hulls.split(","):
            rows, flags, nothing, spent = [], 0, 0, 0.0
            for seed in range(args.seeds):
                how = {name: getattr(args, name) for name in ("sensors", "unit", "rate", "duration")}
                got, true, (own, mean), cpu = one(SEAS[sea], hull, seed, **how)
                spent += cpu
                flags += got.flag != 1
                if not math.isfinite(got.hm0):
                    nothing += 1
                    continue
                turn = math.degrees(math.remainder(got.direction - true.direction, 2.0 * math.pi))
                bins, tied = off_peak(got, true)
                off = abs(math.remainder(got.direction - mean, 2.0 * math.pi)) / max(got.direction_sd, 1e-9)
                rows.append((got.hm0 / true.hm0 - 1.0, got.tm02 / true.tm02 - 1.0, bins, turn,
                             math.degrees(got.spread - true.spread),
                             got.hm0_low <= own <= got.hm0_high, off < 2.0, tied))  # fmt: skip
            table = np.array(rows, dtype=float).reshape(-1, 8)
            every.append(table)
            print(row(sea, hull, table, flags, nothing, spent / args.seeds), flush=True)
    print(row("all", "", np.concatenate(every), 0, 0, 0.0))


def row(sea, hull, table, flags, nothing, spent) -> str:
    """A line of the table: rms of errors, shares in per cent."""
    if not len(table):
        return f"{sea:10} {hull:7} nothing above the noise, {nothing} of {nothing}"
    rms, share = np.sqrt(np.mean(table**2, axis=0)), 100.0 * np.mean(table, axis=0)
    return (f"{sea:10} {hull:7} {100 * rms[0]:9.2f} {100 * rms[1]:7.2f} {np.abs(table[:, 2]).max():7.2f} "
            f"{table[:, 7].sum():4.0f} {rms[3]:6.2f} {rms[4]:8.2f} {share[5]:9.0f} {share[6]:11.0f} "
            f"{flags:6d} {nothing:4d} {spent:6.2f}")  # fmt: skip


if __name__ == "__main__":
    main()
