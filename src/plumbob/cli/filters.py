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
        epilog=common.more("plumbob filters mekf", "choose-a-filter.md"),
    )
    p.add_argument("name", nargs="?", metavar="NAME", help="one filter, with its description")
    common.add_json(p)
    p.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Do it."""
    from plumbob.core.params import describe
    from plumbob.filters import CommonParams, channel, estimator_names, load
    from plumbob.filters.known import RATE_FILTERS

    if args.name in RATE_FILTERS:
        listed = {args.name: _entry(channel.load(args.name), described=True)}
        if args.json:
            common.print_json({"rate_filters": listed})
        else:
            _print_entry(args.name, listed[args.name])
        return 0
    names = estimator_names() if args.name is None else (args.name,)
    listed = {name: _entry(load(name), described=args.name is not None) for name in names}
    shared = [_row(p) for p in describe(CommonParams)]
    of_rates = {} if args.name else {name: _entry(channel.load(name), described=False) for name in RATE_FILTERS}
    if args.json:
        common.print_json({"filters": listed, "every_filter": shared, "rate_filters": of_rates})
        return 0
    for name, entry in listed.items():
        _print_entry(name, entry)
    print("every filter takes also")
    _print_rows(shared)
    if of_rates:
        print("filters of rates, which give no attitude")
    for name, entry in of_rates.items():
        _print_entry(name, entry)
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
    from plumbob.core.params import allowed, shown

    return {
        "name": p.name,
        "unit": "on/off" if p.switch else str(p.spec.quantity),
        "default": p.default,
        "default_text": shown(p, p.default),
        "low": _bound(p, p.spec.low),
        "high": _bound(p, p.spec.high),
        "range_text": allowed(p),
        "meaning": p.spec.meaning,
    }


def _bound(p: "Parameter", value: float) -> float | None:
    """Bound in the unit inside; None for a switch, and where there is none."""
    return None if p.switch or math.isinf(value) else float(value)


def _print_entry(name: str, entry: dict[str, Any]) -> None:
    print(f"{name}: {entry['summary']}")
    print(f"    needs {', '.join(entry['needs'])}; sources {', '.join(entry['references'])}")
    claims = "claims a covariance" if entry["covariance"] else "claims no covariance"
    print(f"    {claims}; {'takes a noise card' if entry['noise_card'] else 'takes no noise card'}")
    if "description" in entry:
        print(f"\n{entry['description']}\n\nparameters")
    _print_rows(entry["parameters"])


def _print_rows(rows: list[dict[str, Any]]) -> None:
    name, default = (max((len(row[key]) for row in rows), default=0) for key in ("name", "default_text"))
    for row in rows:
        print(f"    {row['name']:{name}}  {row['default_text']:>{default}}  {row['meaning']} [{row['range_text']}]")
