"""A verb is its function: options, their types, defaults and help come from its signature and docstring."""

import argparse
import re
from collections.abc import Callable, Mapping, Sequence
from contextlib import nullcontext
from functools import cache, partial
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import plumbob
from plumbob.cli import common
from plumbob.core import units
from plumbob.core.errors import ParameterError
from plumbob.core.resources import guide

if TYPE_CHECKING:
    from inspect import Parameter

Call = Callable[..., Any]

# Parameters that only a program can give; and those whose option has another name: `from` and `as` are words of Python.
FOR_PROGRAMS: Final = {"note", "progress", "opened", "sinks", "follow", "keep", "covariance", "max_bytes"}
SPELLED: Final = {"overwrite": "force", "capture": "from", "start": "from", "begin": "from", "end": "to", "stop": "to",
                  "layout": "as", "limits": "chain",
                  "form": "as", "options": "option", "kind": "type", "temp_c": "temp",
                  "poses": "pose", "with_": "with", "answers": "set"}  # fmt: skip
SHORT: Final = {  # what stands for a value, by parameter; else by type
    "array": "SOURCE", "track": "ANGLES", "limits": "TOML",
    "poses": "FROM,TO[,ANGLE...]", "pose_sd": "ANGLE", "pose": "zero|ANGLE,...",
    "mounts": "TOML|NAME",
    "frame": "ENU|NED|NWU", "init": "level|truth|ROLL,PITCH,HEADING", "place": "LAT,LON[,HEIGHT]", "params": "P",
    "date": "YYYY-MM-DD", "profile": "TOML", "calibration": "JSON", "noise": "JSON", "session": "TOML", "set": "P",
    "unit": "NAME|N", "filter": "NAME", "rate": "HZ", "format": "NAME|TOML", "port": "DEV", "iio": "DEV",
    "card": "JSON", "rest": "A..B", "tcp": "HOST:PORT", "udp": "HOST:PORT", "warm_up": "RISE,TIME",
    "send": "'FORM TARGET [RATE] [A,B]'", "faults": "F", "fixed": "P", "chain": "TOML", "lag": "T", "settle": "T",
    "limit": "ANGLE",
    "max_gap": "T", "max_offset": "T", "burst": "T", "start": "T", "stop": "T", "begin": "T", "end": "T",
    "duration": "T", "tilt_limit": "ANGLE", "declination": "ANGLE", "mount_error": "ANGLE", "high_pass": "HZ",
    "temp_c": "T", "options": "NAME=VALUE", "speed": "K", "device": "ID", "clock_error": "E", "sensors": "A+B",
    "fault_log": "FILE", "path": "FILE", "scale": "LSB", "answers": "KEY=VALUE", "rates": "R,…",
    "data": "FILE", "low": "HZ", "high": "HZ", "response": "CSV",
    "between": "A..B", "against": "NAME", "smooth": "T", "still": "ANGLE", "dwell": "T",
}  # fmt: skip
HELP: Final = {  # what the words of a command line say in a way of their own
    "overwrite": "replace files that exist already; never an input",
    "params": common.PARAMS_HELP,
    "fixed": f"parameters that keep a value: {common.PARAMS_HELP}",
    "date": "day of --place, where the recording does not know it",
    "options": "an option of the format, as gyr_range='500 deg/s'; see 'plumbob list devices NAME'",
    "send": "send the attitude, as 'nmea udp:127.0.0.1:10110 10Hz HDT,PASHR'; see 'plumbob send'; repeatable",
}
QUANTITIES: Final = {"taus": "TIME", "rates": "RATE", "pose": "ANGLE"}  # of a list of numbers; a word stays as it is


