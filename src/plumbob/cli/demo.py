"""plumbob demo: the whole line on an emulated buoy, from sensor values to a page of errors."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from plumbob.cli import common

if TYPE_CHECKING:
    from plumbob.evaluate import Evaluation
    from plumbob.pipeline import Stage

SEED = 1
SENSORS = "mpu6000+hmc5983"
SETTLE = 120.0
"""Left out of the errors, s: what the calibration card cannot hold (sensitivity to g) is learned as a bias first."""


def add_parser(verbs: common.Adder) -> None:
    """Declare the verb."""
    p = verbs.add_parser(
        "demo",
        help="the whole line on an emulated buoy, ending in a page with plots",
        description="Emulate the drifting buoy of the paper in waves, calibrate and estimate with several filters, and "
        "compare with the truth.",
    )
    p.add_argument("--out", type=Path, default=Path("demo-out"), metavar="DIR", help="folder to write (demo-out)")
    common.add_json(p)
    p.set_defaults(run=run)


def stages() -> "list[Stage]":
    """Filters that are compared: a compass alone, the paper's filter, and the same with gains for waves."""
    from plumbob.pipeline import Stage

    return [
        Stage("tilt_compass", {}, "accelerometer and compass"),
        Stage("mahony", {"kp": 0.5, "ki": 0.03, "gate": None}, "paper, no gate"),
        Stage("mahony", {"kp": 0.5, "ki": 0.03, "gate": "0.08 g"}, "paper, gate 0.08 g"),
        Stage("mahony", {"kp": 0.1, "ki": 0.003, "gate": None, "quick_start": True}, "gains for waves"),
    ]


def run(args: argparse.Namespace) -> int:
    """Do it."""
    import time

    from plumbob import io, pipeline
    from plumbob.evaluate import evaluate, write_html
    from plumbob.rotations import Frame
    from plumbob.sim import simulate
    from plumbob.units import deg

    started = time.perf_counter()
    args.out.mkdir(parents=True, exist_ok=True)
    buoy = simulate("buoy", frame=Frame.NED, sensors=SENSORS, module="drawn", seed=SEED, declination=deg(-4.0))
    raw = io.write(
        args.out / "buoy.parquet", io.Recording(imu=buoy.imu, track=buoy.truth, name="buoy", notes=(buoy.truth.source,))
    )
    card = args.out / "card.json"
    buoy.calibration.save(card)
    _say(args, f"1 emulated   {raw}: {len(buoy.imu)} samples of an uncalibrated {SENSORS}, {buoy.imu.t[-1]:.0f} s")
    imu = pipeline.calibrated(io.read(raw).imu or buoy.imu, buoy.calibration)
    _say(args, f"2 calibrated with {card}")
    chosen = stages()
    common.warn_of_compiling([stage.filter for stage in chosen])
    results = {}
    with common.progress("estimating", len(chosen)) as advance:
        for stage in chosen:
            track = pipeline.estimate(imu, stage, frame=Frame.NED)
            io.write(args.out / f"{stage.name.replace(' ', '-').replace(',', '')}.parquet", track)
            results[stage.name] = evaluate(track, buoy.truth, settle=SETTLE)
            advance(1)
    _say(args, f"3 estimated  with {len(results)} filters, attitudes beside the recording")
    if not args.json:
        print(f"4 evaluated  after {SETTLE:.0f} s of settling, in {time.perf_counter() - started:.1f} s\n")
        print(_table(results))
    facts = {"scenario": buoy.truth.source, "sensors": imu.meta.device, "calibration": str(imu.meta.calibration)}
    page = write_html(
        args.out / "report.html", results, title="A buoy in waves, four ways to its attitude", facts=facts
    )
    if args.json:
        common.print_json({"report": str(page), "filters": {name: r.summary() for name, r in results.items()}})
        return 0
    print(f"\nreport       {page.resolve()}")
    return 0


def _say(args: argparse.Namespace, line: str) -> None:
    if not args.json:
        print(line)


def _table(results: "dict[str, Evaluation]") -> str:
    lines = [f"{'':28}{'rms error, degrees':^33}{'largest, degrees':^16}", ""]
    lines[1] = f"{'':28}" + "".join(f"{word:>11}" for word in ("roll", "pitch", "yaw")) + f"{'of the total':>16}"
    for name, result in results.items():
        s = result.summary()
        axes = "".join(f"{s[axis]['rmse_deg']:>10.2f}°" for axis in ("roll", "pitch", "yaw"))
        lines.append(f"{name:28}{axes}{s['total']['max_abs_deg']:>15.2f}°")
    return "\n".join(lines)
