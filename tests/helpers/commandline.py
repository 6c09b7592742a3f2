"""The command line as a user meets it: streams, folder, exit code.

Most tests call the entry point in this process, which is what a process runs but for its start of a second; tests of
signals, pipes, the environment or a terminal start a process.
"""

import contextlib
import io
import json
import os
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from plumbob.cli.main import main
from plumbob.core.resources import WEB

STREAMS = ("stdin", "stdout", "stderr")
PLUMBOB = (sys.executable, "-m", "plumbob.cli.main")


def call(*words, data=b"", cwd=None, main=main, encoding="utf-8"):
    """Run a command line in this process, that of Plumbob or of another `main`."""
    streams = [io.TextIOWrapper(io.BytesIO(data if name == "stdin" else b""), encoding=encoding) for name in STREAMS]
    kept = [getattr(sys, name) for name in STREAMS]
    words = [*map(str, words)]
    try:
        for name, stream in zip(STREAMS, streams, strict=True):
            setattr(sys, name, stream)
        with contextlib.chdir(cwd or Path.cwd()):
            code = main(words)
    except SystemExit as wrong_usage:
        code = wrong_usage.code
    finally:
        for name, stream in zip(STREAMS, kept, strict=True):
            setattr(sys, name, stream)
    for stream in streams[1:]:
        stream.flush()
    out, err = (stream.buffer.getvalue().decode(errors="replace") for stream in streams[1:])
    return subprocess.CompletedProcess(["plumbob", *words], code or 0, out, err)


def start(*words, cwd=None, program=PLUMBOB, **environment):
    """Run a command line, or that of another program, in a process of its own, to its end."""
    return subprocess.run(
        [*program, *map(str, words)], cwd=cwd, env={**os.environ, **environment}, capture_output=True, text=True,
        errors="replace", check=False, timeout=600,
    )  # fmt: skip


def plumbob(*words, cwd=None, **environment):
    """Run a command line; one that needs an environment of its own gets a process."""
    return start(*words, cwd=cwd, **environment) if environment else call(*words, cwd=cwd)


def ok(*words, **kwargs):
    """Run a command line that must succeed."""
    done = plumbob(*words, **kwargs)
    assert done.returncode == 0, (words, done.returncode, done.stdout, done.stderr)
    return done


def refused(*words, **kwargs):
    """One line on standard error, nothing on standard output, exit 1; returns the line."""
    done = plumbob(*words, **kwargs)
    assert done.returncode == 1, (done.returncode, done.stdout, done.stderr)
    assert done.stdout == ""
    lines = [line for line in done.stderr.splitlines() if not line.startswith("note: ")]
    assert len(lines) == 1, done.stderr
    assert "Traceback" not in done.stderr
    return lines[0]


def typed(line, *more, cwd=None, code=0):
    """Run a command line that is written as in a shell, with more words behind it, and expect an exit code."""
    done = call(*shlex.split(line), *more, cwd=cwd)
    assert done.returncode == code, (line, more, done.returncode, done.stdout, done.stderr)
    return done


def answer(line, *more, cwd=None, code=0):
    """What a command line prints with ``--json``, which is JSON without NaN or Infinity."""
    return json.loads(typed(line, *more, "--json", cwd=cwd, code=code).stdout, parse_constant=pytest.fail)


def table_of(text):
    """Rows of a table that is written as lines of cells with bars between them; a line that begins with # is none."""
    return [[cell.strip() for cell in line.split("|")] for line in text.strip().splitlines() if line[:1] != "#"]


@contextlib.contextmanager
def emulated(folder, words, what="buoy"):
    """An emulated rig as a process, with options as in a shell; gives the link to its line once it is there."""
    command = [*PLUMBOB, "emulate", what, "--seed", "2", "--link", "line", *shlex.split(words)]
    with subprocess.Popen(command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as child:
        try:
            assert child.stdout.readline().startswith("/dev/")
            yield folder / "line"
        finally:
            child.terminate()


def is_built():
    """Whether 'make page' has built the pages, which needs Node."""
    return (WEB / "report.js").is_file()
