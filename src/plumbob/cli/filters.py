"""plumbob filters: what can estimate, and with which parameters."""

import argparse
from typing import TYPE_CHECKING, Any

from plumbob.cli import common

if TYPE_CHECKING:
    from plumbob.params import Parameter


def add_parser(verbs: common.Adder) -> None:
    """Declare the verb."""
    p = verbs.add_parser(
        "filters",
        help="list the filters with their parameters, units and defaults",
        description="List the filters with their sources, and their parameters with units, defaults and meanings.",
    )
    common.add_json(p)
    p.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Do it."""
    from plumbob.filters import CommonParams, filter_names, load
    from plumbob.params import describe

    listed = {name: _entry(load(name)) for name in filter_names()}
    shared = [_row(p) for p in describe(CommonParams)]
    if args.json:
        common.print_json({"filters": listed, "every_filter": shared})
        return 0
    for name, entry in listed.items():
        print(f"{name}: {entry['summary']}")
        print(f"    needs {', '.join(entry['needs'])}; sources {', '.join(entry['references'])}")
        _print_rows(entry["parameters"])
    print("every filter takes also")
    _print_rows(shared)
    return 0


def _entry(module: Any) -> dict[str, Any]:
    from plumbob.params import describe

    return {
        "summary": module.SUMMARY,
        "needs": list(module.NEEDS),
        "references": list(module.REFERENCES),
        "parameters": [_row(p) for p in describe(module.Params)],
    }


def _row(p: "Parameter") -> dict[str, Any]:
    from plumbob.params import shown

    unit = "on/off" if p.switch else str(p.spec.quantity)
    text = shown(p, p.default)
    return {"name": p.name, "unit": unit, "default": p.default, "default_text": text, "meaning": p.spec.meaning}


def _print_rows(rows: list[dict[str, Any]]) -> None:
    for row in rows:
        unit = "" if row["default_text"] != "off" or row["unit"] == "on/off" else f" [{row['unit']}]"
        print(f"    {row['name']:12} {row['default_text']:>14}  {row['meaning']}{unit}")
