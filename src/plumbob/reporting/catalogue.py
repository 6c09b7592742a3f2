"""What there is, `plumbob list`, and how to begin with it, `plumbob start`."""

import inspect
import math
import os
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from plumbob.core.errors import ParameterError, unknown_name
from plumbob.core.resources import packaged
from plumbob.core.text import visible

if TYPE_CHECKING:
    from plumbob.core.params import Parameter
    from plumbob.protocols.format import Format


class Listed(NamedTuple):
    """A list as text, and its values."""

    lines: str
    values: dict[str, Any]

    def text(self, *_details: str) -> str:
        """What is printed."""
        return self.lines.rstrip("\n")

    def summary(self) -> dict[str, Any]:
        """The same as JSON has it."""
        return self.values


def filters(name: str | None = None) -> Listed:
    """List the filters with their sources, what they claim and take, and their parameters with units.

    Of one filter also when to choose it and how it departs from its source.

    Parameters
    ----------
    name : str, optional
        One filter, with its description.
    """
    from plumbob.core.params import describe
    from plumbob.filters import CommonParams, estimator_names, load
    from plumbob.filters.known import EXTENSIBLE, RATE_FILTERS

    rates = [(each, module) for each, module in EXTENSIBLE.usable(RATE_FILTERS) if name in (each, None)]
    of_rates = {each: _entry(module, described=name is not None) for each, module in rates}
    if name in RATE_FILTERS:
        return Listed("\n".join(_entry_lines(name, of_rates[name])), {"rate_filters": of_rates})
    modules = [(name, load(name))] if name is not None else EXTENSIBLE.usable(estimator_names())
    listed = {each: _entry(module, described=name is not None) for each, module in modules}
    shared = [_row(p) for p in describe(CommonParams)]
    of_all, also = ([line for pair in some.items() for line in _entry_lines(*pair)] for some in (listed, of_rates))
    lines = [*of_all, "every filter takes also", *_row_lines(shared)]
    lines += ["filters of rates, which give no attitude", *also] if of_rates else []
    return Listed("\n".join(lines), {"filters": listed, "every_filter": shared, "rate_filters": of_rates})


def _entry(module: Any, *, described: bool) -> dict[str, Any]:
    from plumbob.core.params import describe

    entry = {
        "summary": module.SUMMARY,
        "needs": list(module.NEEDS),
        "references": list(module.REFERENCES),
        "covariance": hasattr(module, "COVARIANCE"),
        "noise_card": hasattr(module, "from_noise"),
        "parameters": [_row(p) for p in describe(module.Params)],
    }
    return entry | {"description": inspect.getdoc(module)} if described else entry


def _row(p: "Parameter") -> dict[str, Any]:
    from plumbob.core.params import allowed, shown

    return {
        "name": p.name,
        "unit": "on/off" if p.switch else str(p.spec.quantity),
        "default": p.default,
        "default_text": shown(p, p.default),
        **{
            name: None if p.switch or math.isinf(end := getattr(p.spec, name)) else float(end)
            for name in ("low", "high")
        },
        "range_text": allowed(p),
        "meaning": p.spec.meaning,
    }  # fmt: skip


def _entry_lines(name: str, entry: dict[str, Any]) -> list[str]:
    claims = "claims a covariance" if entry["covariance"] else "claims no covariance"
    about = [f"\n{entry['description']}\n\nparameters"] if "description" in entry else []
    return [
        f"{name}: {entry['summary']}",
        f"    needs {', '.join(entry['needs'])}; sources {', '.join(entry['references']) or 'none'}",
        f"    {claims}; {'takes a noise card' if entry['noise_card'] else 'takes no noise card'}",
        *about,
        *_row_lines(entry["parameters"]),
    ]


def _row_lines(rows: list[dict[str, Any]]) -> list[str]:
    name, default = (max((len(row[key]) for row in rows), default=0) for key in ("name", "default_text"))
    return [
        f"    {row['name']:{name}}  {row['default_text']:>{default}}  {row['meaning']} [{row['range_text']}]"
        for row in rows
    ]


_HEAD: Final = """\
# Devices

Made by `plumbob list devices --markdown` from the catalogue. Marks: V read in the source named; V1 in one secondary
source only; C computed; UNVERIFIED in none.
"""


def devices(
    name: str | None = None, *, options: Mapping[str, str] | None = None, markdown: bool = False, c: bool = False
) -> Listed:
    """List known devices and rigs, or all that is known of one, or of a frame described in TOML.

    Parameters
    ----------
    name : str, optional
        Device, rig, or TOML file.
    options : mapping of str to str, optional
        Options of the format.
    markdown : bool
        Print Markdown; without a name, the page of the catalogue.
    c : bool
        Print a C11 header for whoever sends or reads the frame.
    """
    from plumbob.protocols.c_header import c_header
    from plumbob.protocols.format_toml import EXTENSIBLE, device_names, find_format
    from plumbob.protocols.page import as_markdown, as_text, tables

    def marked(form: "Format", level: int) -> str:
        return f"{'#' * level} {form.name}\n\n{form.title}.\n\n{as_markdown(tables(form), level + 1)}"

    if name is None:
        if c or options:
            raise ParameterError("name a device; 'plumbob list devices' lists them.")
        page = (marked(form, 2) for _, form in EXTENSIBLE.usable(device_names()))
        return Listed("\n".join([_HEAD, *page]), {}) if markdown else _all_devices()
    form = find_format(name)
    form = form.bind(options) if options or c else form
    if c:
        return Listed(c_header(form), {})
    text = marked(form, 1) if markdown else f"{form.name}: {visible(form.title)}\n\n{as_text(tables(form))}"
    framing = asdict(form.framing) | {"sync": [word.hex() for word in form.framing.sync], "end": form.framing.end.hex()}
    return Listed(text, asdict(form) | {"framing": framing})


