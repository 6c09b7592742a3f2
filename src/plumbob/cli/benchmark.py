"""plumbob benchmark: filters on many recordings, or on many seeds of a scenario, and their parameters fitted."""

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Any

from plumbob.cli import common
from plumbob.cli.engine import Verb, show
from plumbob.cli.sim import scenario_settings
from plumbob.cli.verbs import CHANGES
from plumbob.core import check
from plumbob.core.errors import ParameterError

Call = Callable[..., Any]


def accuracy(args: argparse.Namespace, verb: Verb, call: Call) -> int:
    """Filters and peers on recordings, each changed first as the options say."""
    from plumbob.fleet.experiments.peers import peer_runs
    from plumbob.fleet.experiments.trials import trials_in
    from plumbob.rotations import Frame

    frame = {"frame": Frame.parse(args.frame)} if hasattr(args, "frame") else {}
    for name in args.given.get("align", ()):
        check.one_of("--align", name, ("heading", "mounting", "time"))
    changes = {name: "" if value is True else value for name in CHANGES if (value := getattr(args, name))}
    stages = tuple(common.given_noise(common.stages(args.filters, args.params), args.noise and Path(args.noise)))
    peers, absent = peer_runs(args.peers or "none")
    files = tuple(trials_in(*map(Path, args.files)))
    return show(args, verb, call(files=files, stages=stages, peers=peers, absent=absent, changes=changes, **frame))


def scenario(args: argparse.Namespace, verb: Verb, call: Call) -> int:
    """Filters on many seeds of a scenario."""
    count = 20 if args.seeds is None else int(args.seeds)
    if count < 1:
        raise ParameterError(f"--seeds must be at least 1, but it is {count}.")
    stages = common.stages(args.filters, args.params)
    if own_noise := args.noise == "own":
        common.tell_noise(stages)
    else:
        stages = common.given_noise(stages, args.noise and Path(args.noise))
    settings = scenario_settings(args)
    choice = {name: settings.pop(name) for name in ("frame", "sensors", "unit")}
    return show(
        args, verb, call(stages=tuple(stages), seeds=range(count), settings=settings, own_noise=own_noise, **choice)
    )


def tune(args: argparse.Namespace, verb: Verb, call: Call) -> int:
    """Write parameters only where a gain is shown, or all the same."""
    tuning, out = call(), args.out
    written = out is not None and (tuning.proven or args.unproven)
    if written:
        tuning.write(Path(out), unproven=args.unproven, overwrite=args.force)
    elif out is not None:
        common.note(f"{out} is not written: no gain is shown; --unproven writes it all the same")
    return show(args, verb, tuning, *([f"{'parameters':12} {out}"] if written else []))
