"""plumbob sim, a recording of which the truth is known, and benchmark, filters on many of them or on recordings."""

import argparse
from pathlib import Path
from typing import Any, Final

from plumbob.cli import common
from plumbob.cli.engine import Call, Verb, show
from plumbob.cli.verbs import CHANGES
from plumbob.core import check
from plumbob.core.errors import FrameError, ParameterError

TEACH: Final = "teach"  # program of a chain that is understood without --chain: the chain of that name does it


def scenario_settings(args: argparse.Namespace) -> dict[str, Any]:
    """Keyword arguments of `plumbob.simulate` that the options name."""
    from plumbob.rotations import Frame

    if not hasattr(args, "frame"):
        raise FrameError(f"a simulation needs a navigation frame. Give --frame {', --frame '.join(Frame)}.")
    sensors, unit = getattr(args, "sensors", "ideal"), getattr(args, "unit", None)
    if unit is None and sensors != "ideal":
        raise ParameterError(f"give --unit random for {sensors} as it left the factory, or --unit calibrated.")
    given = {name: getattr(args, name) for name in ("rate", "duration") if getattr(args, name, None) is not None}
    choice = {"frame": Frame.parse(args.frame), "sensors": sensors, "unit": unit or "calibrated"}
    return choice | dict(common.pairs(args.set)) | given


def sim(args: argparse.Namespace, verb: Verb, call: Call) -> int:
    """Write the recording, its truth, and the cards of its unit."""
    from plumbob import files
    from plumbob.data import calibration_told
    from plumbob.data.recording import Recording

    if args.chain is not None or args.scenario == TEACH:
        return _chain(args, call)
    out, card_files = Path(args.out), [path and Path(path) for path in (args.card, args.noise_card)]
    common.check_outputs(args, *common.with_profile(out), *card_files, inputs=args.inputs)
    result = call(**scenario_settings(args))
    noise = [f"noise        {result.noise.source}"] if hasattr(args, "noise") else []
    notes = (result.truth.source, *(" ".join(line.split()) for line in noise))
    recording = Recording(imu=result.imu, track=result.truth, name=args.scenario, notes=notes)
    files.write(out, recording, overwrite=args.force)
    for path, card in zip(card_files, (result.calibration, result.noise), strict=True):
        if path:
            card.save(path, overwrite=args.force)
    print(f"{out}: {len(result.imu)} samples, {result.imu.t[-1]:.3f} s, {result.imu.meta.device}")
    print(f"truth        {result.truth.source}, frame {result.truth.frame}, heading from true north")
    print("\n".join([*noise, f"calibration  {calibration_told(result.imu.meta.calibration)}"]))
    return 0


def _chain(args: argparse.Namespace, call: Call) -> int:
    from plumbob import files
    from plumbob.data import calibration_told
    from plumbob.data.chain import load_chain
    from plumbob.data.recording import Recording
    from plumbob.live.emulated import chain_files, unit_file, write_chain
    from plumbob.simulation import named_chain, simulate_chain

    out, file = Path(args.out), Path(args.chain) if args.chain and args.chain.endswith(".toml") else None
    chain = named_chain(args.chain or TEACH) if file is None else load_chain(file)
    units = [segment.unit for segment in chain.segments if segment.unit]
    cards = {kind: [unit_file(Path(path), unit) for unit in units]
             for kind, path in (("calibration", args.card), ("noise", args.noise_card)) if path}  # fmt: skip
    outputs = (out, *chain_files(out), *(path for paths in cards.values() for path in paths))
    common.check_outputs(args, *outputs, inputs=(*args.inputs, file))
    how = scenario_settings(args)
    made = call(simulate_chain, chain=chain, program=args.scenario, seed=getattr(args, "seed", 0), **how)
    label = f"simulated {made.program.name}, seed {getattr(args, 'seed', 0)}"
    recording = Recording(array=made.array, name=made.chain.name, notes=(label,))
    files.write(out, recording, overwrite=args.force)
    write_chain(out, made, overwrite=args.force)
    for kind, paths in cards.items():
        for unit, path in zip(made.units.values(), paths, strict=True):
            getattr(unit, kind).save(path, overwrite=args.force)
    print(f"{out}: {len(made.array)} samples, {made.t[-1]:.3f} s, units {', '.join(units)}")
    print(f"truth        {label}, frame {how['frame']}, in {', '.join(map(str, chain_files(out)))}")
    print(f"calibration  {calibration_told(next(iter(made.units.values())).imu.meta.calibration)}")
    return 0


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
    count = 20 if args.seeds is None else args.seeds
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
        common.note(f"{out} is not written: no gain is shown; --unproven writes it anyway")
    return show(args, verb, tuning, *([f"{'parameters':12} {out}"] if written else []))
