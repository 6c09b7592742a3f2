"""Accuracy of the smoother, the filters and other libraries on real recordings: docs/accuracy.md and its picture.

The recordings are those under PLUMBOB_DATA (broad, foreign); the page says where they come from. Each part of the page
is measured by itself and kept in bench-out/accuracy.json, so that one of them can be measured again.

    python -m benchmarks.accuracy [--parts sets,variants,live,ablations,choice,draws,live_choice] [--draws 256]
"""

import argparse
import json
import os
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from plumbob.core import __version__
from plumbob.core.params import describe
from plumbob.core.text import counted
from plumbob.data.recording import Recording
from plumbob.files import read
from plumbob.filters.offline import Stage
from plumbob.filters.smoother.model import Params
from plumbob.fleet.experiments.peers import peer_runs
from plumbob.fleet.experiments.trials import KEYS, SHARES, Accuracy, measure_accuracy
from plumbob.reporting.content import Figure
from plumbob.reporting.report import Report

ROOT = Path(__file__).parents[1]
KEPT = ROOT / "bench-out" / "accuracy.json"
PAGE = ROOT / "docs" / "accuracy.md"
PICTURE = ROOT / "docs" / "images" / "accuracy.svg"

HEADING = ("heading",)
SETS: dict[str, tuple[str, tuple[str, ...]]] = {  # files under PLUMBOB_DATA, and what is aligned
    "BROAD": ("broad/[0-9]*.*", ()),
    "wand": ("foreign/tstick/*.parquet", HEADING),
    "phones, magnets near": ("foreign/phones/*_Dist_*.parquet", HEADING),
    "phones": ("foreign/phones/*_NoDist_*.parquet", HEADING),
    "chain, rigid": ("foreign/chain/*_rigid_*.parquet", HEADING),
    "chain, soft": ("foreign/chain/*_nonrigid_*.parquet", HEADING),
    "robot arm": ("foreign/robot_arm/*.parquet", HEADING),
    "logger": ("foreign/logger/*.parquet", HEADING),
    "coarse unit": ("foreign/coarse/*.parquet", HEADING),
    "quadrotor": ("foreign/drone/*.parquet", HEADING),
}
UNCALIBRATED = {"logger", "coarse unit"}  # by their makers' word or by the size of their errors
LATENCY = {"latency": "2.6 ms"}
EXTRA: dict[str, tuple[str, dict[str, str], dict[str, str]]] = {  # rows more: set, parameters, changes
    "BROAD, latency 2.6 ms": ("BROAD", LATENCY, {}),
    "BROAD, lag 5 s": ("BROAD", {"lag": "5 s"}, {}),
    "BROAD, lag 30 s": ("BROAD", {"lag": "30 s"}, {}),
    "wand, no magnetometer": ("wand", {}, {"no_mag": ""}),
    "phones, magnets near, no magnetometer": ("phones, magnets near", {}, {"no_mag": ""}),
    "phones, no magnetometer": ("phones", {}, {"no_mag": ""}),
    "chain, rigid, no magnetometer": ("chain, rigid", {}, {"no_mag": ""}),
    "chain, soft, no magnetometer": ("chain, soft", {}, {"no_mag": ""}),
}
ALL = {name: (name, dict[str, str](), dict[str, str]()) for name in SETS} | EXTRA
NONE: Mapping[str, Any] = {}
NO_LAG = {"lag": "0 s"}
CAUSAL = ("mekf", "vqf", "vqf.VQF")
NOTHING: dict[str, float | None] = dict.fromkeys(KEYS)
OURS = ("smoother", "mekf", "vqf")
PEERS = "vqf.VQF,vqf.offlineVQF,imufusion(readme),ahrs.Madgwick,ahrs.EKF"
QUICK = "vqf.VQF,vqf.offlineVQF"
RIVAL = "vqf.offlineVQF"
FACTORS, WORST, WORST_LIVE = (0.5, 2.0), 1.7, 2.5
VARIANTS: dict[str, tuple[dict[str, str], tuple[float, float] | None]] = {  # changes, time that is scored
    "as recorded": ({}, None),
    "begins 20 s into the motion": ({"start": "20s"}, None),
    "… its first 10 s": ({"start": "20s"}, (0.0, 10.0)),
    "five gaps of 0.5 s": ({"gaps": "5x0.5s"}, None),
    "five gaps of 1 s": ({"gaps": "5x1s"}, None),
    "five gaps of 3 s": ({"gaps": "5x3s"}, None),
    "field off by (15, −10, 20) µT, first 20 s": ({"wrong_field": "15,-10,20uT:0s-20s"}, None),
    "field off by (0, −25, 0) µT, first 20 s": ({"wrong_field": "0,-25,0uT:0s-20s"}, None),
    "+20 µT east, 60 s in motion": ({"wrong_field": "20,0,0uT:30s-90s@motion"}, None),
    "+10 µT east, 20 s in motion": ({"wrong_field": "10,0,0uT:30s-50s@motion"}, None),
    "hard iron of 3 µT on x": ({"hard_iron": "3,0,0uT"}, None),
    "rates 1 % too large": ({"scale": "1%"}, None),
    "rates 3 % too small": ({"scale": "-3%"}, None),
    "rates 8 % too large": ({"scale": "8%"}, None),
    "bias of 6 °/s on each axis": ({"bias": "6dps"}, None),
    "5 % of the rows without values": ({"missing": "5%"}, None),
    "asynchronous stamps": ({"asynchronous": ""}, None),
    "means at 47.6 Hz": ({"rate": "47.6Hz"}, None),
}
OFF: dict[str, dict[str, Any]] = {
    "without magnetometer": {"mag": False},
    "no accelerometer bias": {"acc_bias": 0.0},
    "no scale and misalignment of the gyroscope": {"gyr_scale": 0.0, "gyr_misalignment": 0.0},
    "no deflection of the field": {"mag_disturbance_sd": 0.0},
    "no white scale noise": {"gyr_nonlinearity": 0.0},
    "nothing is rest": {"rest_rate": "1e-6 rad/s"},
}
CHOICE, LIVE_CHOICE = 64, 12
"""Parameter sets among which one is chosen, with the whole recording and without a lag."""


