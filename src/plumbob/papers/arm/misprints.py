"""What the paper prints and means otherwise, each computed as it stands, beside its corrected form."""

import math
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from plumbob.arm.array.paper import Scheme, sets_of
from plumbob.core.check import Floats
from plumbob.core.units import dps, to_dps
from plumbob.filters.fuzzy_pi import E_END, I_END, SETS, U_END, conclusion, regulate
from plumbob.papers.arm.simulated import AXES, RATE, REST, STATED, TURN, Over, UnitErrors, arm
from plumbob.papers.arm.tables import PAPER, measured, recovery
from plumbob.papers.description import ARM
from plumbob.papers.outcome import Outcome, Part, PrintedForm
from plumbob.reporting.content import SERIES

if TYPE_CHECKING:
    from matplotlib.figure import FigureBase

_PI: Final = Scheme(set1="pi", sets=1)
_SUM: Final = Scheme(sum_table=True)


def mean(over: Over) -> float:
    """Mean of the standard deviations of the three angles, deg."""
    return float(over.std.mean())


def raw_mean_error(seed: int, amplitude_dps: float = 5.0) -> PrintedForm:
    """Rms error, deg/s, of the mean of raw signals and of half their difference, of a swing with this amplitude."""
    array, _ = arm(seed, turns=False)
    sets, t = sets_of(array), array.t
    swing = dps(amplitude_dps) * np.sin(2.0 * np.pi * 0.5 * t)
    plus, minus = sets.plus["gyr"][:, 2] + swing, -sets.minus["gyr"][:, 2] - swing
    both = 0.5 * (plus + minus) - swing, 0.5 * (plus - minus) - swing
    return PrintedForm(*(float(to_dps(np.sqrt(np.mean(e**2)))) for e in both))


def mamdani(error: float, integral: float, points: int = 3601) -> float:
    """Correction, deg/s, of the sum table by minimum and centre of area, instead of products and heights.

    Triangles of the output are cut at the strength of their rules, and the largest counts at each place.
    """
    u = np.linspace(-U_END, U_END, points)
    step_e, step_i, step_u = E_END / SETS, I_END / SETS, U_END / SETS
    e, i = np.clip(3.0 * error, -E_END, E_END), np.clip(integral, -I_END, I_END)
    grade = np.zeros(points)
    for a in range(-SETS, SETS + 1):
        for b in range(-SETS, SETS + 1):
            strength = min(1.0 - abs(e / step_e - a), 1.0 - abs(i / step_i - b))
            if strength > 0.0:
                centre = conclusion(a, b, step_u, U_END, step_u)
                grade = np.maximum(grade, np.minimum(strength, np.clip(1.0 - np.abs(u - centre) / step_u, 0.0, 1.0)))
    return float((grade * u).sum() / grade.sum())


class Inference(NamedTuple):
    """Two ways to read the same table of rules.

    `gain`, `gain_product`: of the error at zero, 1/s; `reach`: largest correction of Mamdani's, of ±9 deg/s;
    `apart`: largest difference of both, deg/s; `e`, `mamdani`, `product` (N,): error, deg, and both corrections
    without an integral, deg/s.
    """

    gain: float
    gain_product: float
    reach: float
    apart: float
    e: Floats
    mamdani: Floats
    product: Floats


def inference() -> Inference:
    """Both, over the universes of error and integral."""
    near = U_END / SETS
    e, i = np.linspace(-2.0, 2.0, 41), np.linspace(-I_END, I_END, 13)
    by_area = np.array([[mamdani(a, b, 901) for b in i] for a in e])
    by_height = np.array([[regulate(a, b, near, U_END, near) for b in i] for a in e])
    line = np.array([[mamdani(a, 0.0), regulate(a, 0.0, near, U_END, near)] for a in e])
    small = 0.01
    return Inference(
        gain=mamdani(small, 0.0) / small,
        gain_product=regulate(small, 0.0, near, U_END, near) / small,
        reach=float(np.abs(by_area).max()),
        apart=float(np.abs(by_area - by_height).max()),
        e=e,
        mamdani=line[:, 0],
        product=line[:, 1],
    )


