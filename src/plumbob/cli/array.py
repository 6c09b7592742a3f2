"""plumbob array: several units on one body: how they differ, what they measure together, and which one is wrong."""

import argparse
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from plumbob.cli import common

if TYPE_CHECKING:
    from plumbob.data.array import ImuArray

KINDS: tuple[str, ...] = ("info", "combine", "monitor")
"""What can be done: `add_` declares it."""
_SUFFIXES = (".mcap", ".parquet", ".csv")


def add_parser(verbs: common.Adder) -> None:
    """Declare the verb and its kinds."""
    p = verbs.add_parser(
        "array",
        help="several units on one body: compare, combine, watch",
        description="Several units on one body: how they differ, what they measure together, and which one is wrong.",
        epilog=common.more("plumbob array monitor six.parquet", "array.md"),
    )
    kinds = p.add_subparsers(dest="kind", metavar="KIND")
    for add in (add_info, add_combine, add_monitor):
        add(kinds)
    p.set_defaults(run=run, usage=p)


def run(args: argparse.Namespace) -> int:
    """Do it."""
    if args.kind is None:
        args.usage.error(f"name a KIND: {', '.join(KINDS)}")
    code: int = args.do(args)
    return code


def add_info(kinds: common.Adder) -> None:
    """Declare the kind."""
    p = kinds.add_parser(
        "info",
        help="small rotations, relative biases and clock offsets of the units, with their uncertainty",
        description="Estimate how each unit differs from the mean of all: a small rotation beyond its mount, biases, "
        "and by how much its clock is late.",
        epilog=common.more("plumbob array info six.parquet", "array.md"),
    )
    _add_files(p)
    p.set_defaults(do=partial(_show, verb="info"))


def add_combine(kinds: common.Adder) -> None:
    """Declare the kind."""
    p = kinds.add_parser(
        "combine",
        help="one virtual unit of all, by weighted least squares",
        description="Combine all units to one in body axes, by weighted least squares of all sensor axes.",
        epilog=common.more("plumbob array combine six.parquet --out one.parquet", "array.md"),
    )
    _add_files(p)
    p.add_argument(
        "--weights", choices=("noise", "range", "equal"), default="noise", help="of the units (default: noise cards)"
    )
    p.add_argument("--correct", action="store_true", help="take off first what 'plumbob array info' finds")
    _add_out(p, required=True)
    p.set_defaults(do=_combine)


def add_monitor(kinds: common.Adder) -> None:
    """Declare the kind."""
    p = kinds.add_parser(
        "monitor",
        help="which unit contradicts the others, since when; with --out what the rest measure",
        description="Watch the units against each other: frozen, biased, wrongly scaled, noisy and dead ones are left "
        "out, and taken in again when they agree.",
        epilog=common.more("plumbob array monitor six.parquet --out one.parquet", "array.md"),
    )
    _add_files(p)
    _add_out(p, required=False)
    p.set_defaults(do=partial(_show, verb="monitor"))


def _add_files(p: argparse.ArgumentParser) -> None:
    p.add_argument(
        "files", type=Path, nargs="+", metavar="FILE", help="recording with several units, or one file for each unit"
    )
    p.add_argument(
        "--mounts", type=Path, metavar="TOML|NAME",
        help="how the units sit on the body, instead of what the files say; 'arm': as the six of the teaching arm",
    )  # fmt: skip
    common.add_json(p)


def _add_out(p: argparse.ArgumentParser, *, required: bool) -> None:
    p.add_argument(
        "--out", type=Path, required=required, metavar="FILE", help="write the virtual unit: " + ", ".join(_SUFFIXES)
    )
    common.add_force(p)


def _read(args: argparse.Namespace, out: Path | None = None) -> "ImuArray":
    """The units, once it is known that the virtual unit can be written."""
    from plumbob.core.errors import ParameterError
    from plumbob.data.array import UnitMount
    from plumbob.data.recording import found_in
    from plumbob.door.reading import read_array

    if out is not None:
        if out.suffix.lower() not in _SUFFIXES:
            raise ParameterError(f"{out}: the virtual unit is written as {', '.join(_SUFFIXES)}, not '{out.suffix}'.")
        common.check_outputs(args, *common.with_profile(out), inputs=(*args.files, args.mounts))
    notes: list[str] = []
    files = args.files if len(args.files) > 1 else args.files[0]
    array = read_array(files, mounts=args.mounts, note=notes.append)
    common.note(*found_in(notes))
    if args.mounts is None and all(replace(mount, noise=None) == UnitMount() for mount in array.mounts.values()):
        common.note("no mount is known, so all units are taken to lie along the body's axes; see --mounts")
    return array


def _show(args: argparse.Namespace, verb: str) -> int:
    """Print what a function of the same name finds, and write the virtual unit where it was asked for."""
    from plumbob.arm import array

    out = getattr(args, "out", None)
    findings: Any = getattr(array, verb)(_read(args, out))
    return _finish(args, findings, out)


def _combine(args: argparse.Namespace) -> int:
    from plumbob.arm.array import combine

    return _finish(args, combine(_read(args, args.out), weights=args.weights, correct=args.correct), args.out)


def _finish(args: argparse.Namespace, findings: Any, out: Path | None) -> int:
    from plumbob.data.recording import Recording
    from plumbob.live.recorded import convert

    common.print_json(findings.summary()) if args.json else print(findings.text())
    if out is not None:
        note = f"virtual unit of the array in {', '.join(path.name for path in args.files)}"
        convert(Recording(imu=findings.imu, name=out.stem, notes=(note,)), out, overwrite=args.force)
        if not args.json:
            print(f"written      {out}")
    return 0