@cache
def recordings(name: str) -> list[Recording]:
    """Recordings of a set, read once."""
    data = Path(os.environ["PLUMBOB_DATA"])
    return [read(path) for path in sorted(data.glob(SETS[name][0]))]


def measured(name: str, stages: Sequence[Stage], peers: str = "none", **settings: Any) -> Accuracy:
    """Estimators on a set, with the alignment that it needs."""
    align = settings.pop("align", SETS[name][1])
    if "no_mag" in (settings.get("changes") or {}) or any(stage.params.get("mag") is False for stage in stages):
        align = HEADING
    settings["calibrated"] = settings.get("calibrated", False) and name not in UNCALIBRATED
    found, absent = peer_runs(peers)
    return measure_accuracy(recordings(name), stages, peers=found, absent=absent, align=align, **settings)


def smoother(params: Mapping[str, Any]) -> Stage:
    return Stage("smoother", dict(params))


def totals(name: str, params: Mapping[str, Any]) -> list[float]:
    """Total error of the smoother on each recording of a set, degrees."""
    trials = measured(name, [smoother(params)], calibrated=True).trials
    return [errors["smoother"][KEYS[0]] for errors in trials.values()]


# --- parts ----------------------------------------------------------------------------------------------------


def sets() -> dict[str, Any]:
    """Every estimator on every set."""
    found = {}
    for row, (name, params, changes) in ALL.items():
        stages = [Stage(filter_, params if filter_ == "smoother" else {}) for filter_ in OURS]
        peers = QUICK if params else PEERS
        result = measured(name, stages, peers, changes=changes, calibrated=True, against="smoother")
        unknown = measured(name, stages[:1], changes=changes)
        claims = result.claims() | {"smoother, unknown calibration": unknown.claims()["smoother"]}
        found[row] = {
            "count": len(result.trials), "mean": result.mean(), "claims": claims, "better": result.better(),
            "trials": result.trials, "absent": result.absent, "skipped": result.skipped,
        }  # fmt: skip
        log(row, result)
    return found


