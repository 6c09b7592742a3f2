"""Entry point: finds the verb, and is the one place where an error becomes a line and an exit code."""

import argparse
import atexit
import gc
import io
import os
import re
import signal
import sys
import threading
from collections.abc import Callable, Iterable, Sequence
from contextlib import nullcontext, redirect_stdout
from functools import partial
from pathlib import Path
from types import FrameType
from typing import Any, Final, NamedTuple, NoReturn, TextIO, cast

from plumbob.cli import common
from plumbob.cli.engine import VERB_BY_FUNCTION, add_verb
from plumbob.cli.verbs import GROUPS, VERBS
from plumbob.core import __version__
from plumbob.core.errors import PlumbobError
from plumbob.core.signals import on_signals
from plumbob.core.text import closest, visible

_LAYOUT: Final = "\n\t"
_AGAIN: Final = 0.05  # time after which a signal that was dropped comes again, s
EPILOG = """\
exit codes: 0 done, 1 an error that the message explains, 2 wrong usage, 3 done, but a recording is damaged (verify),
            rows of it are lost (record, verify --repair), attitudes or recordings differ (replay --check, compare), the
            grade is below the one asked for (info --min-grade), a convention is wrong (doctor), no gain is shown
            (benchmark tune) or a recording failed (batch), 70 a defect of this program,
            130 ended by Ctrl-C, 143 by SIGTERM: a file that is written is there as a whole, or as it was before
units: SI and radians inside; every other unit is written, as in --params gate=0.08g
"""
ORDER = """\
The order of work:

  simulate   plumbob sim buoy --frame NED --duration 60s --out sea.parquet
  or record  plumbob record session.toml
  calibrate  plumbob calibrate hand capture.parquet --out card.json
  estimate   plumbob run sea.parquet --filter mekf --out track.parquet
  evaluate   plumbob eval track.parquet sea.parquet --html errors.html

'plumbob demo' goes all the way in a minute, 'plumbob --help' lists the verbs.
"""


class _LineHelp(argparse.HelpFormatter):
    """Help that keeps the lines of descriptions and epilogs: an example is not broken, other lines are wrapped."""

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        fill = super()._fill_text
        return "\n".join(line if line.startswith(" ") else fill(line, width, indent) for line in text.splitlines())


class Parser(argparse.ArgumentParser):
    """Parser that takes no abbreviations, as --noise for --noise-card; verbs and what is nested in them inherit it."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(**{"formatter_class": _LineHelp, **settings, "allow_abbrev": False})

    def error(self, message: str) -> NoReturn:
        """End with the usage and the message, and ask where a word of a list is misspelled."""
        if choice := re.search(r"invalid choice: '(.*?)' \(choose from (.*)\)", message):
            message += f".{closest(choice[1], re.findall('[^ ,]+', choice[2].replace(chr(39), '')))}"
        super().error(message)


def build_parser(verbs: Sequence[str] = (), words: Sequence[str] | None = None) -> argparse.ArgumentParser:
    """Parser of these verbs, as far as `words` need it; without a verb it has a help that lists all, by groups."""
    lines = []
    for title, group in () if verbs else GROUPS.items():
        lines += [f"{title}:", *(f"  {name:11}{verb.line}" for name, verb in group.items()), ""]
    parser = Parser(
        prog="plumbob",
        usage=None if verbs else "plumbob [--help] [--version] VERB ...",
        description="Attitude from MEMS inertial sensors. Without a verb, plumbob prints the order of work.",
        epilog="\n".join([*lines, EPILOG]),
        formatter_class=partial(argparse.RawDescriptionHelpFormatter, width=78),  # lines are broken already
    )
    parser.add_argument("--version", action="version", version=f"plumbob {__version__}")
    parsers = parser.add_subparsers(dest="verb", metavar="VERB", required=True, help=argparse.SUPPRESS)
    for name in verbs:
        add_verb(parsers, name, VERBS[name], words)
    return parser


def _joined(words: Sequence[str]) -> list[str]:
    """Words with each option and its negative value as one: argparse takes -33.9,151.2 for another option."""
    joined: list[str] = []
    for word in words:
        is_value = joined and re.match(r"-\.?\d", word) and re.fullmatch(r"--[a-z-]+", joined[-1])
        joined.append(f"{joined.pop()}={word}" if is_value else word)
    return joined


def _parser_for(words: Sequence[str]) -> argparse.ArgumentParser:
    """Parser of the one verb that is asked for, which imports no other; without a verb, print the order of work."""
    if not words:
        print(ORDER, end="")
        raise SystemExit(0)
    if words[0] in VERBS:
        return build_parser(words[:1], words)
    parser = build_parser()
    if not words[0].startswith("-"):
        names = (*VERBS, *VERB_BY_FUNCTION)
        near = re.sub(r"'(\w+)'", lambda name: f"'{VERB_BY_FUNCTION.get(name[1], name[1])}'", closest(words[0], names))
        parser.error(f"there is no verb '{words[0]}'.{near} 'plumbob --help' lists them.")
    return parser


def main(
    argv: Sequence[str] | None = None,
    parser: Callable[[Sequence[str]], argparse.ArgumentParser] = _parser_for,
    program: str = "plumbob",
) -> int:
    """Run the command line of a program, by default of Plumbob, and return its exit code; an error becomes a line."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # matrices are small here: threads of NumPy's would but wait
    for stream in (sys.stdout, sys.stderr):  # a terminal that cannot show µ or ² must not cost the result
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")
    if argv is None:  # the process ends with this: to look for cycles in all that it imported takes as long as a run
        atexit.register(gc.freeze)
        atexit.register(_forget_what_nobody_reads)
    words = sys.argv[1:] if argv is None else list(argv)
    args = argparse.Namespace(verb=" ".join(words[:1]))  # until they are parsed
    try:
        with on_signals(_raise, "SIGINT", "SIGTERM", "SIGHUP", only_default=True):
            parsing = parser(words)
            args, unknown = parsing.parse_known_args(_joined(words))
            if unknown:
                parsing = getattr(args, "parser", parsing)  # in the name of the verb
                near = closest(unknown[0].partition("=")[0], parsing._option_string_actions)
                parsing.error(f"unrecognized arguments: {' '.join(unknown)}.{near}")
            with redirect_stdout(cast(TextIO, _Visible(sys.stdout))) if sys.stdout else nullcontext():
                code: int = args.prepare(args)() if hasattr(args, "prepare") else args.run(args)
        if sys.stdout:
            sys.stdout.flush()
    except _SignalledError as ended:
        return _ended(program, args, ended)
    except BrokenPipeError:  # the reader of a pipe went away; that is its right
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except (PlumbobError, OSError) as error:
        text = str(error) if isinstance(error, PlumbobError) else _words(error)
        print(f"{program} {args.verb}: {visible(text, _LAYOUT)}", file=sys.stderr)
        return 1
    except Exception as error:
        if isinstance(error.__cause__, _SignalledError):  # a class that is made while modules are imported wraps it
            return _ended(program, args, error.__cause__)
        import traceback

        traceback.print_exc()
        print(f"{program} {args.verb}: this is a defect of plumbob {__version__}; please report it.", file=sys.stderr)
        return 70
    return code