def printed_forms(seeds: int, rest: dict[str, Over], turn: dict[str, Over]) -> dict[str, PrintedForm]:
    """Every printed form that is wrong, computed over seeds; `rest` and `turn` are the right ones."""
    schemes = {
        "deg": _SUM._replace(rule_units="deg as rad/s"),
        "rad": _SUM._replace(rule_units="rad as deg/s"),
        "down": Scheme(force_down=True),
        "steep": _PI._replace(kp=2.0 * math.pi * 15.0),
    }
    still = measured(False, seeds, ours=False, schemes=schemes)
    turned = measured(True, seeds, ours=False, schemes={"raw": Scheme(raw_mean=True)})
    quiet = measured(True, seeds, noise=STATED, ours=False, schemes={"right": _PI, "late": _PI._replace(late=True)})
    slow, quick = recovery(_SUM._replace(rule_units="rad as deg/s", ekf=False)), recovery(_SUM._replace(ekf=False))
    return {
        "raw.rate": raw_mean_error(1),
        "raw.yaw": PrintedForm(float(turned["raw"].rms[2]), float(turn["fuzzy"].rms[2])),
        "units.deg": PrintedForm(mean(still["deg"]), mean(rest["sum"])),
        "units.rad": PrintedForm(mean(still["rad"]), mean(rest["sum"])),
        "units.rad.recovery": PrintedForm(slow.time, quick.time),
        "late": PrintedForm(float(quiet["late"].rms[2]), float(quiet["right"].rms[2])),
        "sign": PrintedForm(float(still["down"].rms[0]), float(rest["fuzzy"].rms[0])),
        "gain": PrintedForm(mean(still["steep"]), mean(rest["pi"])),
    }


def part(seeds: int, seed: int, rest: dict[str, Over], turn: dict[str, Over]) -> Part:
    """Every printed form beside the right one, of which `rest` and `turn` are; and the stated noise; over seeds."""
    forms, read, over = printed_forms(seeds, rest, turn), inference(), stated(seeds)
    schemes = {"pi": _PI, "control": Scheme(set1="pi"), "fuzzy": Scheme()}
    iron = measured(True, seeds, noise=TURN._replace(iron=1.5), ours=False, schemes=schemes)  # ±1.5 µT in each unit
    right = {"gain": (read.gain, read.gain_product), "reach": (read.reach, U_END), "apart": (read.apart, 0.0)}
    outcomes = [
        *over,
        *(ARM.row(f"misprint.{key}", faithful=form.right, wrong=form.wrong) for key, form in forms.items()),
        *(ARM.row(f"inference.{key}", faithful=product, value=area) for key, (area, product) in right.items()),
        *of_gain(),
        *ARM.rows({f"once.{axis}": rest["ekf"].std[i] for i, axis in enumerate(AXES)}),  # before PI uses them again
        *ARM.rows({f"iron.{name}": float(iron[name].std[2]) for name in ("pi", "control")}),
        *combination(seed),
    ]
    rows = [(row.what, f"{row.paper:g}", f"{row.faithful:.2g}", row.reason or "") for row in over]

    def draw(canvas: "FigureBase") -> None:
        ax = canvas.subplots()
        ax.plot(read.e, read.product, color=SERIES[0], linewidth=1.2)
        ax.plot(read.e, read.mamdani, color=SERIES[1], linewidth=1.2, linestyle="--")

    report = ARM.part(
        "misprints",
        read=read,
        tables=[ARM.table("printed_forms_computed", forms=forms), ARM.table("table_1_with", rows)],
        figures=[ARM.figure("correction_by_the", draw)],
    )
    return report, outcomes


def of_gain() -> list[Outcome]:
    """Outcomes of K, its corner K / 2π, Hz, and the sampling interval."""
    human = 15.0
    share = 1.0 / (1.0 + 2.0 * math.pi * human / RATE)
    figures = {"gain.corner": 0.8 / (2.0 * math.pi), "gain.needed": 2.0 * math.pi * human, "gain.nyquist": 0.5 * RATE}
    return ARM.rows(figures, step=share)


def stated(seeds: int) -> list[Outcome]:
    """Outcomes of Table 1 with the noise that the paper states."""
    over = measured(False, seeds, noise=STATED, ours=True)
    made = []
    for name, printed in PAPER[False].items():
        value, best = mean(over[name]), mean(over["six"]) if name == "fuzzy" else None
        made.append(ARM.row(f"stated.{name}", faithful=value, best=best, value=float(np.mean(printed)) / value))
    return made


def combination(seed: int = 1) -> list[Outcome]:
    """Outcomes of y⁺ and y⁻ put together: common bias, noise, and the parity."""
    common = dps(0.3)
    array, _ = arm(seed, turns=True, noise=UnitErrors(REST.gyr, REST.acc, REST.mag, dps(0.05)))
    sets = sets_of(array)
    plus, raw = sets.plus["gyr"] + common, -sets.minus["gyr"] + common  # both read 0.3 °/s too much
    true = np.array([0.0, 0.0, dps(-3.0)])
    residual = 0.5 * (plus - raw).mean(axis=0) - true
    single = (plus.mean(axis=0) - true)[0]
    noise = 0.5 * (plus - raw).std(axis=0).mean() / plus.std(axis=0).mean()
    cosine = np.corrcoef((0.5 * (plus + raw))[:, 2], np.sin(array.t))[0, 1]
    figures = {"pair.bias": float(to_dps(np.abs(residual).max())), "pair.noise": float(noise)}
    return ARM.rows({**figures, "pair.parity": float(abs(cosine))}, single=to_dps(single))