def variants() -> dict[str, Any]:
    """The recordings of BROAD made harder."""
    found = {}
    for row, (changes, between) in VARIANTS.items():
        result = measured(
            "BROAD", [Stage(name, {}) for name in OURS], QUICK, changes=changes, between=between, calibrated=True
        )
        found[row] = outcome(result) | {"mean": result.mean()}
        log(row, result)
    return found


def live() -> dict[str, Any]:
    """The smoother without a lag, on every set and on the recordings made harder."""
    cases = [(row, name, {**params, **NO_LAG}, {"changes": changes})
             for row, (name, params, changes) in ALL.items() if "lag" not in params]  # fmt: skip
    cases += [(f"BROAD, {row}", "BROAD", NO_LAG, {"changes": changes, "between": between})
              for row, (changes, between) in VARIANTS.items() if changes]  # fmt: skip
    found = {}
    for row, name, params, settings in cases:
        result = measured(name, [smoother(params)], calibrated=True, **settings)
        found[row] = outcome(result) | {"mean": result.mean()["smoother"]}
        log(row, result)
    return found


def outcome(result: Accuracy) -> dict[str, Any]:
    """Worst total error of the smoother, and its claims."""
    worst = max(errors["smoother"][KEYS[0]] for errors in result.trials.values())
    return {"worst": worst, "claims": result.claims()["smoother"]}


def ablations() -> dict[str, Any]:
    """The smoother without a part of it, and with each parameter halved and doubled."""
    found: dict[str, Any] = {"as it is": {name: mean(totals(name, {})) for name in SETS}, "off": {}, "changed": {}}
    for row, params in OFF.items():
        found["off"][row] = {name: mean(totals(name, params)) for name in SETS}
        print(row, found["off"][row], flush=True)
    for name in numeric():
        value = getattr(Params(), name)
        each = [{of: mean(totals(of, {name: factor * value})) for of in SETS} for factor in FACTORS]
        found["changed"][name] = each
        print(name, each, flush=True)
    return found


def choice(count: int = CHOICE, fixed: Mapping[str, Any] = NONE) -> dict[str, Any]:
    """Totals of each recording of all sets with the first drawn parameters; `chosen` makes the table of them."""
    found: dict[str, Any] = {"sets": [{name: totals(name, fixed) for name in SETS}]}
    for params in drawn(count):
        found["sets"].append({name: totals(name, {**params, **fixed}) for name in SETS})
        print(len(found["sets"]), {name: round(mean(v), 3) for name, v in found["sets"][-1].items()}, flush=True)
    return found


def draws(count: int) -> dict[str, Any]:
    """Total on BROAD with all parameters changed at once."""
    found = []
    for params in drawn(count):
        found.append(mean(totals("BROAD", params)))
        print(len(found), round(found[-1], 3), flush=True)
    return {"totals": found}


def numeric() -> list[str]:
    """Parameters of the smoother that have a size."""
    usual = Params()
    return [p.name for p in describe(Params) if isinstance(v := getattr(usual, p.name), float) and v > 0.0]


def drawn(count: int) -> Iterator[dict[str, float]]:
    """Parameters times factors between a half and two, log-uniform."""
    rng = np.random.default_rng(1)
    usual, names = Params(), numeric()
    for _ in range(count):
        factors = np.exp2(rng.uniform(-1.0, 1.0, len(names)))
        yield {name: float(getattr(usual, name) * f) for name, f in zip(names, factors, strict=True)}