def _forget_what_nobody_reads() -> None:
    """Let notes that could not be written not become the exit code: Python flushes them once more at its end."""
    try:
        if sys.stderr:
            sys.stderr.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stderr.fileno())


class _SignalledError(KeyboardInterrupt):
    """A signal asked this process to end: raised like Ctrl-C, so that what is half done is removed on the way.

    It comes again where it is dropped before it is heard, as a callback of an import or of C may do.
    """

    is_heard = False

    def __del__(self) -> None:
        if not self.is_heard:
            threading.Timer(_AGAIN, os.kill, (os.getpid(), self.args[0])).start()


def _raise(number: int, _frame: FrameType | None) -> NoReturn:
    raise _SignalledError(number)


def _ended(program: str, args: argparse.Namespace, ended: _SignalledError) -> int:
    """Say by what the verb was ended, and which of its files it had not written; its exit code is the shell's."""
    ended.is_heard, number = True, ended.args[0]
    how = "Ctrl-C" if number == signal.SIGINT else signal.Signals(number).name
    lost = f"; not written: {lacking}" if (lacking := ", ".join(map(str, common.unwritten(args)))) else ""
    print(f"{program} {args.verb}: ended by {how}{visible(lost)}.", file=sys.stderr)
    return 128 + int(number)


class _Visible(NamedTuple):
    """Standard output on which nothing that a file says can steer the terminal; reports have lines, and no more."""

    stream: TextIO

    def __getattr__(self, name: str) -> Any:
        return getattr(self.stream, name)

    def write(self, text: str) -> int:
        return self.stream.write(visible(text, _LAYOUT))

    def writelines(self, lines: Iterable[str]) -> None:
        for line in lines:
            self.write(line)


def _words(error: OSError) -> str:
    """What the system refused, and what to do about it."""
    if not isinstance(error.filename, str | os.PathLike):
        return str(error)
    path = Path(error.filename)
    if isinstance(error, FileNotFoundError):
        missing = f"there is no folder {path.parent}; create it first" if not path.parent.is_dir() else "check the path"
        return f"{path} does not exist; {missing}."
    if isinstance(error, IsADirectoryError):
        return f"{path} is a folder; name a file."
    return f"{path}: {error.strerror}."


if __name__ == "__main__":
    sys.exit(main())
