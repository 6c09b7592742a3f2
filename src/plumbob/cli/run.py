"""plumbob run: from a recording to an attitude."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from plumbob.cli import common
from plumbob.core.text import counted

if TYPE_CHECKING:
    from plumbob.data import AttitudeTrack
    from plumbob.door.estimate import Estimated
    from plumbob.overview.streaming_stats import Gatherer


def add_parser(verbs: common.Adder) -> None:
    """Declare the verb."""
    p = verbs.add_parser(
        "run",
        help="estimate the attitude of a recording",
        description="Estimate the attitude at every sample of a recording, and write it as a track. By default each is "
        "estimated from what came before and after it; --causal estimates what a live system would have known.",
        epilog=common.more("plumbob run sea.parquet --out track.parquet", "choose-a-filter.md"),
    )
    p.add_argument(
        "file", type=Path, nargs="+", help="recording: .mcap, .parquet, .csv, .txt, BROAD .hdf5 or .mat; or several "
        "files of one recording, a sensor each"
    )  # fmt: skip
    which = p.add_mutually_exclusive_group()
    which.add_argument(
        "--filter",
        metavar="NAME",
        help="one of 'plumbob filters'; default: smoother. A filter of rates (scalar, two_state, moving_average) gives "
        "no attitude: --out is then the recording with its rates filtered",
    )
    which.add_argument(
        "--causal", action="store_true", help="as a live system knows it: nothing later is used; as --lag 0s"
    )
    which.add_argument(
        "--lag",
        metavar="T",
        help="smooth with a fixed lag, as 5s: nothing later than that after each sample is used",
    )
    p.add_argument("--params", metavar="P", help=common.PARAMS_HELP)
    common.add_frame(p, "navigation frame of the result; needed where the recording names none")
    common.add_init(p)
    common.add_place(p)
    common.add_profile(p)
    common.add_unit(p)
    common.add_calibration(p)
    common.add_noise(p)
    p.add_argument(
        "--drift",
        metavar="MODEL",
        help="taken off before a filter of rates: chen2013, the trackball paper's figures, which are not those of your "
        "unit; the model of that is a card (--calibration)",
    )
    p.add_argument(
        "--rest", metavar="A..B", help="before a filter of rates: take the mean of this stretch off, as 0s..100s"
    )
    p.add_argument("--out", type=Path, metavar="FILE", help="where to write the track (.parquet or .csv)")
    p.add_argument(
        "--card", type=Path, metavar="FILE", help="where to write the card with what was found of the gyroscope"
    )
    p.add_argument(
        "--report",
        type=Path,
        metavar="HTML",
        help="also write a page about it, as 'plumbob report' does, of this estimate",
    )
    common.add_force(p)
    common.add_json(p)
    p.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Do it."""
    from plumbob.core.errors import ParameterError
    from plumbob.door.estimate import estimate
    from plumbob.door.reading import read
    from plumbob.filters.known import RATE_FILTERS, SMOOTHER

    files, args.file = args.file, args.file[0]
    if args.filter in RATE_FILTERS:
        return _rates(args)
    if args.drift or args.rest:
        raise ParameterError(f"--drift and --rest are for a filter of rates: --filter {', '.join(RATE_FILTERS)}.")
    stages = common.stages(args.filter or SMOOTHER, args.params)
    if len(stages) != 1:
        raise ParameterError("run takes one filter; to compare several use 'plumbob benchmark accuracy'.")
    (stage,) = stages
    if args.card and stage.filter != SMOOTHER:
        raise ParameterError(f"--card is for the smoother, but the filter is {stage.filter}. Leave one of them out.")
    inputs = (*files, args.profile, args.calibration, args.noise)
    if args.report and args.report.suffix.lower() not in common.ENDINGS["html"]:
        raise ParameterError(f"--report needs a name that ends in .html or .htm, but got {args.report}.")
    common.check_outputs(args, *common.with_profile(args.out), args.card, args.report, inputs=inputs)
    gatherer = _gatherer() if args.report else None
    with common.progress_bars() as bars:
        result = estimate(
            args.file if len(files) == 1 else read(files, profile=args.profile),
            stage.filter,
            causal=args.causal,
            lag=args.lag,
            params=stage.params,
            frame=args.frame,
            init=args.init,
            calibration=args.calibration,
            noise=args.noise,
            place=args.place,
            date=args.date,
            profile=args.profile,
            unit=args.unit,
            out=args.out,
            overwrite=args.force,
            follow=gatherer,
            note=common.note,
            progress=lambda done, total: bars(stage.filter, done, total),
        )
    if args.card:
        result.card().save(args.card, overwrite=args.force)
    if gatherer is not None:
        _report(args, result, gatherer)
    errors = {} if result.reference is None else _errors(result.track, result.reference)
    if args.json:
        named = {"file": str(args.file), "out": str(args.out) if args.out else None}
        common.print_json(named | result.summary() | ({"errors": errors} if errors else {}))
        return 0
    print(f"{args.file}: {counted(result.outline.samples, 'sample')}, {result.outline.duration:.3f} s")
    print("\n".join([result.text(), *_error_lines(errors)]))
    if args.out:
        print(f"written      {args.out}")
    if args.card:
        print(f"card         {args.card}")
    if args.report:
        print(f"page         {args.report}")
    return 0


