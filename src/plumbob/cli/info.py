"""plumbob info: what a file holds."""

import argparse
from pathlib import Path
from typing import Any

from plumbob.cli import common
from plumbob.core.text import counted, visible


def add_parser(verbs: common.Adder) -> None:
    """Declare the verb."""
    p = verbs.add_parser(
        "info",
        help="show what a recording, track or card holds: time, units, frames, flags; calibration; noise",
        description="Show what a recording or track holds: time line, ranges with units, frame, calibration and flags; "
        "of a calibration card its certificate, of a noise card its coefficients.",
        epilog=common.more("plumbob info sea.mcap", "recordings.md"),
    )
    p.add_argument("file", type=Path)
    common.add_profile(p)
    common.add_json(p)
    p.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Do it."""
    if args.file.suffix.lower() == ".json":
        return _card(args)
    recording = common.read(args.file, args.profile)
    report: dict[str, Any] = {"file": str(args.file), "notes": list(recording.notes)}
    if recording.imu is not None:
        report["sensors"] = _sensors(recording.imu)
    if recording.track is not None:
        report["attitude"] = _attitude(recording.track)
    common.print_json(report) if args.json else _print(report)
    return 0


def _card(args: argparse.Namespace) -> int:
    """Print what a card holds."""
    import json

    from plumbob.data.cards import CalibrationCard, open_card

    card = open_card(args.file)
    if isinstance(card, CalibrationCard):
        from plumbob.calibration.report import certificate, numbers

        told, report = numbers(card, {}), certificate(card, {})
    else:
        from plumbob.noise.card import card_report

        told, report = {"card": json.loads(card.text())}, card_report(card)
    common.print_json({"file": str(args.file)} | told) if args.json else print(report.text())
    return 0


def _sensors(imu: Any) -> dict[str, Any]:

    from plumbob.core import flags
    from plumbob.core.units import to_deg

    meta = imu.meta
    return {
        "device": meta.device,
        "calibration": meta.calibration,
        "frame": str(meta.frame) if meta.frame else None,
        "axes": meta.axes,
        "declination_deg": None if meta.declination is None else to_deg(meta.declination),
        "time": _timing(imu.t),
        "triads": {name: _triad(imu, name) for name in imu.triads},
        "flags": flags.counts(imu.flags),
    }


def _triad(imu: Any, name: str) -> dict[str, Any]:
    import numpy as np

    from plumbob.data.cards import UNITS

    values = imu.usable(name)
    values = values[np.isfinite(values).all(axis=1)]
    full_scale = getattr(imu.meta, f"{name}_range")
    return {
        "unit": UNITS[name],
        "samples": len(values),
        "range": full_scale,
        "mean": values.mean(axis=0).tolist() if len(values) else None,
        "std": values.std(axis=0).tolist() if len(values) else None,
        "norm_median": float(np.median(np.linalg.norm(values, axis=1))) if len(values) else None,
    }


def _attitude(track: Any) -> dict[str, Any]:
    return {
        "source": track.source,
        "frame": str(track.frame),
        "north": str(track.north),
        "time": _timing(track.t),
        "known_samples": int(track.known.sum()),
        "scored_samples": int(track.score.sum()) if track.score is not None else None,
    }


def _timing(t: Any) -> dict[str, Any]:
    import math

    from plumbob.core import time

    timing = time.timing(t)
    return {
        "samples": timing.samples,
        "duration_s": timing.duration,
        "rate_hz": timing.rate if math.isfinite(timing.rate) else None,
        "jitter_us": timing.jitter * 1e6,
        "gaps": timing.gaps,
        "longest_step_s": timing.longest,
    }


def _print(report: dict[str, Any]) -> None:
    from plumbob.data import calibration_told
    from plumbob.files import found_in
    from plumbob.rotations.headings import zero_of

    print(report["file"])
    told = found_in(report["notes"])  # on standard error already
    for line in dict.fromkeys(note for note in report["notes"] if note not in told):
        print(f"{'note':12} {visible(line)}")
    if sensors := report.get("sensors"):
        print(f"device       {visible(sensors['device'])}, body axes '{sensors['axes']}' of the case")
        print(f"calibration  {visible(calibration_told(sensors['calibration']))}")
        print(f"frame        {sensors['frame'] or 'not named; filters need --frame'}")
        if sensors["declination_deg"] is not None:
            print(f"declination  {sensors['declination_deg']:+.4g}°, east positive")
        _print_timing(sensors["time"])
        for name, triad in sensors["triads"].items():
            _print_triad(name, triad)
        for name, count in sensors["flags"].items():
            print(f"flag         {name}: {counted(count, 'sample')}")
    if attitude := report.get("attitude"):
        print(f"attitude     {visible(attitude['source']) or 'source not named'}")
        print(f"frame        {attitude['frame']}, heading from {zero_of(attitude['north'])}")
        _print_timing(attitude["time"])
        print(
            f"known        {counted(attitude['known_samples'], 'sample')}, scored {attitude['scored_samples'] or 'all'}"
        )


def _print_triad(name: str, triad: dict[str, Any]) -> None:
    reach = "" if triad["range"] is None else f", range {_range(triad['range'])}"
    if not triad["samples"]:
        print(f"{name:12} no usable sample in {triad['unit']}{reach}")
        return
    samples = counted(triad["samples"], "sample")
    print(f"{name:12} {samples} in {triad['unit']}{reach}, |{name}| median {triad['norm_median']:.5g}")
    print(f"{'':12} mean {_three(triad['mean'])}, std {_three(triad['std'])}")


def _range(full_scale: float | tuple[float, ...]) -> str:
    axes = full_scale if isinstance(full_scale, tuple) else (full_scale,)
    return ", ".join(f"±{axis:.5g}" for axis in axes)


def _print_timing(time: dict[str, Any]) -> None:
    rate = "one sample" if time["rate_hz"] is None else f"{time['rate_hz']:.6g} Hz, jitter {time['jitter_us']:.3g} µs"
    longest = "" if time["rate_hz"] is None else f", longest step {time['longest_step_s']:.6g} s"
    samples, gaps = counted(time["samples"], "sample"), counted(time["gaps"], "gap")
    print(f"time         {samples}, {time['duration_s']:.3f} s, {rate}, {gaps}{longest}")


def _three(values: list[float]) -> str:
    return "[" + ", ".join(f"{v:.4g}" for v in values) + "]"
