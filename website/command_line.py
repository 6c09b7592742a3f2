"""Write docs/command-line.md: the order of work, and every verb with its options, from the parser itself.

``python website/command_line.py > docs/command-line.md``
"""

import argparse
import re
from collections.abc import Iterator

from plumbob.cli.main import build_parser
from plumbob.cli.verbs import GROUPS, VERBS

HEAD = """\
# Command line

Made by `python website/command_line.py` from the parser. The order of work is: simulate or record → calibrate → run →
evaluate. `plumbob VERB --help` says the same as this page.

```console
$ plumbob sim buoy --frame NED --sensors mpu6000+hmc5983 --unit calibrated --seed 1 --duration 60s --out sea.parquet
$ plumbob run sea.parquet --filter mahony --params kp=0.1,ki=0.003,gate=off --out track.parquet
$ plumbob eval track.parquet sea.parquet --settle 30s
```

Numbers carry their unit where two are usual: `gate=0.08g`, `--duration 60s`, `--tilt 5deg`. An existing file is
replaced only with `--force`. Every report has `--json`. Notes and errors go to standard error; an error is one line
that says what is wrong and what to do.

| exit code | meaning |
| --- | --- |
| 0 | done |
| 1 | an error that the message explains |
| 2 | wrong usage |
| 3 | done, but a recording is damaged (`verify`), has lost rows (`record`, `verify --repair`), is not replayed to the \
bit, differs (`compare`), is graded too low (`info`), has wrong conventions (`doctor`) or failed (`batch`); or no \
gain is shown (`benchmark tune`) |
| 70 | a defect of Plumbob: please report it |
| 130, 143 | ended by Ctrl-C, by SIGTERM; a file is there as a whole, or as it was before |
"""


def page() -> str:
    """The whole page."""
    verbs = _children(build_parser(list(VERBS)))
    parts = [HEAD]
    for title, names in GROUPS.items():
        parts += [f"## {title.capitalize()}\n", *(line for name in names for line in _verb(name, verbs[name], level=3))]
    return "\n".join(parts)


def _verb(name: str, parser: argparse.ArgumentParser, *, level: int) -> Iterator[str]:
    """Section of a verb and of the kinds below it."""
    yield f"{'#' * level} {name}\n"
    yield f"{_escaped(parser.description or '')}\n"
    rows = [row for action in parser._actions if (row := _row(parser, action))]
    if rows:
        yield "\n".join(("| option | meaning |", "| --- | --- |", *rows, ""))
    if parser.epilog:
        yield from (f"{_escaped(_marked(part))}\n" for part in parser.epilog.split("\n\n"))
    for kind, child in _children(parser).items():
        yield from _verb(f"{name} {kind}", child, level=level + 1)


def _children(parser: argparse.ArgumentParser) -> dict[str, argparse.ArgumentParser]:
    found = [action for action in parser._actions if isinstance(action, argparse._SubParsersAction)]
    return dict(found[0].choices) if found else {}


def _row(parser: argparse.ArgumentParser, action: argparse.Action) -> str:
    """Row of an option or argument; none for help, or for the choice of a verb."""
    if isinstance(action, (argparse._HelpAction, argparse._SubParsersAction)) or action.help is argparse.SUPPRESS:
        return ""
    words = (action.help or "") % {**vars(action), "prog": parser.prog}
    needed = "" if not action.option_strings or not action.required else " (needed)"
    return f"| {_code(_usage(action))} | {_escaped(words)}{needed} |"


def _usage(action: argparse.Action) -> str:
    """Words that give an option or an argument: '--frame ENU|NED|NWU', '[INPUT]'."""
    value = action.metavar or ("|".join(map(str, action.choices)) if action.choices else action.dest)
    value = " ".join(value) if isinstance(value, tuple) else value
    if not action.option_strings:
        return {"?": f"[{value}]", "*": f"[{value} …]", "+": f"{value} …"}.get(str(action.nargs), value)
    named = ", ".join(action.option_strings)
    return named if action.nargs == 0 else f"{named} {value}"


def _code(text: str) -> str:
    """Code in a cell; a bar in backticks would end the cell for some readers of Markdown."""
    return f"<code>{text.replace('|', '&#124;')}</code>" if "|" in text else f"`{text}`"


def _marked(epilog: str) -> str:
    """Epilog with its commands as code and its page as a link."""
    marked = re.sub(r"^  (plumbob .*?)(?=$|    )", r"`\1`", epilog, flags=re.MULTILINE)
    return re.sub(r"docs/([\w-]+\.md)", r"[\1](\1)", marked)


def _escaped(text: str) -> str:
    """Text for a cell of a table: one line, in which nothing but code is marked."""
    line = re.sub(r"\s+", " ", text).strip()
    line = re.sub(r"'((?:plumbob|--)[^']*)'", r"`\1`", line)
    parts = re.split(r"(`[^`]*`)", line)
    return "".join(part if part.startswith("`") else re.sub(r"([*_<|])", r"\\\1", part) for part in parts)


if __name__ == "__main__":
    print(page(), end="")
