"""Gyroscopes alone, turned over the edges of a box: their gain, and how far a swim of a fin then drifts.

Every unit is drawn from the data sheets of an ADXRS290 and an ADXRS453. Six quarter turns end within ±0.5° about each
axis (standard deviation); then the fin of [Ou2017] swims for 220 s from a known attitude, and the rates are integrated
with the card, and with one that a minute of rest has completed. The ADXRS453 gives its rate 4 ms later than the other
part, which no turn from rest to rest shows, and which a fin's swing makes a drift. The bar of the gain is what ±0.5°
over two turns by 90° make, 0.39 %, with a margin.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, Final

import numpy as np

import plumbob as pb
from benchmarks.harness.bar import Bar
from benchmarks.harness.section import Section
from plumbob.core.check import Floats
from plumbob.rotations import quat_conjugate, quat_multiply, rotvec_from_quat
from plumbob.simulation.presets import draw_module

PARTS: Final = "adxrs290+adxrs453"
LENGTH: Final = 220.0  # of the paper's record, s [Ou2017]
LOOKS: Final = 4  # instants of a swim that count, the last one its end
FINS: Final = ("fin, axes read at once, °", "fin, z 4 ms later, °", "fin, z 4 ms later, after a rest, °")


def measure_stops(seeds: Sequence[int], progress: Callable[[int], None] | None = None) -> Section:
    """Calibrate a unit for each seed, and let it swim; arguments as of `measure_table`."""
    gains, *turns = (np.concatenate(part) for part in zip(*map(_unit, seeds), strict=True))
    rms, _, ratio, _ = gained = _figures(100.0 * gains)
    fins = {name: _figures(np.degrees(part)) for name, part in zip(FINS, turns, strict=True)}
    if progress:
        progress(1 + len(FINS))
    bars = (
        Bar("gain by stops, rms, %", rms, 0.0, 0.5),
        Bar("gain by stops, predicted over error", ratio, 0.7, 1.4),
        *(Bar(f"{name.removesuffix(', °')}, within 1 sd, %", row[3], 60.0, 78.0) for name, row in fins.items()),
    )
    columns = ("error, rms", "predicted, rms", "predicted / error", "within 1 sd, %")
    return Section(
        f"Gyroscope alone, {len(seeds)} units, six turns by 90° ± 0.5°", columns, {"gain, %": gained} | fins, bars
    )


def _figures(pairs: Floats) -> tuple[float, ...]:
    """Of errors and their standard deviations (N, 2)."""
    error, predicted = np.sqrt(np.mean(pairs**2, axis=0)).tolist()
    return error, predicted, predicted / error, 100.0 * float(np.mean(np.abs(pairs[:, 0]) <= pairs[:, 1]))


def _unit(seed: int) -> tuple[Floats, ...]:
    """Errors and standard deviations: (3, 2) of the gains, (3 `LOOKS`, 2) of each swim's attitude in body axes, rad."""
    module = draw_module(PARTS, seed)
    assert module.gyr is not None
    how: dict[str, Any] = {"frame": "NED", "unit": "random", "seed": seed, "rate": 100.0}
    card = pb.calibrate(pb.simulate("stops", sensors=module, **how).imu, "gyro", method="stops").card
    assert card.gyr is not None and card.gyr.matrix_sd is not None
    lying = pb.simulate("static", sensors=module, duration=60.0, **how)
    rested = pb.calibrate(lying.imu, "gyro", method="rest", calibration=card).card
    off, swims = np.diag(card.gyr.matrix - np.linalg.inv(module.gyr.response)), []
    for latency, used in ((np.zeros(3), card), (module.gyr.latency, card), (module.gyr.latency, rested)):
        unit = replace(module, gyr=replace(module.gyr, latency=latency))
        swim = pb.simulate("fin", sensors=unit, duration=LENGTH, **how)
        integrated = pb.Filter("integrate", frame="NED", init=swim.truth.q_nb[0], calibration=used)
        track = integrated.process(swim.imu, covariance=True)
        at = np.arange(1, LOOKS + 1) * (len(track.t) - 1) // LOOKS
        assert track.cov_b is not None
        turn = rotvec_from_quat(quat_multiply(quat_conjugate(swim.truth.q_nb[at]), track.q_nb[at]))
        swims.append(np.column_stack((turn.ravel(), np.sqrt(np.einsum("nii->ni", track.cov_b[at])).ravel())))
    return np.column_stack((off, np.diag(card.gyr.matrix_sd))), *swims