def mean(values: Sequence[float]) -> float:
    return float(np.mean(values))


def log(row: str, result: Accuracy) -> None:
    means = {name: tuple(None if v is None else round(v, 3) for v in e.values()) for name, e in result.mean().items()}
    print(row, means, result.skipped, result.absent, flush=True)


# --- page -----------------------------------------------------------------------------------------------------


def page(found: Mapping[str, Any]) -> str:
    """The page, of all parts."""
    parts = [head(), sets_text(found["sets"]), claims_text(found["sets"]), variants_text(found["variants"])]
    parts.append(live_text(found))
    parts += [ablations_text(found["ablations"]), f"## Chosen on one half, judged on the other\n{CHOSEN}"]
    parts += [
        choice_text(found["choice"]),
        f"Without a lag, of {LIVE_CHOICE} sets:\n",
        choice_text(found["live_choice"]),
    ]
    drawn_live = [mean(of["BROAD"]) for of in found["live_choice"]["sets"][1:]]
    parts += [draws_text(found["draws"]["totals"], WORST), draws_live_text(drawn_live), FOOT]
    return "\n".join(parts)


SOURCES = {
    "BROAD": (
        "15 of the 39 trials: a hand-held unit at 286 Hz, slow and fast, with and without magnetic disturbances, "
        "optical reference; nothing is aligned, and the samples in motion count",
        "Laidig et al. 2021, doi:10.3390/data6070072, CC BY 4.0",
    ),
    "wand": ("8 trials of a unit on a wand, 100 Hz, optical reference", "Szczęsna et al. 2016, RepoIMU T-stick"),
    "phones": (
        "34 recordings of a walking person with three phones, 100 Hz, 14 of them near magnets and iron, optical "
        "reference; most begin in motion",
        "Michel et al. 2017, hal-01376745, CeCILL 2.1",
    ),
    "chain": (
        "five segments of a mechanical chain, one unit rigidly and one softly mounted on each, 40 Hz, optical "
        "reference; the field of the room is bent by up to 40°",
        "supplement of RING, Bachhuber et al. 2024",
    ),
    "robot arm": ("6 recordings of two units on an arm, 125 Hz, no magnetometer, encoders as reference", "OpenAXES"),
    "logger": (
        "2 recordings of a hand-held logger over Bluetooth, uncalibrated, 125 Hz with gaps of .1 to .35 s, optical "
        "reference, which is itself off by 2 to 3°",
        "FIUMARGDB, public set of magnetic, angular rate and gravity data",
    ),
    "coarse unit": (
        "3 recordings of a 10-bit unit, uncalibrated, 1 °/s and .1 m/s² a count, scale off by up to 8 %, 100 Hz, no "
        "magnetometer, optical reference",
        "course data of ESE 650, University of Pennsylvania",
    ),
    "quadrotor": ("MH_01 of EuRoC, 200 Hz, no magnetometer", "Burri et al. 2016, doi:10.1177/0278364915620033"),
}


def head() -> str:
    rows = [[name, *told] for name, told in SOURCES.items()]
    return f"""# Accuracy on real recordings

Every figure on this page was measured by `make accuracy` (`python -m benchmarks.accuracy`) with version {__version__},
defaults, one set of parameters for all recordings. Errors are in degrees, root mean square over a recording, then
the mean over the recordings of a set; *total / inclination*.

The recordings are not in the repository. The command looks for them in the folder that `PLUMBOB_DATA` names:

{table(["set", "what", "from"], rows, number="---")}
The references of all sets but BROAD have a heading of arbitrary zero, so a constant heading is removed per recording
and estimator. Every sample of every estimator counts, also those that it flags as not converged, and from the first on.

**All of these recordings were at hand while the smoother was made**, and much of it was tried on them; the last
sections show how far its parameters are fitted to them. On recordings that nobody had used before, an earlier version
reached what stands here on other trials of BROAD, the wand and the arm, but on other people's phones 6.2° near magnets
and 4.2° without them, three and one and a half times what stands here: expect that of yours.

![Total error of each estimator on each set](images/accuracy.svg)
"""