class Verb(NamedTuple):
    """What a signature and a docstring do not say of a verb; names are those of parameters."""

    line: str  # of ``plumbob --help``
    page: str  # of the documentation
    example: str  # a command line
    function: str = ""  # public name, or ``module.name`` below `plumbob`; by default that of the verb
    also: tuple[str, ...] = ()  # functions whose parameters the variable keyword of this one takes
    brought: tuple[str, ...] = ()  # what the last of these is for: it is not imported where none of them is given
    named: tuple[str, ...] = ()  # positional parameters that are options
    hidden: tuple[str, ...] = ()  # parameters that no option gives
    repeat: tuple[str, ...] = ()  # options that are given again and again
    optional: tuple[str, ...] = ()  # what may be left out although the function needs it
    outputs: tuple[str, ...] = ("out",)  # files to write
    exclusive: tuple[tuple[str, ...], ...] = ()  # of which one is given at most
    needs: Mapping[str, tuple[str, ...]] = {}  # options that say something of others, of which one must be given
    apart: Mapping[str, tuple[str, ...]] = {}  # options with which others do not go
    writes: Mapping[str, tuple[str, Callable[[Any, Path, argparse.Namespace], object] | None]] = {}
    """Outputs that are named at the end, by a word, and what writes them where the function does not."""
    more: Mapping[str, tuple[str, str]] = {}
    """Options of the command line alone: what stands for the value (none: a switch; with !: needed; with + at the end:
    several), and help; of a parameter, what the help says instead. --force comes with an output."""
    details: tuple[str, ...] = ()  # switches that ask for a further table of the text
    run: str = "show"  # in `plumbob.cli.special`, or ``module.name``: calls, prints and gives the exit code
    code: Callable[[Any], int] | None = None  # exit code by the result
    kinds: Mapping[str, "Verb"] = {}  # what the verb is for, one of which is named behind it
    pages: Callable[[Any, argparse.Namespace], Any] | None = None  # report of the result for --html and --plot
    json: bool = True  # whether there is a summary to print
    ends: Mapping[str, tuple[str, ...]] = {}  # endings that the name of an output must have
    note: str = ""  # last words of the help
    about: str = ""  # its first ones, by default those of the function


VERB_BY_FUNCTION: Final[dict[str, str]] = {  # for words that name a public function; the table of verbs completes it
    "filter_names": "list filters", "plot": "report --figure", "repair": "verify --repair", "tune": "benchmark tune",
}  # fmt: skip


class Option(NamedTuple):
    """A parameter as an option or argument: its annotation as it is written, and whether it names a file."""

    name: str
    parameter: "Parameter"
    function: Call
    type: str
    is_path: bool

    def read(self, text: Any) -> Any:
        """Value of the words of the command line."""
        if not isinstance(text, str):
            return common.named_values(text) if isinstance(text, list) and "Mapping[str, str]" in self.type else text
        if re.search(r"(Sequence|Collection|Iterable)\[str\]", self.type):
            return [] if text == "none" else [word.strip() for word in text.split(",") if word.strip()]
        if "Mapping[" in self.type and not self.is_path:
            return dict(common.pairs(text))
        if self.name in QUANTITIES and not text.isalpha():
            return units.numbers(_flag(self.name), text, units.Quantity[QUANTITIES[self.name]])
        if re.match(r"([\w.]*Sequence\[)?tuple\[float", self.type):
            spans = [units.span(_flag(self.name), word) for word in text.split(",")]
            return spans if "Sequence[" in self.type else spans[0]
        return text


def named_function(path: str) -> Call:
    """What a verb calls, by its public name or as ``module.name``; a public one is not entered by the front door."""
    home, _, last = path.rpartition(".")
    function: Call = getattr(import_module(f"plumbob.{home or plumbob._HOME[path]}"), last)
    return function


def parameters(function: Call, verb: Verb) -> dict[str, Option]:
    """Parameters of a function, and of those that its variable keyword leads to, that a command line can give."""
    from inspect import signature  # which the list of the verbs does without

    options: dict[str, Option] = {}
    documented = described(function)
    for source in (function, *map(named_function, verb.also)):
        for name, parameter in signature(source).parameters.items():
            annotation = parameter.annotation
            type_ = annotation.__name__ if isinstance(annotation, type) else str(annotation).strip("\"'")
            first = source is function or parameter.kind is parameter.KEYWORD_ONLY
            hidden = name in {*FOR_PROGRAMS, *verb.hidden} or "Stopping" in type_
            if first and parameter.kind is not parameter.VAR_KEYWORD and not hidden:
                is_path = bool(re.search(r"\bPath|Source\b", type_))
                home = function if name in documented else source
                options.setdefault(name, Option(name, parameter, home, type_, is_path))
    return options


