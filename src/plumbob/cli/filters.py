"""plumbob filters: what can estimate, and with which parameters."""

import argparse
from typing import Any

from plumbob.cli import common


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


def _row(p: Any) -> dict[str, Any]:
    unit = "on/off" if p.switch else str(p.spec.quantity)
    return {"name": p.name, "unit": unit, "default": p.default, "meaning": p.spec.meaning}


def _print_rows(rows: list[dict[str, Any]]) -> None:
    for row in rows:
        default = row["default"]
        shown = {None: "off", True: "on", False: "off"}.get(default) if default in (None, True, False) else None
        if isinstance(default, float):
            shown = f"{default:g}"
        print(f"    {row['name']:12} {shown:>10} {row['unit']:7} {row['meaning']}")
