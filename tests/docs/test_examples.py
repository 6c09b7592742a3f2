"""The numbered scripts and the notebooks run, and print what they say."""

import contextlib
import io
import json
import runpy
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))
NOTEBOOKS = sorted((ROOT / "examples").glob("*.ipynb"))


@pytest.mark.parametrize("script", EXAMPLES, ids=lambda script: script.stem)
def test_an_example_prints_what_it_says(script, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "Agg")  # draws into files, without a window
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        names = runpy.run_path(str(script), run_name="__main__")
    shown = names["__doc__"].partition("It prints::\n\n")[2]
    assert printed.getvalue().splitlines() == [line.removeprefix("    ") for line in shown.splitlines()]


def test_examples_are_numbered_and_short():
    assert [script.name[:3] for script in EXAMPLES] == [f"{i:02}_" for i in range(1, len(EXAMPLES) + 1)]
    assert {script.name for script in EXAMPLES if len(script.read_text(encoding="utf-8").splitlines()) > 40} == set()


@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda notebook: notebook.stem)
def test_a_notebook_prints_what_it_shows(notebook, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    names = {}
    for cell in json.loads(notebook.read_text(encoding="utf-8"))["cells"]:
        if cell["cell_type"] == "code":
            printed = io.StringIO()
            with contextlib.redirect_stdout(printed):
                exec(compile("".join(cell["source"]), notebook.name, "exec"), names)
            assert printed.getvalue() == "".join("".join(output["text"]) for output in cell["outputs"])
