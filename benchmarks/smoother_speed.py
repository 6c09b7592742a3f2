"""Thread CPU time of the smoother, of its form without a lag and with one of 5 s, beside VQF, on real recordings.

Each recording at its own rate, and where that allows it in block means of 95 and 48 Hz; each the least of three turns
in one run. A set's figure is the mean of its recordings' ratios: to vqf.VQF without a lag, else to vqf.offlineVQF.

    PLUMBOB_DATA=… python -m benchmarks.smoother_speed [--sets "BROAD;phones"] [--most 4]
"""

import argparse
import time
from collections.abc import Callable
from itertools import islice

import numpy as np
import vqf

from benchmarks.accuracy import SETS, recordings
from plumbob import ImuData
from plumbob.filters.smoother import Smoother
from plumbob.fleet.experiments.trials import read_trial
from plumbob.fleet.experiments.variants import changed

RATES = None, 95.0, 48.0  # Hz; None is a recording's own
TURNS = 3


def least(run: Callable[[], object]) -> float:
    """The least CPU time of some turns, s."""
    times = list[float]()
    for _ in range(TURNS):
        begun = time.thread_time()
        run()
        times.append(time.thread_time() - begun)
    return min(times)


def ratios(imu: ImuData) -> tuple[float, float, float]:
    """No lag, a lag of 5 s, and the whole recording, each over its peer."""
    step = float(np.median(np.diff(imu.t)))
    triads = [np.nan_to_num(np.array(imu.usable(name))) for name in ("gyr", "acc", "mag")]
    causal = least(lambda: vqf.VQF(step).updateBatch(*triads))
    offline = least(lambda: vqf.offlineVQF(*triads, step))
    forms = {"lag": "0 s"}, {"lag": "5 s"}, {}
    ours = [least(lambda form=form: Smoother(frame="ENU", params=form).process(imu)) for form in forms]
    return ours[0] / causal, ours[1] / offline, ours[2] / offline


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sets", default=";".join(SETS), help="names of sets, with semicolons between")
    parser.add_argument("--most", type=int, default=4, help="recordings of each set")
    args = parser.parse_args()
    print(f"{'set':24s} {'rate':>8s} {'no lag / VQF':>14s} {'5 s / offlineVQF':>18s} {'smoother / offlineVQF':>22s}")
    for name in args.sets.split(";"):
        for rate in RATES:
            table = list[tuple[float, float, float]]()
            for recording in islice(recordings(name), args.most):
                imu, reference = read_trial(recording)
                own = 1.0 / float(np.median(np.diff(imu.t)))
                if "mag" not in imu.triads or (rate and own < 1.5 * rate):
                    continue
                table.append(ratios(changed(imu, reference, {"rate": f"{rate} Hz"}) if rate else imu))
            if table:
                lag0, lag5, whole = np.mean(table, axis=0)
                print(f"{name:24s} {rate or own:6.0f}Hz {lag0:14.0f} {lag5:18.1f} {whole:22.1f}", flush=True)


if __name__ == "__main__":
    main()
