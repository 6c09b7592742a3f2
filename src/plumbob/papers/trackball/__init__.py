"""The trackball paper [Chen2013]: a drift model and a scalar Kalman filter of an MPU-3050, at rest and on a turntable.

The recorded tests go through the bytes of the rig ``trackball``; statistics over many seeds are simulated directly.
"""

from plumbob.papers.outcome import Paper
from plumbob.papers.trackball import misprints, recorded, static, turntable
from plumbob.papers.trackball.found import Found
from plumbob.papers.trackball.items import ITEMS
from plumbob.papers.trackball.page import page
from plumbob.papers.work import Work

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
    turned = recorded.turned(work, card)
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
    found = Found(
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
    return Paper(report=page(found, work.seed), outcomes=found.outcomes())
