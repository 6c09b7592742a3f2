"""The trackball paper [Chen2013]: a drift model and a scalar Kalman filter of an MPU-3050, at rest and on a turntable.

The recorded tests go through the bytes of the rig ``trackball``; statistics over many seeds are simulated directly.
"""

from plumbob.papers.outcome import Paper
from plumbob.papers.trackball import misprints, recorded, seeds
from plumbob.papers.trackball.page import Found, paper
from plumbob.papers.workspace import Work

SEEDS = {"short": 200, "white": 20, "long": 10, "table": 50}
"""How many runs the statistics are of: at rest, of white noise, of four hours, and on the turntable."""
_GAINS = [0.3 + 0.02 * k for k in range(33)]


def run(work: Work) -> Paper:
    """Run every test of the paper, and make its page."""
    begin = work.steps(12)
    runs = {name: work.seeds(count) for name, count in SEEDS.items()}
    first = runs["short"].start
    begin("parts that warm up")
    parts = {part: misprints.warmed(part, first + 100 * k) for k, part in enumerate(misprints.PARTS)}
    begin("static test")
    rest = recorded.rest(work)
    begin("soak")
    soaked = recorded.soaked(work)
    begin("rate table")
    card = recorded.card(work)
    begin("turntable")
    turned = recorded.turntable_run(work, card)
    begin("ball")
    lapped = recorded.lapped(work, card)
    begin("many records at rest")
    short = seeds.measure_short(runs["short"])
    begin("white noise")
    white = seeds.measure_white(runs["white"])
    begin("four hours")
    long = seeds.measure_long(runs["long"])
    begin("fits")
    negative = seeds.measure_fits(runs["short"])
    begin("many turntables")
    table = {scale: seeds.measure_turntable(runs["table"], scale) for scale in seeds.SCALES}
    gain = seeds.best_gain(runs["table"], _GAINS)
    begin("misprints")
    results = Found(
        seeds=SEEDS,
        parts=parts,
        soaked=soaked,
        rest=rest,
        short=short,
        white=white,
        long=long,
        fit=seeds.fit(rest.before[:, 0]),
        negative=negative,
        turned=turned,
        table=table,
        gain=gain,
        lapped=lapped,
        printed=misprints.allan_of_white(first),
        matrix=misprints.one_number_for_a_matrix(first),
    )
    return paper(results, work.seed)
