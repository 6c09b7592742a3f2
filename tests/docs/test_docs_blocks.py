"""The code on the first page and in the documents runs and prints what it says."""

import contextlib
import io
import os
import re
import shlex
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest

from benchmarks.harness.__main__ import main as measure
from plumbob import profile, read
from plumbob.core.constants import G0
from plumbob.core.resources import guide
from plumbob.live.emulated import running_rig
from tests.helpers.commandline import call, is_built, start

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
SOURCES = (ROOT / "src").rglob("*.py")
CITED = re.compile(r"""guide\(["']([^"']+)["']\)""")
NOT_PRINTED = {"noise.md": "of an hour", "own-csv.md": "a file, tested below"}
NAMED = re.compile(r"# (\w+\.(toml|csv|py))\n")
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```", re.MULTILINE | re.DOTALL)


# s of CPU: what these show, the tests of their rooms show in less
DEAR = {
    "console": {"arm.md": 24, "fleet.md": 4, "noise.md": 4},
    "python": {"in-python.md": 10, "arm.md": 5, "estimator.md": 4, "fleet.md": 2},
}


def pages(kind):
    """All pages; those whose blocks are dear are run before a release."""
    dear = {name: [pytest.mark.long(reason=f"{seconds} s of CPU")] for name, seconds in DEAR[kind].items()}
    return [pytest.param(page, marks=dear.get(page.name, ()), id=page.name) for page in PAGES]


def blocks(page):
    return BLOCK.findall(page.read_text(encoding="utf-8"))


def write_named_files(page, folder):
    """A block whose first line is a comment with a file's name is that file; a table has no such line in it.

    A project is installed, as pip does it. Whether a page has one, whose lines then need processes of their own.
    """
    for _, text in blocks(page):
        if name := NAMED.match(text):
            (folder / name[1]).write_text(text[name.end() :] if name[2] == "csv" else text, encoding="utf-8")
            if name[1] == "pyproject.toml":
                install(tomllib.loads(text)["project"], folder)
    return (folder / "pyproject.toml").exists()


def install(project, folder):
    """What pip leaves of a project beside its module."""
    info = folder / f"{project['name'].replace('-', '_')}-{project['version']}.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Name: {project['name']}\nVersion: {project['version']}\n")
    groups = project["entry-points"].items()
    lines = [f"[{group}]\n{name} = {where}\n" for group, names in groups for name, where in names.items()]
    (info / "entry_points.txt").write_text("".join(lines))


@pytest.mark.parametrize("page", pages("python"))
def test_python_blocks_print_what_follows_them(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    installed, names = write_named_files(page, tmp_path), {}
    found = blocks(page)
    for (kind, code), (after, text) in zip(found, [*found, ("", "")][1:], strict=True):
        if kind == "python" and not NAMED.match(code):
            printed = io.StringIO()
            with contextlib.redirect_stdout(printed):
                if installed:
                    printed.write(start("-c", code, cwd=tmp_path, program=(sys.executable,)).stdout)
                else:
                    exec(compile(code, page.name, "exec"), names)
            if after == "text":
                assert printed.getvalue() == text


@pytest.mark.parametrize("page", pages("console"))
def test_console_blocks_run_and_print_what_follows_them(page, tmp_path):
    """Lines of the text that follows are printed, in this order; '…' stands for others."""
    run = start if write_named_files(page, tmp_path) else call
    found = blocks(page)
    for (kind, code), (after, text) in zip(found, [*found, ("", "")][1:], strict=True):
        if kind == "console":
            if re.search("plumbob report|--report", code) and not is_built():
                pytest.skip("the pages are not built: run 'make page'")
            with contextlib.ExitStack() as beside:
                printed = iter("".join(output(line, tmp_path, run, beside) for line in code.splitlines()).splitlines())
            shown = text.splitlines() if after == "text" and page.name not in NOT_PRINTED else []
            assert [line for line in shown if line != "…" and line not in printed] == [], page.name


def output(line, folder, run, beside):
    """What a line of a console prints; those that need a network or a checkout are not run, a rig beside it."""
    words = shlex.split(line.removeprefix("$ "), comments=True)
    if words[-1] == "&":
        with contextlib.chdir(folder):
            return beside.enter_context(running_rig(*words[2:-1]))
    if words[:3] == ["python", "-m", "benchmarks.harness"]:
        done = call(*words[3:], cwd=folder, main=measure)
    elif words[0] == "plumbob":
        done = run(*words[1:], cwd=folder)
    else:
        assert words[0] in {"git", "make", "pip"}, line
        return ""
    assert done.returncode == 0, (line, done.stderr)
    return done.stdout


def test_the_drafted_profile_is_the_one_that_is_shown(tmp_path):
    page = ROOT / "docs" / "own-csv.md"
    write_named_files(page, tmp_path)
    shown = next(text for kind, text in blocks(page) if kind == "text")
    assert profile(tmp_path / "log.csv").text == shown
    imu = read(tmp_path / "log.csv", profile=tmp_path / "logger.toml").imu
    assert np.mean(imu.acc[:10], axis=0) == pytest.approx([0.0, 0.0, G0], abs=0.02)  # level at first, noise of 1 mg


def test_the_first_page_shows_python_and_its_output():
    kinds = [kind for kind, _ in blocks(ROOT / "README.md")]
    assert kinds[:3] == ["console", "python", "text"]
    code = blocks(ROOT / "README.md")[1][1]
    assert len([line for line in code.splitlines() if line.strip()]) <= 12


def test_links_lead_to_files():
    for page in PAGES:
        for link in re.findall(r"\]\(([^)#:]+)\)", page.read_text(encoding="utf-8")):
            assert (page.parent / link).exists(), (page.name, link)


def test_every_page_that_a_message_names_is_there_and_in_the_wheel():
    named = {name for file in SOURCES for name in CITED.findall(file.read_text(encoding="utf-8"))}
    assert {"file-formats.md", "formats.md", "sessions.md"} <= named
    included = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    folders = included["tool"]["hatch"]["build"]["targets"]["wheel"]["force-include"]
    assert folders["docs"] == "plumbob/docs"
    assert all((ROOT / "docs" / page).is_file() and guide(page) == f"docs/{page}" for page in named)


def test_an_installed_package_names_its_own_pages(tmp_path):
    """The package copied as the wheel has it, with its docs inside, and nothing of the checkout in reach."""
    package = tmp_path / "lib" / "plumbob"
    for part in ("__init__.py", *(f"core/{name}.py" for name in ("__init__", "errors", "resources", "text"))):
        (package / part).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / "src" / "plumbob" / part, package / part)
    shutil.copytree(ROOT / "docs", package / "docs")
    code = "import plumbob; from plumbob.core.resources import docs_folder, guide; "
    code += "print(docs_folder(), guide('time.md'), plumbob.docs('time'), sep='\\n')"
    env = {**os.environ, "PYTHONPATH": str(package.parent)}
    words = [sys.executable, "-c", code]
    said = subprocess.run(words, env=env, cwd=tmp_path, capture_output=True, text=True, check=True)
    folder, page, text = said.stdout.split("\n", 2)
    assert (folder, page) == (str(package / "docs"), str(package / "docs" / "time.md"))
    assert text.strip() == (ROOT / "docs" / "time.md").read_text(encoding="utf-8").strip()
