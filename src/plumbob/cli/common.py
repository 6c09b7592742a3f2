"""What verbs share: options that mean the same everywhere, those of a live stream, progress, and notes to the user."""

import argparse
import os
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from plumbob.core.errors import DecodeError, ParameterError
from plumbob.core.text import visible

_SILENCE: Final = 10.0  # s between two lines of progress where there is no terminal

if TYPE_CHECKING:
    from plumbob.filters.offline import Stage
    from plumbob.reporting.report import Report


def filter_args(verb: str, filter_: str | None, params: str | None) -> dict[str, Any]:
    """The one filter of --filter with --params; None, a filter of rates, or a word that stands for one as it is."""
    from plumbob.filters.known import RATE_FILTERS

    if filter_ in (None, "track", "none", *RATE_FILTERS):
        return {"filter": filter_, "params": dict(pairs(params))}
    chosen = stages(filter_, params)
    if len(chosen) != 1:
        raise ParameterError(f"{verb} takes one filter; run it again for another.")
    return {"filter": chosen[0].filter, "params": chosen[0].params}


PARAMS_HELP = "name=value,... with units (kp=0.5,gate=0.08g,mag=off), or a TOML file; see 'plumbob list filters'"


def _named(items: Iterable[str], rule: str) -> Iterator[tuple[str, str]]:
    """Names and values of words with an equals sign."""
    for item in items:
        name, _, value = map(str.strip, item.partition("="))
        if not name or not value:
            raise ParameterError(f"{rule}, but got '{item}'.")
        yield name, value


def named_values(items: Sequence[str]) -> dict[str, str]:
    """Choices that --option names."""
    options: dict[str, str] = {}
    for name, value in _named(items, "--option needs NAME=VALUE, as gyr_range='500 deg/s'"):
        if name in options:
            raise ParameterError(f"--option {name} is given twice.")
        options[name] = value
    return options


PAGE: Final[Mapping[str, Mapping[str, Any]]] = {  # options of what has a page
    "html": {"type": Path, "metavar": "FILE", "help": "also write a page with figures that opens offline"},
    "plot": {"type": Path, "metavar": "FILE", "help": "also write the figures alone: .svg, .png or .pdf"},
    "width": {"metavar": "T", "help": "width of the figures of --plot, as 85mm"},
    "lang": {"choices": ("en", "zh"), "help": "language of the labels of page and figures (default en)"},
}
ENDINGS = {"html": (".html", ".htm"), "plot": (".svg", ".png", ".pdf")}  # of the names of pages and pictures


def require_ending(option: str, path: str | Path, endings: Sequence[str]) -> None:
    """Refuse an output whose name ends otherwise."""
    if Path(path).suffix.lower() not in endings:
        raise ParameterError(f"{option} needs a name that ends in {' or '.join(endings)}, but got {path}.")


def write_pages(args: argparse.Namespace, report: "Report") -> None:
    """Write page and picture after the numbers, which need neither matplotlib nor a place to write."""
    if sys.stdout:
        sys.stdout.flush()
    plot = partial(report.plot, width=args.width)
    for what, path, write in (("page", args.html, report.write_html), ("figures", args.plot, plot)):
        if path is not None:
            write(path, lang=args.lang or "en", overwrite=args.force)
            if not args.json:
                print(f"{what:12} {path}")


def check_outputs(args: argparse.Namespace, *outputs: Path | None, inputs: Sequence[Path | None] = ()) -> None:
    """Refuse, before any work, files that could not be written or whose writing would lose an input.

    The arguments keep the outputs, so that the end of the program knows which are not there.
    """
    from plumbob.core.files import is_same_file, profile_paths, require_other, require_place

    read = [path for path in inputs if path is not None]
    if args.force:
        read += [profile for path in read for profile in profile_paths(path) if profile.is_file()]
    wanted = [path for path in outputs if path is not None]
    for number, path in enumerate(wanted):
        require_other(path, read)
        if any(is_same_file(other, path) for other in wanted[:number]):
            raise ParameterError(f"{path} is named for two outputs; give each a file of its own.")
    for path in wanted:
        require_place(path, overwrite=args.force)
    args.outputs = {path: _stamp(path) for path in wanted}


def unwritten(args: argparse.Namespace) -> list[Path]:
    """Outputs of `check_outputs` that are as they were then."""
    return [path for path, before in getattr(args, "outputs", {}).items() if _stamp(path) == before]


def _stamp(path: Path) -> tuple[int, int] | None:
    """What tells a file from the one that replaces it; None where there is none."""
    if not path.exists():
        return None
    stat = path.stat()
    return stat.st_ino, stat.st_mtime_ns


def with_profile(path: Path | None, tables: Sequence[str] = (".csv",)) -> tuple[Path | None, ...]:
    """A file to write, and the profile that a table, by its suffix, gets beside it."""
    from plumbob.core.files import profile_beside

    return (path,) if path is None or path.suffix.lower() not in tables else (path, profile_beside(path))


