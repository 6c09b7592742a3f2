"""The trackball paper [Chen2013]: a drift model and a scalar Kalman filter of an MPU-3050, at rest and on a turntable.

The recorded tests go through the bytes of the rig ``trackball``; statistics over many seeds are simulated directly.
"""

from typing import Final

from plumbob.papers.outcome import Paper, PaperItem
from plumbob.papers.trackball import misprints, recorded, static, turntable
from plumbob.papers.trackball.page import page
from plumbob.papers.trackball.results import Found
from plumbob.papers.workspace import Work

__all__ = ["ITEMS", "run"]

SEEDS = {"short": 200, "white": 20, "long": 10, "table": 50}
"""How many runs the statistics are of: at rest, of white noise, of four hours, and on the turntable."""
_GAINS = [0.3 + 0.02 * k for k in range(33)]


def run(work: Work) -> Paper:
    """Run every test of the paper, and make its page."""
    names = (
        "parts that warm up", "static test", "soak", "rate table", "turntable", "ball", "many records at rest",
        "white noise", "four hours", "fits", "many turntables", "misprints",
    )  # fmt: skip
    begin = work.steps(len(names))
    seeds = {name: work.seeds(count) for name, count in SEEDS.items()}
    first = seeds["short"].start
    begin(names[0])
    parts = {part: misprints.warmed(part, first + 100 * k) for k, part in enumerate(misprints.PARTS)}
    begin(names[1])
    rest = recorded.rest(work)
    begin(names[2])
    soaked = recorded.soaked(work)
    begin(names[3])
    card = recorded.card(work)
    begin(names[4])
    turned = recorded.turntable_run(work, card)
    begin(names[5])
    lapped = recorded.lapped(work, card)
    begin(names[6])
    short = static.measure_short(seeds["short"])
    begin(names[7])
    white = static.measure_white(seeds["white"])
    begin(names[8])
    long = static.measure_long(seeds["long"])
    begin(names[9])
    negative = static.measure_fits(seeds["short"])
    begin(names[10])
    table = {scale: turntable.measure_turntable(seeds["table"], scale) for scale in turntable.SCALES}
    gain = turntable.best_gain(seeds["table"], _GAINS)
    begin(names[11])
    paper_run = Found(
        seeds=SEEDS,
        parts=parts,
        soaked=soaked,
        rest=rest,
        short=short,
        white=white,
        long=long,
        fit=static.fit(rest.before[:, 0]),
        negative=negative,
        turned=turned,
        table=table,
        gain=gain,
        lapped=lapped,
        printed=misprints.allan_of_white(first),
        matrix=misprints.one_number_for_a_matrix(first),
    )
    return Paper(report=page(paper_run, work.seed), outcomes=paper_run.outcomes())


ITEMS: Final = (
    PaperItem(
        where="§0",
        what="track of the ball on its sphere from a strapdown unit in it, which the paper names as its aim",
        by="[ball.track]; scenario ball; `src/plumbob/papers/trackball/recorded.py`",
    ),
    PaperItem(
        where="(1), (2)",
        what="static drift model: bias of a constant, a random part and temperature, and scale error of each axis",
        by="`src/plumbob/calibration/gyr/drift.py`; page, Misprints",
    ),
    PaperItem(
        where="(3)",
        what="temperature drift of 0.1 °/s/°C from 25 °C",
        by="[drift.k_t] [drift.raw.a] [drift.left.a] [drift.raw.b] [drift.left.b]; `run --drift chen2013`",
    ),
    PaperItem(
        where="§1",
        what="resolution of 131 LSB/(°/s); static nonlinearity of 0.2 %, for which B_x is set to 0",
        by="[drift.scale] [drift.gain]",
        reason="The nonlinearity itself is not simulated; what matters is the tolerance of the gain.",
    ),
    PaperItem(where="(4)", what="drift by acceleration of 0.1 °/s/g", by="[drift.k_a] [drift.metres]"),
    PaperItem(where="(5)", what="whole drift model", by="[drift.twice] [drift.gain]; `src/plumbob/door/rates.py`"),
    PaperItem(where="(6)", what="constant error J, taken off the samples", by="`run --rest 0s..100s`; page, part 2"),
    PaperItem(
        where="(7)-(12)",
        what="scalar Kalman filter with Φ = C = 1, kg(0) = P00 = 1",
        by="[filter.start] [filter.gain]; `src/plumbob/filters/channel_scalar.py`; `run --filter scalar`",
    ),
    PaperItem(
        where="§2",
        what="procedure at rest: 25 °C, level, 0.1 s, 1000 samples before and after, link to a computer",
        by="[rest.step] [rest.samples] [rest.temperature]; rig trackball",
    ),
    PaperItem(
        where="Fig 1, Fig 2",
        what="random sequence of x before and after the filter, clearly converged",
        by="[rest.before] [rest.after] [rest.variance.q3]; page, Figures 1 and 2",
    ),
    PaperItem(where="(13)", what="Allan variance", by="[allan.printed]; `src/plumbob/noise/factors.py`"),
    PaperItem(
        where="Fig 3",
        what="Allan deviation before and after at eight averaging times, smaller at each",
        by="[allan.ratio.0.1] [allan.ratio.1] [allan.ratio.50] [allan.scatter.50] [allan.freedom]; page, Figure 3",
    ),
    PaperItem(
        where="§2",
        what="list of noises (ARW, RRW, RRW, BI, QN, SN) with powers of τ from −2 to 2",
        by="page, Composition of the noise; `allan`",
    ),
    PaperItem(
        where="(14)",
        what="least squares of A_n, weights of the noises",
        by="[fit.condition] [fit.negative] [noise.white] [noise.flicker]",
    ),
    PaperItem(
        where="§3",
        what="procedure on the turntable: 0 to 10 r/min in 100 s, then constant for 100 s, 1000 points each, 25 °C",
        by="[turn.slope] [turn.rate] [turn.samples] [turn.axis]; scenario turntable",
    ),
    PaperItem(
        where="§3",
        what="data read from an SD card after the motion",
        by="session of a file of bytes, `record --from`; `src/plumbob/papers/workspace.py`",
    ),
    PaperItem(
        where="Fig 4",
        what="x at uniform acceleration, more accurate after compensation",
        by="[ramp.removed] [ramp.rms] [bytes.ramp]",
    ),
    PaperItem(
        where="Fig 5",
        what="x at uniform rate, more accurate after compensation",
        by="[hold.rms] [hold.late] [bytes.hold]",
    ),
    PaperItem(
        where="§4",
        what="claim: the filter reduces the random error and raises the accuracy",
        by="[allan.angle] [allan.long.600] [ramp.lag.q2] [ramp.angle] [bytes.heading]",
    ),
    PaperItem(
        where="§4",
        what="claim: small computation, a relief for a microcontroller",
        by="[filter.operations]",
    ),
)
"""In the order of the paper."""