FOOT = Path(__file__).with_name("accuracy_foot.md").read_text(encoding="utf-8")


def table(head: Sequence[str], rows: Sequence[Sequence[str]], number: str = "---:") -> str:
    lines = [f"| {' | '.join(head)} |", f"| --- |{f' {number} |' * (len(head) - 1)}"]
    return "\n".join([*lines, *(f"| {' | '.join(row)} |" for row in rows)]) + "\n"


def pair(errors: Mapping[str, float | None] | None, *, best: bool = False) -> str:
    """Total and inclination."""
    if not errors or errors[KEYS[0]] is None:
        return "–"
    text = f"{errors[KEYS[0]]:.2f} / {errors[KEYS[2]]:.2f}"
    return f"**{text}**" if best else text


def signed(value: float) -> str:
    return f"{value:+.2f}".replace("-", "−")


def estimators(rows: Mapping[str, Any]) -> list[str]:
    return list(dict.fromkeys(name for row in rows.values() for name in row["mean"]))


def compared(rows: Mapping[str, Any]) -> list[list[str]]:
    """Rows of estimators beside each other, the least total in bold."""
    names, cells = estimators(rows), []
    for row, found in rows.items():
        known = {n: e[KEYS[0]] for n, e in found["mean"].items() if e[KEYS[0]] is not None}
        least = min(known, key=known.__getitem__)
        cells.append([row, *(pair(found["mean"].get(name), best=name == least) for name in names)])
    return cells


def sets_text(rows: Mapping[str, Any]) -> str:
    names = [f"`{name}`" if name in OURS else name for name in estimators(rows)]
    paired = []
    for row, found in rows.items():
        trials = found["trials"].values()
        ours, theirs = ([t[name] for t in trials] for name in ("smoother", RIVAL))
        worst = max(a[KEYS[0]] - 1.5 * b[KEYS[0]] for a, b in zip(ours, theirs, strict=True))
        tilt = mean([a[KEYS[2]] - b[KEYS[2]] for a, b in zip(ours, theirs, strict=True)])
        lost, of = found["better"][RIVAL]
        change = mean([a[KEYS[0]] - b[KEYS[0]] for a, b in zip(ours, theirs, strict=True)])
        paired.append([row, signed(change), signed(tilt), f"{of - lost} of {of}", signed(worst)])
    return f"""## Estimators

`smoother` and vqf.offlineVQF know the whole recording, the others only what came before. imufusion is x-io Fusion with
the settings of its README. A dash: it cannot take these recordings.

{table(["", *names], compared(rows))}
The smoother less vqf.offlineVQF, recording by recording: mean differences, in how many the smoother is better, and the
largest of its total less 1.5 times the other's.

{table(["", "total", "inclination", "better in", "worst"], paired)}"""


def mean_and_worst(share: Sequence[float] | None) -> str:
    return "–" if share is None else f"{share[0]:.0%} ({share[1]:.0%})"


def claims_text(rows: Mapping[str, Any]) -> str:
    cells = []
    for row, found in rows.items():
        for name, shares in found["claims"].items():
            if name != "mekf" or row in SETS:
                cells.append([row, name, *map(mean_and_worst, shares.values())])
    return f"""## Claims

Share of the samples whose error lies within 1.96 standard deviations of the claimed covariance, 95 % where a claim is
right: of the heading, and of the tilt about two level axes; mean of the recordings, in brackets the worst one. In
motion is where the rate of a second exceeds 5 °/s. Where headings count from a free zero, what is claimed is how they
change from the first sample on.

Of a recording without a card Plumbob does not know the calibration, and adds what a data sheet allows an uncalibrated
part: the rows *unknown calibration*, which are too wide to tell anything. The others say that the units are calibrated
(`--calibrated`). The makers of the units of BROAD and the wand did that; of the phones, the chain and the arm nobody
says so. A softly mounted unit moves against the segment whose attitude the reference knows: most of its tilt error is
not the estimator's.

{table(["", "", *SHARES.values()], cells)}"""