def note(*lines: str) -> None:
    """Tell the user something on standard error, out of the way of pipes."""
    for line in lines:
        print(f"note: {visible(line)}", file=sys.stderr)


def print_json(value: Any) -> None:
    """Print one JSON object; NaN is refused."""
    import json

    print(json.dumps(value, indent=2, allow_nan=False))


def stages(names: str, params: str | None) -> "list[Stage]":
    """Filters named by a comma list, with the parameters that belong to each.

    In `params`, ``name=value`` goes to the only filter, and ``filter.name=value`` to the one named. A TOML file holds
    the same: plain keys for the only filter, or a table per filter.
    """
    from plumbob.filters import load
    from plumbob.filters.offline import Stage

    wanted = [name.strip() for name in names.split(",") if name.strip()]
    if not wanted:
        raise ParameterError("no filter is named; see 'plumbob list filters'.")
    for name in wanted:
        load(name)
    by_filter: dict[str, dict[str, Any]] = {name: {} for name in wanted}
    for key, value in pairs(params):
        owner, dot, parameter = key.rpartition(".")
        if not dot and len(by_filter) > 1:
            raise ParameterError(f"'{key}' could belong to any of {', '.join(by_filter)}; write {wanted[0]}.{key}.")
        target = owner if dot else wanted[0]
        if target not in by_filter:
            raise ParameterError(f"'{key}' names filter '{target}', which does not run; these do: {', '.join(wanted)}.")
        if parameter in by_filter[target]:
            raise ParameterError(f"'{key}' is given twice.")
        by_filter[target][parameter] = value
    return [Stage(name, values) for name, values in by_filter.items()]


def given_noise(chosen: "Sequence[Stage]", path: Path | None) -> "list[Stage]":
    """Stages with the noise card of a file, where one is named, for each filter that takes one."""
    if path is None:
        return list(chosen)
    from plumbob.data.cards import NoiseCard
    from plumbob.filters.offline import with_noise

    card = NoiseCard.load(path)
    tell_noise(chosen)
    return with_noise(chosen, card)


def tell_noise(chosen: "Sequence[Stage]") -> None:
    """Say which of several filters take a noise card, and which do not."""
    from plumbob.filters import takes_noise

    takers, others = ([s.filter for s in chosen if takes_noise(s.filter) is takes] for takes in (True, False))
    if takers and others:
        note(f"the noise card is for {', '.join(takers)}; {', '.join(others)} can take nothing from it")


def pairs(params: str | None) -> Iterator[tuple[str, Any]]:
    """Names and values of ``name=value,...`` or of a TOML file, where a table's name goes before its keys."""
    if not params:
        return
    if not params.endswith(".toml"):
        yield from _named(params.split(","), "--params needs name=value, separated by commas")
        return
    from plumbob.core import schema
    from plumbob.core.files import text_of

    text = text_of(Path(params))
    try:
        content = schema.toml(text, "docs/choose-a-filter.md")
    except DecodeError as error:
        raise ParameterError(f"{params} is {error}") from error
    for key, value in content.items():
        inner = {f"{key}.{name}": each for name, each in value.items()} if isinstance(value, dict) else {key: value}
        for name, each in inner.items():  # numbers follow the rule for text: one of two usual units must be written
            yield name, repr(each) if isinstance(each, int | float) and not isinstance(each, bool) else each


def _lines() -> Callable[[str, int, int], None]:
    """Say what is done in a line, at most every so many seconds: a log shows that the work goes on."""
    last = time.monotonic()

    def done(what: str, so_far: int, total: int) -> None:
        nonlocal last
        if time.monotonic() - last >= _SILENCE:
            last = time.monotonic()
            note(f"{what}: {100 * so_far // max(total, 1)} %")

    return done


@contextmanager
def progress_bars() -> Iterator[Callable[[str, int, int], None] | None]:
    """A bar on standard error for what is done in turn, by its title, what is done of it, and of all.

    Where there is no terminal, a line now and then.
    """
    forced = any(os.environ.get(name) for name in ("FORCE_COLOR", "TTY_COMPATIBLE"))
    if not forced and (sys.stderr.closed or not sys.stderr.isatty()):  # Rich costs a tenth of a second to import
        yield None if sys.stderr.closed else _lines()
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    console = Console(stderr=True)
    columns = (TextColumn("{task.description}"), BarColumn(), TextColumn("{task.percentage:3.0f} %"))
    with Progress(
        *columns, TimeRemainingColumn(), console=console, transient=True, disable=not console.is_terminal
    ) as bar:

        def done(what: str, so_far: int, total: int) -> None:
            if not any(task.description == what for task in bar.tasks):
                for task in bar.task_ids:
                    bar.remove_task(task)
                bar.add_task(what)
            bar.update(bar.task_ids[0], completed=so_far, total=total)

        yield done
