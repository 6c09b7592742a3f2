"""A filter in C for a program without Python gives the bits of the one here."""

import ctypes
import re
import subprocess
import sys

import numpy as np
import pytest

import plumbob as pb
from plumbob.core.kernels import build
from plumbob.core.kernels.emit import export


@pytest.mark.parametrize(("name", "frame"), [("mahony", "ENU"), ("mekf", "NED")])
def test_an_exported_filter_gives_the_same_bits(tmp_path, name, frame):
    assert [file.name for file in export(name, tmp_path, frame)] == [f"{name}.h", f"{name}.c", "kernels.h"]
    words = (*build.compiler(), *build.FLAGS, "-fvisibility=default", "-Wall", "-Werror", "-shared", f"{name}.c")
    subprocess.run([*words, "-o", "filter.so", "-lm"], cwd=tmp_path, check=True)
    header = (tmp_path / f"{name}.h").read_text(encoding="utf-8")
    size, attitude, bias = (
        int(re.search(pattern, header)[1])
        for pattern in (r"double state\[(\d+)\];", r"from state\[(\d+)\] the att", r"from state\[(\d+)\] the gyr")
    )
    program = ctypes.CDLL(str(tmp_path / "filter.so"))
    state = (ctypes.c_double * size).from_buffer_copy((ctypes.c_double * size).in_dll(program, f"{name}_start"))
    update = getattr(program, f"{name}_update")
    update.argtypes = [ctypes.c_void_p, ctypes.c_int64, ctypes.c_void_p]
    update.restype = ctypes.c_int64
    here, rng = pb.Filter(name, frame=frame), np.random.default_rng(1)
    for k in range(500):
        values = rng.normal(size=9) + [0.0, 0.0, 0.0, 0.0, 0.0, 9.8 if frame == "ENU" else -9.8, 20.0, 0.0, 40.0]
        values[6:] = np.nan if k % 7 else values[6:]
        said = update(state, 10_000_000 * k, np.ascontiguousarray(values).ctypes.data)
        now = here.update(pb.ImuSample(10_000_000 * k, *values.reshape(3, 3)))
        assert (said, state[attitude : attitude + 4]) == (now, list(here.q_nb))
        assert state[bias : bias + 3] == list(here.bias_b)


def test_the_command_writes_it_and_says_what_has_no_step(tmp_path):
    words = [sys.executable, "-m", "plumbob.core.kernels", "export"]
    done = subprocess.run([*words, "vqf", "--out", tmp_path], capture_output=True, text=True, check=True)
    assert done.stdout.split() == [str(tmp_path / name) for name in ("vqf.h", "vqf.c", "kernels.h")]
    wrong = subprocess.run([*words, "smoother", "--out", tmp_path], capture_output=True, text=True, check=False)
    assert (wrong.returncode, "FixedLag" in wrong.stderr) == (1, True)