def variants_text(rows: Mapping[str, Any]) -> str:
    names = [f"`{name}`" if name in OURS else name for name in estimators(rows)]
    shares = [
        [row, f"{found['worst']:.2f}", *("–" if s is None else f"{s[0]:.0%}" for s in found["claims"].values())]
        for row, found in rows.items()
    ]
    return f"""## Recordings made harder

The 15 trials of BROAD, each changed in the same way; what is drawn comes from seed 1. A dash: an estimator that cannot
take rows without values. vqf.VQF and vqf.offlineVQF take one time step for all samples, so that a gap is a jump to
them.

{table(["", *names], compared(rows))}
The smoother's worst recording, total, and its claims, as above:

{table(["", "worst", *SHARES.values()], shares)}"""


def live_text(found: Mapping[str, Any]) -> str:
    others = {row: of["mean"] for row, of in found["sets"].items()}
    others |= {f"BROAD, {row}": of["mean"] for row, of in found["variants"].items()}
    rows = {row: {"mean": {"`smoother`, no lag": of["mean"]} | {n: others[row].get(n) or NOTHING for n in CAUSAL}}
            for row, of in found["live"].items()}  # fmt: skip
    cells = compared(rows)
    for row in cells:
        both = (rows[row[0]]["mean"][name][KEYS[3]] for name in ("`smoother`, no lag", "mekf"))
        row += ["–" if value is None else f"{value:.2f}" for value in both]
    parts = found["live"].items()
    shares = [[row, f"{of['worst']:.2f}", *map(mean_and_worst, of["claims"].values())] for row, of in parts]
    return f"""## Without a lag

`lag = 0 s` (`plumbob run --lag 0s`): the smoother over the past two minutes, now and then, and a filter that goes on
from there on the same models; nothing that comes later is used, [to the bit](estimator.md#without-a-lag). Beside it
what else knows only what came before. Every sample counts; the last two columns are the totals of those alone that the
estimator does not flag as not converged: it does without a lag for the first 0.3 s, and as long as the tilt is known
worse than to 6° or the heading than to 20°.

{table(["", *estimators(rows), "converged: no lag", "converged: mekf"], cells)}
Its worst recording, total, and its claims, as above:

{table(["", "worst", *SHARES.values()], shares)}"""


CHOSEN = f"""
{CHOICE} sets of parameters, all at once times a factor between a half and two. The set that is best on every second
recording of all sets (mean of the ratios to the defaults) is judged on the others, and the other way round.
"""


def ablations_text(found: Mapping[str, Any]) -> str:
    names = list(SETS)
    off = [[row, *(f"{values[n]:.2f}" for n in names)] for row, values in found["off"].items()]
    usual = ["as it is", *(f"{found['as it is'][n]:.2f}" for n in names)]
    changed = [
        [f"`{name}`", *(f"{half[n]:.2f}, {double[n]:.2f}" for n in names)]
        for name, (half, double) in found["changed"].items()
    ]
    return f"""## What each part is worth

Total error of the smoother without a part of it:

{table(["", *names], [usual, *off])}
and with each parameter at half and at twice its value:

{table(["", *names], [usual, *changed])}"""