@cache
def described(function: Call) -> dict[str, tuple[str, str]]:
    """Type and meaning of each parameter, as the docstring has them."""
    from inspect import getdoc

    text = re.search(r"^Parameters\n-+\n(.*?)(?=^\w[\w ]*\n-+$|\Z)", getdoc(function) or "", re.M | re.S)
    entries = {}
    for names, kind, body in re.findall(
        r"^(\S[^:\n]*)(?: : (.*))?\n((?:    .*\n?|\n)*)", text[1] if text else "", re.M
    ):
        for name in names.split(","):
            entries[name.strip(" *")] = (kind, " ".join(body.split()))
    return entries


def meaning(function: Call, name: str) -> str:
    """Help of a parameter; where a docstring sends the reader to another function, what stands there."""
    text = described(function).get(name, ("", ""))[1]
    if sent := re.match(r"(?:As|What .* as) (?:of|in) `(?:plumbob\.)?([\w.]+)`", text):
        home, _, last = sent[1].rpartition(".")
        module = import_module(f"plumbob.{home}" if home else "plumbob")
        there = getattr(module, last, None) or getattr(import_module(function.__module__), last, None)
        text = (there and meaning(there, name)) or text
    text = re.sub(r"^(?:Whether to|Of [\w ]+:) (.)", lambda match: match[1].upper(), text)
    text = re.sub(r"`plumbob\.(\w+)`", lambda match: _verb(match[1]), text)
    return text.replace("`", "").removesuffix(".").replace("%", "%%")


def _verb(name: str) -> str:
    """Verb of a public function, or the function where it has none."""
    return f"'plumbob {VERB_BY_FUNCTION[name]}'" if name in VERB_BY_FUNCTION else f"plumbob.{name}"


def add_verb(parsers: Any, name: str, verb: Verb, words: Sequence[str] | None = None) -> argparse.ArgumentParser:
    """Declare a verb; for `words`, only what they need: their kind, and help where somebody reads it."""
    helped = words is None or "-h" in words or "--help" in words
    if verb.kinds:
        group: argparse.ArgumentParser = parsers.add_parser(
            name, help=verb.line, description=f"{verb.line[0].upper()}{verb.line[1:]}.",
            epilog=ending(verb) if helped else "",
        )  # fmt: skip
        kinds_of = group.add_subparsers(dest="kind", metavar="KIND", required=True)
        for kind, inner in verb.kinds.items():
            if words is None or kind in words[:2]:
                add_verb(kinds_of, kind, inner, words)
            else:
                kinds_of.add_parser(kind, help=inner.line)
        group.set_defaults(parser=group)
        return group
    from inspect import getdoc

    function = named_function(verb.function or name)
    doc = verb.about or getdoc(function) or ""
    about = re.split(r"^\w[\w ]*\n-+$", doc, maxsplit=1, flags=re.M)[0].replace("`", "")
    p: argparse.ArgumentParser = parsers.add_parser(
        name, help=verb.line, description=re.sub(r"(?<=\S)\n(?=\S)", " ", about).strip(),
        epilog=ending(verb) if helped else "",
    )  # fmt: skip
    flags = {word.partition("=")[0] for word in words or ()}
    idle = verb.brought and not helped and not flags & {_flag(each) for each in verb.brought}
    options = parameters(function, verb._replace(also=verb.also[:-1]) if idle else verb)
    groups: dict[str, Any] = {}
    for names in verb.exclusive:
        groups |= dict.fromkeys(names, p.add_mutually_exclusive_group())
    for key, option in options.items():
        kind_said, _ = described(option.function).get(key, ("", ""))
        settings = _settings(option, verb, kind_said, helped=helped)
        if key in verb.more:
            settings["help"] = verb.more[key][1]
        groups.get(key, p).add_argument(*settings.pop("flags"), **settings)
    for key, (value, help_) in ((key, more) for key, more in verb.more.items() if key not in options):
        how: dict[str, Any] = {"metavar": value.rstrip("!+"), "required": "!" in value, "nargs": "+"}
        how = {"action": "store_true"} if not value else how if "+" in value[-1:] else {**how, "nargs": None}
        how |= {"type": {"N": int, "GRADE": float}[value]} if value in ("N", "GRADE") else {}
        groups.get(key, p).add_argument(f"--{key.replace('_', '-')}", dest=key, help=help_, **how)
    for key, page in common.PAGE.items() if verb.pages is not None else ():
        p.add_argument(f"--{key}", **page)
    if "overwrite" not in options and (verb.pages is not None or {"out", *verb.outputs} & {*verb.more} - {*options}):
        p.add_argument("--force", action="store_true", help=HELP["overwrite"])
    if verb.json:
        help_ = "print one JSON object instead of text"
        groups.get("json", p).add_argument("--json", action="store_true", help=help_)
    p.set_defaults(prepare=partial(prepare, verb, function, options), parser=p)
    return p


