"""plumbob filters: what can estimate, with which parameters, and what one of them is for."""

import argparse
import inspect
import math
from typing import TYPE_CHECKING, Any

from plumbob.cli import common

if TYPE_CHECKING:
    from plumbob.core.params import Parameter


def add_parser(verbs: common.Adder) -> None:
    """Declare the verb."""
    p = verbs.add_parser(
        "filters",
        help="list the filters with their parameters, units, defaults and ranges",
        description="List the filters with their sources, what they claim and take, and their parameters with units, "
        "defaults, ranges and meanings; of one filter also when to choose it and how it departs from its source.",
    )
    p.add_argument("name", nargs="?", metavar="NAME", help="one filter, with its description")
    common.add_json(p)
    p.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Do it."""
    from plumbob.core.params import describe
    from plumbob.filters import CommonParams, filter_names, load

    names = filter_names() if args.name is None else (args.name,)
    listed = {name: _entry(load(name), described=args.name is not None) for name in names}
    shared = [_row(p) for p in describe(CommonParams)]
    if args.json:
        common.print_json({"filters": listed, "every_filter": shared})
        return 0
    for name, entry in listed.items():
        _print_entry(name, entry)
    print("every filter takes also")
    _print_rows(shared)
    return 0


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
    from plumbob.core.params import shown

    return {
        "name": p.name,
        "unit": "on/off" if p.switch else str(p.spec.quantity),
        "default": p.default,
        "default_text": shown(p, p.default),
        "low": _bound(p, p.spec.low),
        "high": _bound(p, p.spec.high),
        "range_text": _range(p),
        "meaning": p.spec.meaning,
    }


def _bound(p: "Parameter", value: float) -> float | None:
    """Bound in the unit inside; None for a switch, and where there is none."""
    return None if p.switch or math.isinf(value) else float(value)


def _range(p: "Parameter") -> str:
    """Allowed values in the unit in which a value is shown, and whether it may be off."""
    from plumbob.core.params import shown

    low, high = _bound(p, p.spec.low), _bound(p, p.spec.high)
    if p.switch:
        return "on, off"
    if low is not None and high is not None:
        text = f"{shown(p, low).partition(' ')[0]} to {shown(p, high)}"
    elif low is not None:
        text = f"{shown(p, low)} and more"
    else:
        text = "any" if high is None else f"up to {shown(p, high)}"
    return f"{text}, or off" if p.optional else text


def _print_entry(name: str, entry: dict[str, Any]) -> None:
    print(f"{name}: {entry['summary']}")
    print(f"    needs {', '.join(entry['needs'])}; sources {', '.join(entry['references'])}")
    claims = "claims a covariance" if entry["covariance"] else "claims no covariance"
    print(f"    {claims}; {'takes a noise card' if entry['noise_card'] else 'takes no noise card'}")
    if "description" in entry:
        print(f"\n{entry['description']}\n\nparameters")
    _print_rows(entry["parameters"])


def _print_rows(rows: list[dict[str, Any]]) -> None:
    for row in rows:
        print(f"    {row['name']:12} {row['default_text']:>14}  {row['meaning']} [{row['range_text']}]")