def choice_text(found: Mapping[str, Any]) -> str:
    rows = []
    for title, judged, asked in (("even", 1, 0), ("odd", 0, 1)):
        several = [{n: v for n, v in each.items() if len(v) > 1} for each in found["sets"]]
        halves = [{n: (mean(v[asked::2]), mean(v[judged::2])) for n, v in each.items()} for each in several]
        usual = halves[0]

        def score(each: Mapping[str, tuple[float, float]], base: Mapping[str, tuple[float, float]] = usual) -> float:
            return mean([each[n][0] / base[n][0] for n in base])

        best = min(halves[1:], key=score)
        for name in usual:
            hindsight = min(each[name][1] for each in halves)
            change = best[name][1] / usual[name][1] - 1.0
            values = (usual[name][1], best[name][1], hindsight)
            rows.append(
                [f"{name}, {title} recordings", *(f"{v:.2f}" for v in values), f"{change:+.0%}".replace("-", "−")]
            )
    return table(["", "defaults", "chosen on the other half", "best of all in hindsight", "chosen less defaults"], rows)


def draws_text(totals: Sequence[float], bar: float) -> str:
    return f"""## All parameters at once

{spread_text(totals, bar)}"""


def draws_live_text(totals: Sequence[float]) -> str:
    return f"Without a lag: {spread_text(totals, WORST_LIVE)}"


def spread_text(totals: Sequence[float], bar: float) -> str:
    values = np.array(totals)
    low, high = np.percentile(values, (5, 95))
    sets = counted(values.size, "set")
    return f"""{sets} of parameters, each times a factor between a half and two (log-uniform, seed 1), on BROAD:
mean total {values.mean():.2f}, 5 to 95 %: {low:.2f} to {high:.2f}, worst {values.max():.2f} (bar: {bar}).
"""


def draw_picture(rows: Mapping[str, Any]) -> None:
    """Total errors, a row for each set and a mark for each estimator."""
    from plumbob.reporting.content import INK, SERIES

    names = estimators(rows)
    colours = dict(zip(names, (*SERIES, INK), strict=True))

    def draw(figure: Any) -> None:
        axes = figure.subplots()
        for i, found in enumerate(rows.values()):
            for name in names:
                value = (found["mean"].get(name) or {}).get(KEYS[0])
                if value is not None:
                    axes.plot(value, -i, "o", color=colours[name], ms=4.5)
        axes.set_yticks([-i for i in range(len(rows))], list(rows))
        axes.set(xscale="log", xlim=(0.45, 130.0))
        axes.set_xticks([0.5, 1, 2, 5, 10, 20, 50, 100], ["0.5", "1", "2", "5", "10", "20", "50", "100"])
        axes.minorticks_off()
        axes.set_xlabel("total error [°]")

    key = [(name, colours[name], "solid") for name in names]
    report = Report("Accuracy", figures=[Figure("Total error of each estimator on each set", draw, key, height=3.2)])
    report.plot(PICTURE, overwrite=True)


def main() -> None:
    """Measure the parts that are asked for, and write the page."""
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("--parts", default="sets,variants,live,ablations,choice,draws,live_choice")
    p.add_argument("--draws", type=int, default=256)
    args = p.parse_args()
    parts: dict[str, Callable[[], dict[str, Any]]] = {
        "sets": sets, "variants": variants, "live": live, "ablations": ablations, "choice": choice,
        "draws": lambda: draws(args.draws), "live_choice": lambda: choice(LIVE_CHOICE, NO_LAG),
    }  # fmt: skip
    kept = json.loads(KEPT.read_text(encoding="utf-8")) if KEPT.exists() else {}
    for name in filter(None, args.parts.split(",")):
        begin = time.perf_counter()
        kept[name] = parts[name]()
        KEPT.parent.mkdir(exist_ok=True)
        KEPT.write_text(json.dumps(kept, indent=1), encoding="utf-8")
        print(f"{name}: {time.perf_counter() - begin:.0f} s", flush=True)
    if missing := parts.keys() - kept.keys():
        raise SystemExit(f"the page needs {', '.join(sorted(missing))} too: name them in --parts.")
    PAGE.write_text(page(kept), encoding="utf-8")
    draw_picture(kept["sets"])


if __name__ == "__main__":
    main()