def _all_devices() -> Listed:
    from plumbob.protocols.format_toml import EXTENSIBLE, device_names, rig_names
    from plumbob.protocols.page import PageTable, as_text, framing_words, mark_words

    kinds = {}
    for kind, listed in (("Devices", device_names()), ("Rigs", rig_names())):
        forms = EXTENSIBLE.usable(listed)
        kinds[kind] = [(name, form.title, framing_words(form), mark_words(form)) for name, form in forms]
    head = ("name", "title", "frame", "marks")
    shown = [
        PageTable(kind, ("name", "frame", "marks", "title"), tuple((n, f, m, t) for n, t, f, m in rows))
        for kind, rows in kinds.items()
    ]
    values = {kind.lower(): [dict(zip(head, row, strict=True)) for row in rows] for kind, rows in kinds.items()}
    return Listed(as_text(shown), values)


def rigs() -> Listed:
    """List the rigs that `plumbob.emulate` knows, and the kinds of faults of a line."""
    from plumbob.live.rigs.faults import KINDS
    from plumbob.live.rigs.rig import PLANS

    plans = {name: f"{plan.title}; {plan.rate:g} Hz" for name, plan in PLANS.items()}
    groups = {"rigs": plans, "faults, each a share of the frames": KINDS}
    lines = [line for title, rows in groups.items() for line in (title, *(f"    {k:10} {v}" for k, v in rows.items()))]
    return Listed("\n".join(lines), {"rigs": plans, "faults": dict(KINDS)})


def start(
    system: str, folder: str | os.PathLike[str], *, port: str = "/dev/ttyUSB0", overwrite: bool = False
) -> Listed:
    """Write a session, a profile where it needs one, and a page of next steps.

    Parameters
    ----------
    system : {"fin", "buoy", "trackball", "arm", "rod", "text"}
        One of the papers' systems, by its paper's own method, or a board that prints text.
    folder : path
        Where to; made where it is not there.
    port : str
        Serial port of the session.
    overwrite : bool
        Whether files that lie there may be replaced.

    Raises
    ------
    ParameterError
        If no system has that name.
    DecodeError
        If a file exists, or the system refuses to write.
    """
    from plumbob.core.files import require_place, write_text
    from plumbob.core.schema import toml_text

    steps = tomllib.loads(packaged("live/start/steps.toml"))
    systems = (*(name for name, values in steps.items() if isinstance(values, dict)), "text")
    if system not in systems:
        raise unknown_name("system", system, systems)
    page = steps["text"] if system == "text" else steps["rig"].format(name=system, **steps[system])
    names = [f"{system}.toml", *[f"{system}.profile.toml"] * (system == "text")]
    texts = {name: packaged(f"live/start/{name}").replace('"/dev/ttyUSB0"', toml_text(port)) for name in names}
    texts["next.md"] = page.lstrip()
    home = Path(folder)
    home.mkdir(parents=True, exist_ok=True)
    for name in texts:
        require_place(home / name, overwrite=overwrite)
    written = [str(write_text(home / name, text, overwrite=overwrite)) for name, text in texts.items()]
    return Listed("\n".join((*written, f"next         {home / 'next.md'}")), {"written": written})


def scenarios() -> Listed:
    """List scenarios with their parameters, chains and their programs, and sensors, for `plumbob.simulate`."""
    from plumbob.simulation import CHAINS, PROGRAMS, SCENARIOS, preset, preset_names

    values = {
        "scenarios": {name: _first_line(kind) for name, kind in SCENARIOS.items()},
        "chains": {n: ", ".join(f"{joint.name} ({joint.kind})" for joint in c.joints) for n, c in CHAINS.items()},
        "programs": {name: _first_line(program) for name, program in PROGRAMS.items()},
        "sensors": {name: preset(name).title for name in preset_names()},
    }
    return Listed("\n".join(_scenario_lines(values)), values)


def _first_line(what: Any) -> str:
    return (what.__doc__ or "").splitlines()[0]


def _scenario_lines(values: Mapping[str, Mapping[str, str]]) -> Iterator[str]:
    from plumbob.core.params import describe, shown
    from plumbob.simulation import SCENARIOS
    from plumbob.simulation.bodies import SETTINGS

    for name, kind in SCENARIOS.items():
        yield f"{name}: {values['scenarios'][name]}"
        yield from (f"    {p.name:16} {shown(p, p.default):>14}  {p.spec.meaning}" for p in describe(kind))
    yield "chains, for --chain, and what they may do instead of a scenario"
    yield from (f"    {name:18} {text}" for part in ("chains", "programs") for name, text in values[part].items())
    yield f"    settings: {', '.join(SETTINGS)}"
    yield "sensors, joined by +"
    yield from (f"    {name:18} {title}" for name, title in values["sensors"].items())