def ending(verb: Verb) -> str:
    """End of a verb's help: an example, what else to know, and the page of the documentation on a line of its own."""
    note = f"{verb.note}\n\n" if verb.note else ""
    return f"example:\n  {verb.example}\n\n{note}documentation:\n  {guide(verb.page)}"


def _flag(name: str) -> str:
    return f"--{SPELLED.get(name, name).replace('_', '-')}"


def _settings(option: Option, verb: Verb, kind: str, *, helped: bool) -> dict[str, Any]:
    """What argparse is to know of a parameter; whatever is not given is left to the function's own default."""
    name, parameter, type_ = option.name, option.parameter, option.type
    default = parameter.default
    help_ = HELP.get(name) or meaning(option.function, name) if helped else ""
    if helped and default not in (parameter.empty, None, False, "", ()) and "default" not in help_:
        help_ += f" (default {default:g})" if isinstance(default, float) else f" (default {default})"
    if helped and (some := re.search(r".\{(.*?)\}", kind)):
        help_ += f" (any of {some[1].replace(chr(34), '')})"
    settings: dict[str, Any] = {"help": help_, "default": argparse.SUPPRESS}
    if type_.split(" |")[0] == "bool":
        return settings | {"flags": [_flag(name)], "dest": name, "action": "store_true"}
    if type_.split(" |")[0] in ("int", "float") and "str" not in type_:
        settings["type"] = int if type_.startswith("int") else float
    if choices := re.match(r"\{(.*?)\}", kind):
        settings["choices"] = tuple(word.strip(' "') for word in choices[1].split(","))
    else:
        many = re.search(r"(Sequence|Collection|Iterable)\[str", type_)
        settings["metavar"] = SHORT.get(name) or (
            "A,B" if many else "FILE" if option.is_path else "N" if "type" in settings else name.upper()
        )
    if parameter.kind is parameter.KEYWORD_ONLY or name in verb.named:
        settings |= {"flags": [_flag(name)], "dest": name, "required": default is parameter.empty}
        settings["required"] &= name not in verb.optional
        if re.search(r"Sequence\[[\w.]*Path", type_):
            settings["nargs"] = "+"
        return settings | ({"action": "append"} if name in verb.repeat else {})
    settings |= {"flags": [name]}
    if parameter.kind is parameter.VAR_POSITIONAL or re.search(r"(Sequence|Iterable)\[(?!bytes)", type_):
        settings |= {"nargs": "*" if parameter.kind is parameter.VAR_POSITIONAL else "+"}
    elif default is not parameter.empty or name in verb.optional:
        settings |= {"nargs": "?"}
    return settings | ({} if "choices" in settings else {"metavar": SHORT.get(name, name.upper())})


