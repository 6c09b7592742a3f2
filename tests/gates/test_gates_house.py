"""The gate of the house, on a house of a few lines: what rises is refused, by name; what falls is written down."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from gates import PYTEST
from tests.helpers import beside

ROOT = Path(__file__).parents[2]
MAIN = beside(__file__, "house_main.txt")
STEPS = beside(__file__, "house_steps.txt")

FILES = {
    "src/plumbob/__init__.py": '"""A house."""\n', "src/plumbob/cli/__init__.py": "", "src/plumbob/cli/main.py": MAIN,
    "src/plumbob/core/__init__.py": "", "src/plumbob/core/steps.py": STEPS, "tests/a.py": "", "benchmarks/a.py": "",
    "gates/a.py": "",
}  # fmt: skip


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """A checkout with its house.toml, as git has it."""
    folder = tmp_path_factory.mktemp("house")
    for name, text in FILES.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
    git(folder, "init", "-q")
    gate(folder, "--write")
    commit(folder, "Build it")
    return folder


@pytest.fixture
def house(built):
    """The checkout as it was built, whatever a test does to it."""
    first = git(built, "rev-list", "--max-parents=0", "HEAD").strip()
    yield built
    git(built, "reset", "-q", "--hard", first)
    git(built, "clean", "-qfd")


def git(folder, *words):
    who = ("-c", "user.name=a", "-c", "user.email=a@b")
    return subprocess.run(["git", *who, *words], cwd=folder, capture_output=True, text=True, check=True).stdout


def commit(folder, subject):
    git(folder, "add", "-A")
    git(folder, "commit", "-q", "-m", subject)


def gate(folder, *words):
    command = [sys.executable, "-m", "gates.house", "--root", str(folder), *words]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)


def test_a_house_as_it_was_measured_passes(house):
    done = gate(house)
    assert (done.returncode, done.stdout) == (0, ""), done.stderr


def test_what_rises_is_refused_with_the_file_that_raised_it(house):
    """A function on the way of a verb, a file, and a circle, each planted."""
    planted = STEPS + '\n\ndef other(verb):\n    """Take another."""\n    return verb\n'
    (house / "src/plumbob/core/steps.py").write_text(planted.replace("len(verb)", "len(other(verb))"))
    (house / "src/plumbob/core/one.py").write_text("from plumbob.core import two\n")
    (house / "src/plumbob/core/two.py").write_text("from plumbob.core import one\n")
    done = gate(house)
    assert done.returncode == 1, done.stderr
    rose = dict(line.split(" rose ", 1) for line in done.stdout.splitlines())
    steps, one = "src/plumbob/core/steps.py", "src/plumbob/core/one.py"
    for walk in ("run_smoother", "decode"):  # main, step; and other
        assert rose[f"functions_entered.{walk}"].startswith(f"from 2 to 3: raised by {steps} (+1).")
    assert rose["depth.run_mahony"].startswith("from 2 to 3")
    assert rose["files.core"].startswith(f"from 2 to 4: raised by {one} (+1), src/plumbob/core/two.py (+1).")
    assert rose["lines.core"].startswith(f"from 6 to 13: raised by {steps} (+5), {one} (+1)")
    assert rose["circles.files"].startswith(f"from 0 to 1: raised by {one}, src/plumbob/core/two.py (+1).")


def test_what_falls_is_written_down_and_may_not_rise_again(house):
    (house / "src/plumbob/core/steps.py").write_text('def step(verb):\n    """Take a step."""\n')
    assert gate(house, "--write").returncode == 0
    assert "\ncore = 2\n" in (house / "house.toml").read_text()
    (house / "src/plumbob/core/steps.py").write_text(STEPS)
    done = gate(house)
    assert done.returncode == 1
    assert "lines.core rose from 2 to 6" in done.stdout


def test_a_figure_that_is_raised_must_be_said_in_the_subject_line(house):
    place = house / "house.toml"
    place.write_text(place.read_text().replace("core = 6\n", "core = 60\n"))
    commit(house, "Tidy up")
    done = gate(house)
    assert done.returncode == 1
    assert "raised lines.core and does not say so: 'Tidy up'" in done.stdout
    git(house, "commit", "-q", "--amend", "-m", "Raise the budget of core: a room for steps")
    assert gate(house).returncode == 0


def test_a_worker_that_dies_is_a_failure_and_ends_the_run(tmp_path):
    # It dies once another worker ran two files: by then no work is being sent to it.
    dies = "    while len(list(PLACE.glob('*.ran'))) < 2:\n        time.sleep(0.01)\n    os._exit(3)\n"
    lines = "import os, pathlib, time\n\nPLACE = pathlib.Path(__file__).parent\n\ndef test_a():\n"
    (tmp_path / "test_a.py").write_text(f"{lines}{dies}\ndef test_b():\n    pass\n")
    for name in "bcd":
        (tmp_path / f"test_{name}.py").write_text(f"{lines}    (PLACE / '{name}.ran').touch()\n")
    words = (*PYTEST, "-n", "2", "-q", "-c", ROOT / "pyproject.toml", "--rootdir", tmp_path, tmp_path)
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, check=False, timeout=300)
    assert done.returncode == 1
    assert "crashed while running 'test_a.py::test_a'" in done.stdout


def test_the_library_may_import_no_program(tmp_path):
    ignored = shutil.ignore_patterns("__pycache__", "web", "_kernels.*")
    shutil.copytree(ROOT / "src" / "plumbob", tmp_path / "src" / "plumbob", ignore=ignored)
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    planted = tmp_path / "src" / "plumbob" / "noise" / "card.py"
    planted.write_text(planted.read_text("utf-8") + "\nfrom plumbob.live import stream\n", "utf-8")
    words = [sys.executable, "-c", "from importlinter.cli import lint_imports_command; lint_imports_command()"]
    env = {**os.environ, "PYTHONPATH": str(tmp_path / "src")}
    done = subprocess.run(words, cwd=tmp_path, env=env, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "plumbob.noise is not allowed to import plumbob.live" in done.stdout