_OF_ATTITUDES = ("frame", "init", "place", "date", "noise", "card", "report")
"""Options that mean nothing for a filter of rates."""


def _rates(args: argparse.Namespace) -> int:
    """Filter the rates."""
    from plumbob.core.errors import ParameterError
    from plumbob.door.rates import filter_rates

    if beside := [f"--{name}" for name in _OF_ATTITUDES if getattr(args, name) is not None]:
        raise ParameterError(f"{', '.join(beside)}: {args.filter} gives no attitude. Leave it out.")
    common.check_outputs(args, *common.with_profile(args.out), inputs=(args.file, args.profile, args.calibration))
    result = filter_rates(
        args.file,
        args.filter,
        params=dict(common.pairs(args.params)),
        drift=args.drift,
        rest=None if args.rest is None else common.span(args.rest),
        calibration=args.calibration,
        profile=args.profile,
        unit=args.unit,
        out=args.out,
        overwrite=args.force,
    )
    report = result.summary()
    if args.json:
        common.print_json({"file": str(args.file), "out": str(args.out) if args.out else None, **report})
        return 0
    print(f"{args.file}: {counted(report['samples'], 'sample')}, {report['duration_s']:.3f} s")
    print(result.text())
    if args.out:
        print(f"written      {args.out}")
    return 0


def _gatherer() -> "Gatherer":
    from plumbob.overview.streaming_stats import Gatherer

    return Gatherer()


def _report(args: argparse.Namespace, result: "Estimated", gatherer: "Gatherer") -> None:
    """Page of the estimate that was made."""
    from plumbob.overview.overview import of_estimate

    of_estimate(result, gatherer, args.file).write_html(args.report, overwrite=args.force)


def _errors(track: "AttitudeTrack", reference: "AttitudeTrack") -> dict[str, Any]:
    """Errors against the reference that the recording carries; a word where they cannot be compared.

    Headings from two norths without a declination say nothing, but inclinations do.
    """
    from plumbob.core.errors import PlumbobError
    from plumbob.door.evaluate import evaluate

    try:
        summary = evaluate(track, reference).summary()
    except PlumbobError as error:
        if track.north is reference.north:
            return {"not_compared": str(error)}
        try:
            aligned = evaluate(track, reference, align=("heading",)).summary()
        except PlumbobError:
            return {"not_compared": str(error)}
        return {"not_compared": str(error), "inclination_rmse_deg": aligned["inclination_rmse_deg"]}
    keys = ("total_rmse_deg", "heading_rmse_deg", "inclination_rmse_deg")
    return {key: summary[key] for key in keys} | {"not_scored": summary["not_scored"]}


def _error_lines(errors: dict[str, Any]) -> list[str]:
    lines = []
    for name, value in errors.items():
        if value is not None and name != "not_scored":
            shown = value if isinstance(value, str) else f"{value:.3f}°"
            lines.append(f"error        {name.removesuffix('_deg').replace('_', ' ')}: {shown}")
    return [*lines, *(f"not scored   {name}: {why}" for name, why in errors.get("not_scored", {}).items())]