def prepare(verb: Verb, function: Call, options: Mapping[str, Option], args: argparse.Namespace) -> Call:
    """Check what would be written, and give what calls the function and finishes."""
    args.force, args.json = getattr(args, "overwrite", getattr(args, "force", False)), getattr(args, "json", False)
    given = {name: option.read(getattr(args, name)) for name, option in options.items() if hasattr(args, name)}
    if "params" in options and "Mapping[" in options["params"].type:
        chosen = common.filter_args(args.verb, given.get("filter"), getattr(args, "params", None))
        given |= {name: value for name, value in chosen.items() if value}
    args.given, args.pages = given, [getattr(args, name, None) for name in common.ENDINGS]
    _refuse_idle(verb, options, args)
    paths = {name: [Path(file) for file in (value if isinstance(value, list) else [value])]
             for name, value in given.items() if options[name].is_path}  # fmt: skip
    outputs = [file for name in verb.outputs for path in paths.pop(name, ()) for file in common.with_profile(path)]
    more = {name: getattr(args, name) for name, (value, _) in verb.more.items()
            if value and name not in options and (value == "FILE" or name in verb.outputs)}  # fmt: skip
    beside = {name: [*map(Path, path if isinstance(path, list) else [path])] for name, path in more.items() if path}
    outputs += [file for name in verb.outputs for file in beside.pop(name, ())]
    args.inputs = inputs = [file for some in (*paths.values(), *beside.values()) for file in some]
    if outputs or verb.pages is not None:
        common.check_outputs(args, *outputs, *args.pages, inputs=inputs)
    for name, endings in {**({} if verb.pages is None else common.ENDINGS), **verb.ends}.items():
        if path := given.get(name) or getattr(args, name, None):
            common.require_ending(_flag(name), path, endings)
    if getattr(args, "width", None) and verb.pages is not None:
        from plumbob.reporting.drawing import inches

        inches(args.width)  # which refuses one before any work

    def call(to: Call = function, **more: Any) -> Any:
        from inspect import signature

        takes = signature(to).parameters
        takes_all = any(each.kind is each.VAR_KEYWORD for each in takes.values())
        with common.progress_bars() if "progress" in takes else nullcontext() as bars:

            def show(*counts: Any) -> None:
                title, done, total = counts if len(counts) == 3 else (args.verb, *counts)
                assert bars is not None
                bars(title, done, total or done)

            values = {"note": common.note, "progress": show if bars else None, **given, **more}
            named = {name for name in given if options[name].parameter.kind is options[name].parameter.KEYWORD_ONLY}
            values = {name: value for name, value in values.items()
                      if name in takes or (takes_all and name in {*named, *more})}  # fmt: skip
            places = [values.pop(name) for name, each in takes.items()
                      if name in values and each.kind is not each.KEYWORD_ONLY]  # fmt: skip
            if any(each.kind is each.VAR_POSITIONAL for each in takes.values()):
                places = places[0] if places else []
            return to(
                *(place[0] if isinstance(place, list) and len(place) == 1 else place for place in places), **values
            )

    module, _, hook = verb.run.rpartition(".")
    return partial(getattr(import_module(f"plumbob.cli.{module or 'special'}"), hook), args, verb, call)


def _refuse_idle(verb: Verb, options: Mapping[str, Option], args: argparse.Namespace) -> None:
    """Refuse options that would have no effect."""
    given = {name for name, value in vars(args).items() if value is not None and value is not False and value != []}

    def said(name: str) -> str:
        bare = name in options and options[name].parameter.kind is options[name].parameter.VAR_POSITIONAL
        return name.upper() if bare else _flag(name)

    for name, others in verb.apart.items():
        if name in given and (beside := [said(other) for other in others if other in given]):
            raise ParameterError(f"{said(name)} does not go with {', '.join(beside)}; leave one of them out.")
    pages = {} if verb.pages is None else {"lang": ("html", "plot"), "width": ("plot",)}
    for name, others in (pages | dict(verb.needs)).items():
        if name in given and not given & set(others):
            named = " or ".join(map(said, others))
            raise ParameterError(f"{said(name)} is for {named}, which is not given; leave it out.")


def save(result: Any, path: Path, args: argparse.Namespace) -> None:
    """Write a result that can be saved."""
    result.save(path, overwrite=args.force)


def show(args: argparse.Namespace, verb: Verb, result: Any, *lines: str, shown: Any = None, **more: Any) -> int:
    """Write a result, or that of a call, print it or what is shown of it, with further lines or values, and its pages.

    Gives the exit code.
    """
    result = result() if callable(result) else result
    written = {name: Path(path) for name in verb.writes if (path := getattr(args, name, None))}
    for name, path in written.items():
        if write := verb.writes[name][1]:
            write(result, path, args)
    shown = shown or result
    if args.json:
        common.print_json(shown.summary() | more)
    else:
        text = shown.text(*(name for name in verb.details if getattr(args, name)))
        print("\n".join((text, *lines, *(f"{verb.writes[n][0]:12} {path}" for n, path in written.items()))))
    if verb.pages is not None and any(args.pages):
        common.write_pages(args, verb.pages(result, args))
    return 0 if verb.code is None else verb.code(result)
