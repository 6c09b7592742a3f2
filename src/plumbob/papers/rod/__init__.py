"""Rod paper: an ADIS16355 on a rod that is moved by hand, compared with an AHRS500GA [Li2012]."""

from typing import Final

from plumbob.papers.outcome import Paper, PaperItem
from plumbob.papers.rod import comparison as compared
from plumbob.papers.rod import equations, methods, page, results
from plumbob.papers.workspace import Work

SEEDS = 24
"""Of the table of methods; the bar is on 95 % of them."""
TRIED = 3
"""Seeds under each disturbance."""

__all__ = ["ITEMS", "run"]


def run(work: Work) -> Paper:
    """Run the paper: one recording through bytes, and its methods over many seeds."""
    step = work.steps(2 + SEEDS + TRIED)
    step("rig, recording and estimates")
    experiment = compared.compared(work)
    seeds = work.seeds(SEEDS)
    table = methods.measure(seeds, progress=lambda _: step("methods over seeds"))
    limits = []
    for seed in seeds[:TRIED]:
        step("what the test leaves out")
        case = methods.case(seed)
        limits.append([methods.disturbed(case, what) for what in methods.DISTURBANCES])
    step("covariance and page")
    first = methods.case(seeds[0])
    forms = equations.forms(first)
    outcomes = [
        *results.chain(experiment),
        *equations.formulas(work.seed),
        *equations.misprinted(table),
        *equations.numerics(forms),
        *results.through_bytes(experiment),
        *results.over_seeds(table),
    ]
    return Paper(report=page.page(experiment, table, limits, forms, equations.grown(first)), outcomes=outcomes)


_BEYOND: Final = "It is electrical: the bytes that come out of it are emulated, and hardware is beyond this package."

ITEMS: Final = (
    PaperItem(
        where="§1.1, Fig 1a",
        what="ADIS16355: three rates, three specific forces and the temperature, calibrated, at 819.2 samples per "
        "second",
        by="[chain.sps], `plumbob emulate adis16355`, `src/plumbob/protocols/catalog/adis16355.toml`, "
        "`src/plumbob/simulation/presets/adis16355.toml`",
    ),
    PaperItem(
        where="§1.2, Fig 1b",
        what="hardware: Cortex-M3 that reads the sensor by SPI and keeps its data on an SD card",
        by="`plumbob record` of a session of kind `spi` or `file`, `src/plumbob/protocols/catalog/adis16355.toml`, "
        "`src/plumbob/protocols/rigs/rod.toml`",
    ),
    PaperItem(
        where="§1.2",
        what="levels and supplies: 0 to 5 V, SPI high from 2.0 V, MAX3232 from 3 to 5.5 V, +5 V and +12 V",
        reason=_BEYOND,
    ),
    PaperItem(
        where="§2.1, (1)–(3)",
        what="direction cosine matrices from Euler angles and from the quaternion, frames n and b; roll, pitch and "
        "heading from the quaternion",
        by="[misprint.matrices], [misprint.eq1], [misprint.eq2], [misprint.eq3], [misprint.conjugate], [eq.euler]",
    ),
    PaperItem(
        where="§2.2, (4)–(6), Fig 2",
        what="specific force at rest as the components of gravity in body axes",
        by="[eq.level]",
    ),
    PaperItem(
        where="(7), (8)",
        what="roll and pitch from the accelerometer at rest",
        by="[eq.level], [misprint.eq7], [accel.early], `plumbob run --filter tilt_compass`",
    ),
    PaperItem(
        where="§2.2",
        what="attitude by integration of the rates, with an error that grows",
        by="[gyro.largest], `plumbob run --filter integrate`",
    ),
    PaperItem(
        where="§2.3, Fig 3",
        what="fusion of accelerometer and gyroscope, without a magnetometer",
        by="[fused.kept], `plumbob run --filter ekf7`",
    ),
    PaperItem(
        where="§2.3",
        what="motion state by thresholds on specific force and rate, start at rest, switch of the sensors",
        by="[switch.jump], [switch.hard.jump], [switch.hard], [switch.narrow], `plumbob run --filter ekf7 --params "
        "hard_switch=on`",
    ),
    PaperItem(
        where="§2.4",
        what="state of quaternion and gyroscope drift",
        by="[jacobian.phi], `src/plumbob/filters/ekf7.py`, `src/plumbob/papers/rod/as_printed.py`",
    ),
    PaperItem(
        where="(9), (10)",
        what="rate less the drift, and the quaternion turned by it",
        by="[misprint.eq10], [misprint.half_angle], [misprint.normalisation]",
    ),
    PaperItem(
        where="§2.4 (1)",
        what="state matrix Φ, and the prediction of P that the list lacks",
        by="[jacobian.phi], [misprint.prediction.early], [misprint.prediction.late], [misprint.prediction.share]",
    ),
    PaperItem(
        where="§2.4 (2)–(6), (11)",
        what="gravity by the quaternion and its observation matrix H; gain, update of the state and of the "
        "covariance P",
        by="[jacobian.h], [misprint.eq11]; [fused.equations], `src/plumbob/papers/rod/as_printed.py`",
    ),
    PaperItem(
        where="§3.1",
        what="AHRS500GA as reference: 100 Hz, heading 0.2°, roll and pitch 0.03° rms; its packet: 26 bytes, "
        "angles, rates, specific force and field from the third byte on",
        by="[ref.heading], [ref.tilt], [chain.ahrs_rate], [chain.packet], [chain.first], "
        "`src/plumbob/simulation/presets/ahrs500ga.toml`, `src/plumbob/protocols/catalog/ahrs500ga.toml`",
    ),
    PaperItem(
        where="§3.1, Fig 4a",
        what="both devices on one clock by two RS232 lines, and all data to a PC",
        by="[chain.synchronous], `plumbob emulate rod`, `src/plumbob/protocols/rigs/rod.toml`",
    ),
    PaperItem(
        where="§3.2, Fig 4b",
        what="rod moved by hand, both devices mounted on it, the y axis of the reference along the x axis of the "
        "ADIS16355",
        by="[mapping], [exchange.20.15.roll], [exchange.20.15.pitch], `plumbob sim rod`",
    ),
    PaperItem(
        where="§3.3, Fig 5",
        what="flow of the data processing",
        by="[chain.step], `plumbob record`, `plumbob run`, `plumbob eval`",
    ),
    PaperItem(
        where="Fig 6, §3.3 (1)",
        what="roll and pitch over 600 s with enlargements: accelerometer alone is wrong by more than 5° once it "
        "vibrates",
        by="[accel.late], [accel.early], [chain.duration]",
    ),
    PaperItem(
        where="Fig 6, §3.3 (2)",
        what="fused roll and pitch within ±1° of the reference",
        by="[bytes.ahrs.roll], [bytes.ahrs.pitch], [fused.kept], [fused.worst], [fused.rms]",
    ),
    PaperItem(
        where="§3.3 (3)",
        what="drift of the attitude less by an order of magnitude than by the quaternion alone, as drift is "
        "corrected at rest",
        by="[drift.ratio], [bytes.bias]",
    ),
)
