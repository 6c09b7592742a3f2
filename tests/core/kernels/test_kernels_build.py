"""The extension is never of other sources than those that run, and where there is none, Python runs and says so."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from plumbob.core import kernels
from plumbob.core.kernels import build

ROOT = Path(__file__).parents[3]
CODE = """
import json
from plumbob.core import kernels
from plumbob.rotations.kernels import cross
print(cross(1.0, 0.0, 0.0, 0.0, 1.0, 0.0), kernels.extension() is not None)
"""


@pytest.fixture
def checkout(tmp_path):
    """A copy of the package, built, with what makes it a checkout."""
    ignored = shutil.ignore_patterns("__pycache__", "web", "docs")
    shutil.copytree(ROOT / "src" / "plumbob", tmp_path / "src" / "plumbob", ignore=ignored)
    for name in ("pyproject.toml", "hatch_build.py"):
        shutil.copy(ROOT / name, tmp_path / name)
    objects = ROOT / "build" / "kernels"
    if objects.is_dir():
        shutil.copytree(objects, tmp_path / "build" / "kernels")
    return tmp_path


def run(checkout, **environment):
    """What CODE prints, and what is said beside it."""
    env = {**os.environ, "PLUMBOB_KERNELS": "", "PYTHONPATH": str(checkout / "src"), **environment}
    env["PYTHONDONTWRITEBYTECODE"] = "1"  # it is known by the second and size of its source
    words = [sys.executable, "-c", CODE]
    done = subprocess.run(words, cwd=checkout, env=env, capture_output=True, text=True, check=True)
    return done.stdout.strip(), done.stderr


def test_an_edited_kernel_is_made_again_and_one_without_c_runs_as_python(checkout):
    assert run(checkout) == ("(0.0, 0.0, 1.0) True", "")
    file = checkout / "src" / "plumbob" / "rotations" / "kernels.py"
    text = file.read_text(encoding="utf-8")
    old = "return ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx"
    assert old in text
    file.write_text(text.replace(old, f"{old} + 1.0"), encoding="utf-8")
    assert run(checkout) == ("(0.0, 0.0, 2.0) True", "")
    (checkout / "hatch_build.py").unlink()  # no checkout any more: nothing is built
    file.write_text(text.replace(old, f"{old} + 2.0"), encoding="utf-8")
    found, said = run(checkout)
    assert found == "(0.0, 0.0, 3.0) False"
    assert said.count("kernels in C are not built, or from other sources, so they run as Python") == 1


def test_a_compiler_is_the_one_that_is_named_the_systems_or_zig(monkeypatch, tmp_path):
    monkeypatch.setenv("CC", "clang -m64")
    assert build.compiler() == ["clang", "-m64"]
    monkeypatch.delenv("CC")
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr(build, "find_spec", lambda name: None)
    assert build.compiler() == []
    monkeypatch.setattr(build, "find_spec", lambda name: name)
    assert build.compiler()[1:] == ["-m", "ziglang", "cc"]
    (tmp_path / "gcc").write_text("#!/bin/sh\n")
    (tmp_path / "gcc").chmod(0o700)
    assert build.compiler() == ["gcc"]


def test_without_a_compiler_or_with_one_that_fails_nothing_is_replaced(monkeypatch, tmp_path):
    assert kernels.extension()
    before = kernels.STAMP.read_bytes()
    monkeypatch.setattr(build, "compiler", list)
    with pytest.raises(build.BuildError, match="Install one, or ziglang"):
        build.build(tmp_path)
    monkeypatch.setattr(build, "compiler", lambda: ["false"])
    with pytest.raises(build.BuildError, match=r"false.* ended with 1"):
        build.build(tmp_path)
    assert kernels.STAMP.read_bytes() == before
    assert kernels.is_fresh()
