"""The gate that lets the size of the house only fall: what is measured, beside what house.toml allows.

``make house`` prints all figures and writes down those that fell; ``make test`` fails where one rose, and names the
files that raised it, found against the commit that changed house.toml last. A figure is raised by hand, in a commit
whose subject line has the words 'raise' and 'budget'.
"""

import argparse
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
from collections import Counter
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path

from gates.figures import Figure, figures

ROOT = Path(__file__).resolve().parents[1]
WALKED = ("functions_entered.", "depth.")  # of a walk that is left out, its figures stay
WALKS = Path(__file__).with_name("walks.py")
HEAD = """\
# The size of the house, as measured last. 'make house' prints each figure and writes down what fell; what rises fails
# 'make test', with the files that raised it. To raise a figure, edit it here, in a commit whose subject line says
# 'Raise the budget of …' and why. gates/figures.py and walks.py say how each is counted.
"""
EXPLAINED = {
    "lines": "lines of Python",
    "files": "files of Python",
    "functions": "functions of the package: how many are long, and lines that only tests and benchmarks reach",
    "functions_entered": "functions that a verb's second run enters",
    "depth": "functions of the package on each other in that run",
    "names": "names that say nothing of what they hold",
    "text": "texts",
    "tests": "in tests",
    "circles": "circles of imports",
    "closures": "lines of the files that a room comes to by all its imports, in functions too, but for those for types",
}


def measure(root: Path) -> dict[str, Figure]:
    """All figures of a checkout by file, its walks among them."""
    found = figures(root)
    for walk, told in walks(root).items():
        found[f"functions_entered.{walk}"] = dict(
            Counter("src/plumbob/" + name.partition(":")[0] for name in told["entered"])
        )
        found[f"depth.{walk}"] = {"": told["depth"]}
    return found


def walks(root: Path) -> dict[str, dict]:
    """What each walk enters, in a process of its own."""
    environment = {**os.environ, "OMP_NUM_THREADS": "1"}
    done = subprocess.run(
        [sys.executable, str(WALKS), str(root)], env=environment, capture_output=True, text=True, check=False
    )
    if done.returncode:
        raise RuntimeError(f"A walk of the house did not end well:\n{done.stdout[-2000:]}{done.stderr[-4000:]}")
    print(done.stderr, end="")
    return json.loads(done.stdout)


def budgets(text: str) -> dict[str, int]:
    """Figures of house.toml by 'table.name'."""
    return {f"{table}.{name}": most for table, rows in tomllib.loads(text).items() for name, most in rows.items()}


def written(figures_now: Mapping[str, int]) -> str:
    """Text of house.toml."""
    tables: dict[str, list[str]] = {}
    for key, value in figures_now.items():
        table, _, name = key.partition(".")
        tables.setdefault(table, []).append(f"{name} = {value}")
    parts = (f"[{table}]  # {EXPLAINED[table]}\n" + "\n".join(tables[table]) for table in EXPLAINED if table in tables)
    return HEAD + "\n" + "\n\n".join(parts) + "\n"


def rises(found: Mapping[str, Figure], allowed: Mapping[str, int], root: Path) -> Iterator[str]:
    """A sentence for each figure that is above what is allowed, with the files that raised it."""
    for key, figure in found.items():
        value, most = sum(figure.values()), allowed.get(key)
        if most is None:
            yield f"{key} is {value}, and house.toml has no such figure. Write it down there, if the room may be new."
        elif value > most:
            raised = raisers(root, key, figure)
            blamed = f"raised by {', '.join(raised)}" if raised else "nothing in git says by which file"
            yield f"{key} rose from {most} to {value}: {blamed}. Merge or delete as much, or raise the budget."


def raisers(root: Path, key: str, figure: Figure) -> list[str]:
    """Files of which the figure has grown since house.toml was changed last, the most first."""
    before = _before(root)
    if before is None or key.startswith("depth."):
        return []
    grown = {name: value - before.get(key, {}).get(name, 0) for name, value in figure.items()}
    return [f"{name} (+{more})" for name, more in sorted(grown.items(), key=lambda one: -one[1]) if more > 0][:5]


@cache
def _before(root: Path) -> dict[str, Figure] | None:
    """Figures of the commit that changed house.toml last; None without git."""
    commit = git(root, "log", "-1", "--format=%H", "--", "house.toml").strip()
    if not commit:
        return None
    with tempfile.TemporaryDirectory() as folder:
        archive = subprocess.run(["git", "archive", commit], cwd=root, capture_output=True, check=True)
        subprocess.run(["tar", "-x", "-C", folder], input=archive.stdout, check=True)
        try:
            return measure(Path(folder))
        except RuntimeError:  # it needs what this environment does not have
            return figures(Path(folder))


def git(root: Path, *words: str) -> str:
    """What git prints of a checkout; nothing where it fails, is not installed or does not know the folder."""
    if not (root / ".git").exists() or shutil.which("git") is None:
        return ""
    return subprocess.run(["git", *words], cwd=root, capture_output=True, text=True, check=False).stdout


def silent_raises(root: Path, count: int = 30) -> Iterator[str]:
    """A sentence for each of the last commits that raised a figure and whose subject line does not say so."""
    for line in git(root, "log", f"-{count}", "--no-merges", "--format=%H %s", "--", "house.toml").splitlines():
        commit, _, subject = line.partition(" ")
        old, new = (git(root, "show", f"{at}:house.toml") for at in (f"{commit}~", commit))
        was, now = budgets(old), budgets(new)
        raised = [key for key, value in now.items() if was and value > was.get(key, 0)]
        if raised and not (re.search(r"\brais", subject, re.I) and re.search(r"\bbudget", subject, re.I)):
            yield f"Commit {commit[:10]} raised {', '.join(raised)} and does not say so: {subject!r}."


def main(words: list[str]) -> int:
    """Check, or print and write down with ``--write``; ``--root`` names another checkout."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--write", action="store_true", help="print all figures, and write down those that fell")
    parser.add_argument("--root", type=Path, default=ROOT, help="a checkout, default: this one")
    args = parser.parse_args(words)
    place = args.root / "house.toml"
    allowed = budgets(place.read_text(encoding="utf-8")) if place.exists() else {}
    found = measure(args.root)
    if args.write:
        now = {key: sum(figure.values()) for key, figure in found.items()}
        for key, value in now.items():
            print(f"{key:44}{value:8}{allowed.get(key, ''):>8}")
        kept = {key: most for key, most in allowed.items() if key in now or key.startswith(WALKED)}
        lowest = {key: min(now.get(key, most), most) for key, most in (kept or now).items()}
        place.write_text(written(lowest), encoding="utf-8")
        allowed = allowed or lowest
    refusals = [*rises(found, allowed, args.root), *silent_raises(args.root)]
    print(*refusals, sep="\n", end="\n" if refusals else "")
    return int(bool(refusals))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
