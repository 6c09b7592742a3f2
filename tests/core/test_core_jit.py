"""The door to numba: what is compiled, cached, shared and survived, mostly in fresh processes on a copy."""

import ast
import json
import os
import shutil
import stat
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest

import plumbob
from plumbob.core import _jit
from plumbob.core._jit import njit, specialise
from plumbob.rotations import kernels

SOURCE = Path(plumbob.__file__).parent

CALLEE = """
from plumbob.core._jit import njit


@njit
def gain(x):
    return {factor} * x
"""
PROBE = """
from plumbob.core._jit import njit, specialise
from plumbob.filters.callee import gain


@njit
def caller(x):
    return gain(x) + 1.0


@njit
def double(x):
    return 2.0 * x


@njit
def halve(x):
    return 0.5 * x


@njit
def step(x):
    return x


@njit
def loop(n, x):
    for _ in range(n):
        x = step(x)
    return x


doubling, halving = (specialise(loop, "loop", step=s) for s in (double, halve))
"""
REPORT = """
import json, sys
import numba
hits = lambda k: sum(k.compiled.stats.cache_hits.values())
print(json.dumps({
    "caller": probe.caller(10.0), "doubling": probe.doubling(3, 1.0), "halving": probe.halving(3, 1.0),
    "hits": [hits(k) for k in (probe.caller, probe.doubling, probe.halving)], "numba_folder": numba.config.CACHE_DIR,
}))
"""


def planted(root):
    """A copy of the ground floor with one more module of kernels and its callee in another file."""
    package = root / "plumbob"
    (package / "filters").mkdir(parents=True)
    shutil.copy(SOURCE / "__init__.py", package / "__init__.py")
    for room in ("core", "rotations"):
        shutil.copytree(SOURCE / room, package / room, ignore=shutil.ignore_patterns("__pycache__"))
    (package / "filters" / "__init__.py").touch()
    (package / "filters" / "callee.py").write_text(CALLEE.format(factor=3.0))
    (package / "filters" / "probe.py").write_text(PROBE)
    return root


@pytest.fixture(scope="module")
def tree(tmp_path_factory):
    """The copy, which no test changes."""
    return planted(tmp_path_factory.mktemp("copy") / "tree")


@pytest.fixture(scope="module")
def filled(tree, tmp_path_factory):
    """A cache that one process has filled, which no test changes, and what that process said."""
    cache = tmp_path_factory.mktemp("filled") / "cache"
    return cache, probe(tree, cache, before="from plumbob.core import _jit; assert _jit.is_cold('loop')")


@pytest.fixture
def cache(filled, tmp_path):
    """A copy of the cache that is filled."""
    return shutil.copytree(filled[0], tmp_path / "cache")


def python(code, **settings):
    """Run code in a fresh process; return what it prints as JSON."""
    return json.loads(process(code, **settings).stdout)


def process(code, *, tree=None, **environment):
    env = {k: v for k, v in os.environ.items() if k not in {"NUMBA_DISABLE_JIT", "PLUMBOB_CACHE_DIR"}}
    env |= {"PYTHONDONTWRITEBYTECODE": "1", **({"PYTHONPATH": str(tree)} if tree else {}), **environment}
    env = {k: v for k, v in env.items() if v is not None}
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", code], env=env, capture_output=True, text=True, check=False, timeout=120
    )
    assert done.returncode == 0, done.stderr
    return done


def probe(tree, cache, before="", **environment):
    code = f"import plumbob.filters.probe as probe\n{before}\n{REPORT}"
    return python(code, tree=tree, PLUMBOB_CACHE_DIR=str(cache), **environment)


def cached_files(folder):
    return sorted(folder.rglob("*.nb?"))


def right(found, factor=3.0):
    return (found["caller"], found["doubling"], found["halving"]) == (10.0 * factor + 1.0, 8.0, 0.125)


def test_cache_is_filled_and_used(tree, filled):
    cache, first = filled
    assert right(first)
    assert first["hits"] == [0, 0, 0]
    assert cached_files(cache)
    second = probe(tree, cache, before="from plumbob.core import _jit; assert not _jit.is_cold('loop')")
    assert right(second)
    assert second["hits"] == [1, 1, 1]
    assert not cached_files(tree)


def test_cache_is_never_stale(tmp_path):
    """A callee's edit, a specialised twin, an edit between import and compilation: each must reach the caller."""
    tree, cache = planted(tmp_path / "tree"), tmp_path / "cache"
    callee = tree / "plumbob" / "filters" / "callee.py"
    edit = f"open({str(callee)!r}, 'w').write({CALLEE.format(factor=5.0)!r})"
    assert right(probe(tree, cache, before=edit), factor=3.0)  # this process imported the old source
    edited = probe(tree, cache)
    assert right(edited, factor=5.0)
    assert edited["hits"][0] == 0


def test_a_folder_that_others_can_write_is_not_unpickled(tree, cache, tmp_path):
    """What lies in a cache runs as code when it is read; and one line says that it was not."""
    folder, ran = next(cache.iterdir()), tmp_path / "ran"
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700
    code = f"import plumbob.filters.probe as probe\n{REPORT}"
    for path in cached_files(cache):
        path.write_bytes(f"cbuiltins\nopen\n(V{ran}\nVw\ntR.".encode())  # a pickle that opens a file for writing
    folder.chmod(0o777)
    done = process(code, tree=tree, PLUMBOB_CACHE_DIR=str(cache))
    assert right(json.loads(done.stdout))
    assert not ran.exists()
    assert done.stderr.count(f"compiled kernels are not kept: {folder} is another user's") == 1
    folder.chmod(0o755)
    process("import plumbob.filters.probe as probe; probe.halving(3, 1.0)", tree=tree, PLUMBOB_CACHE_DIR=str(cache))
    assert ran.exists()  # so the file would have run


def test_whoever_could_write_in_the_cache_or_replace_it_is_noticed(tmp_path, monkeypatch):
    monkeypatch.setenv("PLUMBOB_CACHE_DIR", str(tmp_path / "cache"))
    assert _jit.why_no_cache() is None
    folder = _jit.cache_folder()
    (folder / "filters_1").mkdir()
    (folder / "filters_1").chmod(0o775)  # as an umask of 002 leaves it, in a folder that is closed to others
    assert _jit.why_no_cache() is None
    (folder / "filters_1").chmod(0o755)
    folder.chmod(0o755)
    for place in (folder.parent, folder, folder / "filters_1"):
        before = stat.S_IMODE(place.stat().st_mode)
        place.chmod(0o777)
        assert str(place) in _jit.why_no_cache()
        assert _jit.is_cold("anything")
        place.chmod(before)
        assert _jit.why_no_cache() is None
    folder.parent.chmod(0o1777)  # as /tmp: others can write there, but not take away what is not theirs
    assert _jit.why_no_cache() is None


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() != 0, reason="only root can give a folder away")
def test_a_folder_of_another_user_is_not_used(tmp_path, monkeypatch):
    monkeypatch.setenv("PLUMBOB_CACHE_DIR", str(tmp_path))
    assert _jit.why_no_cache() is None
    os.chown(_jit.cache_folder(), 65534, -1)
    assert "another user's" in _jit.why_no_cache()


NOBODY = """
import os, pwd
def nobody(uid): raise KeyError(uid)
pwd.getpwuid = nobody"""
FULL = "; import resource; resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))"
GONE = {"HOME": None, "PLUMBOB_CACHE_DIR": None, "XDG_CACHE_HOME": None}


@pytest.mark.parametrize(("before", "environment"), [(NOBODY, GONE), (FULL, {})], ids=["no home", "full disk"])
def test_without_a_home_or_room_there_is_no_cache(tree, tmp_path, before, environment):
    """An unknown user without HOME: '~' stays '~', and must not become a folder of that name."""
    code = f"import os; os.chdir({str(tmp_path)!r}){before}\nimport plumbob.filters.probe as probe\n{REPORT}"
    assert right(python(code, tree=tree, **{"PLUMBOB_CACHE_DIR": str(tmp_path / "cache")} | environment))
    assert not cached_files(tmp_path)
    assert not (tmp_path / "~").exists()


def test_a_compilation_says_so_once_on_standard_error(tree, cache, tmp_path):
    """Without any set-up and where warnings are errors; and not where nothing is compiled, or somebody said it.

    A cache in a folder that cannot be written is none, and not one beside the sources, where nothing notices an edit in
    another file.
    """
    impatient = "from plumbob.core import _jit; _jit._WAITING._left = 0.0"
    code = f"import plumbob.filters.probe as probe; {impatient}; {{}}; assert probe.caller(1.0) == 4.0"
    new = {"tree": tree, "PLUMBOB_CACHE_DIR": str(tmp_path / "new")}
    said = process(code.format("pass"), **new).stderr.splitlines()
    assert len(said) == 1
    assert said[0].startswith("note: compiling Plumbob's kernels for this processor, which takes some seconds, once")
    assert str(tmp_path / "new") in said[0]
    assert process(code.format("pass"), tree=tree, PLUMBOB_CACHE_DIR=str(cache)).stderr == ""  # all is kept

    (tmp_path / "file").touch()
    uncached = {"tree": tree, "PLUMBOB_CACHE_DIR": str(tmp_path / "file")}
    silent = "import logging; logging.getLogger('plumbob').setLevel('ERROR')"
    assert process(code.format(silent), **uncached).stderr == ""
    assert "at each run: no cache can be kept" in process(code.format("pass"), **uncached).stderr
    assert not cached_files(tree)


def test_what_is_damaged_or_from_elsewhere_costs_only_a_compilation(tree, cache, tmp_path):
    """What a power cut leaves: names without content, halves of files."""
    for i, path in enumerate(cached_files(cache)):
        os.truncate(path, [0, 20, path.stat().st_size // 2][i % 3])
    repaired = probe(tree, cache)
    assert right(repaired)
    assert repaired["hits"] == [0, 0, 0]
    assert probe(tree, cache)["hits"] == [1, 1, 1]
    # their sources are not in the fingerprint, so an edit in one would leave the other stale
    (tmp_path / "elsewhere.py").write_text(PROBE.replace("plumbob.filters.callee", "outside"))
    (tmp_path / "outside.py").write_text(CALLEE.format(factor=7.0))
    before = f"import sys; sys.path.insert(0, {str(tmp_path)!r}); import elsewhere as probe"
    assert right(probe(tree, tmp_path / "other", before=before), factor=7.0)
    assert not cached_files(tmp_path / "other")


def test_threads_that_call_first_at_the_same_time(tree, tmp_path):
    """Numba's cache folder is a global: without a lock it is left behind, or missed, and files land in the tree."""
    threads = """
import threading, sys
from plumbob.rotations import kernels
sys.setswitchinterval(1e-6)
work = [
    (probe.caller, (10.0,), 31.0), (probe.doubling, (3, 1.0), 8.0), (probe.halving, (3, 1.0), 0.125),
    (kernels.cross, (1.0, 0.0, 0.0, 0.0, 1.0, 0.0), (0.0, 0.0, 1.0)),
    (kernels.quat_unit, (0.0, 0.0, 0.0, 2.0), (0.0, 0.0, 0.0, 1.0)),
]
wrong, barrier = [], threading.Barrier(10)
def run(kernel, args, expected):
    barrier.wait()
    try:
        if kernel(*args) != expected:
            wrong.append(kernel)
    except Exception as error:
        wrong.append(error)
crew = [threading.Thread(target=run, args=job) for job in 2 * work]
[t.start() for t in crew]; [t.join() for t in crew]
assert not wrong, wrong
"""
    found = probe(tree, tmp_path / "cache", before=threads)
    assert right(found)
    assert found["numba_folder"] == ""
    assert not cached_files(tree)
    names = {path.name.split("-")[0] for path in cached_files(tmp_path / "cache")}
    assert {"probe.caller", "probe.loop", "kernels.cross", "kernels.quat_unit", "callee.gain"} <= names


ARGUMENTS = {
    "quat_mul": (0.1, -0.7, 0.3, 0.6, 0.5, 0.2, -0.4, 0.7),
    "cross": (0.1, -0.7, 0.3, 0.6, 0.5, 0.2),
    "rotate": (0.5, -0.1, 0.7, -0.5, 9.1, -0.3, 1e-3),
    "rows": (0.5, -0.1, 0.7, -0.5),
    "third_row": (0.5, -0.1, 0.7, -0.5),
    "quat_unit": (0.5, -0.1, 0.7, 0.2),
    "half_angle": (0.75,),
    "quat_exp": (0.5, -0.1, 0.7),
}


def test_plain_python_gives_the_same_bits_and_needs_no_numba():
    assert set(ARGUMENTS) == {name for name, value in vars(kernels).items() if isinstance(value, _jit.Kernel)}
    code = f"""
import json, sys
from plumbob.rotations import kernels
found = {{name: [x.hex() for x in getattr(kernels, name)(*args)] for name, args in {ARGUMENTS!r}.items()}}
assert "numba" not in sys.modules
print(json.dumps(found))"""
    plain = python(code, NUMBA_DISABLE_JIT="1")
    assert plain == {name: [x.hex() for x in getattr(kernels, name)(*args)] for name, args in ARGUMENTS.items()}


def imported_from(tree):
    """Names in a module and the file of this package that each comes from."""
    found = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "plumbob":
            for alias in node.names:
                parts = [*node.module.split(".")[1:], alias.name]
                as_module = SOURCE.joinpath(*parts).with_suffix(".py")
                found[alias.asname or alias.name] = as_module if as_module.exists() else SOURCE.joinpath(
                    *parts[:-1]
                ).with_suffix(".py")  # fmt: skip
    return found


def is_kernel(node):
    return isinstance(node, ast.FunctionDef) and any(
        getattr(d, "id", "") in {"njit", "njit_reassociated"} for d in node.decorator_list
    )


def test_all_that_a_kernel_uses_is_in_the_fingerprint():
    """Else an edit there leaves the compiled kernel as it was."""
    count = 0
    for path in sorted(SOURCE.rglob("*.py")):
        if "njit" not in (text := path.read_text(encoding="utf-8")):
            continue
        module = ast.parse(text)
        origin = imported_from(module)
        for kernel in filter(is_kernel, ast.walk(module)):
            count += 1
            assert str(path) in _jit._SOURCES, f"{path} holds kernels, but _jit._KERNEL_SOURCES does not name it"
            used = {n.id for statement in kernel.body for n in ast.walk(statement) if isinstance(n, ast.Name)}
            for name in used & set(origin):
                assert str(origin[name]) in _jit._SOURCES, f"{kernel.name} uses {name} from {origin[name]}"
    assert count > len(ARGUMENTS)


class TestInProcess:
    def test_a_kernel_keeps_its_name_is_compiled_at_its_first_call_and_divides_as_numpy_does(self):
        def never():
            raise AssertionError

        assert kernels.rotate.__name__ == "rotate"
        assert "unit quaternion" in kernels.rotate.__doc__
        assert kernels.rotate.compiled is kernels.rotate.compiled
        assert njit(never)._compiled is None
        # error_model="numpy": no exception inside a step
        if _jit.jit_disabled():
            pytest.skip("plain Python raises")
        assert np.isnan(divide(0.0, 0.0))
        assert np.isinf(divide(1.0, 0.0))

    @pytest.mark.parametrize(("value", "off"), [("1", True), ("0", False), ("", False), (None, False)])
    def test_switch(self, monkeypatch, value, off):
        if value is None:
            monkeypatch.delenv("NUMBA_DISABLE_JIT", raising=False)
        else:
            monkeypatch.setenv("NUMBA_DISABLE_JIT", value)
        assert _jit.jit_disabled() is off

    def test_cold_until_something_is_cached(self, monkeypatch, tmp_path):
        monkeypatch.delenv("NUMBA_DISABLE_JIT", raising=False)
        monkeypatch.setenv("PLUMBOB_CACHE_DIR", "")  # as good as none, and not the working directory
        assert _jit.cache_folder().is_absolute()
        monkeypatch.setenv("PLUMBOB_CACHE_DIR", str(tmp_path))
        assert _jit.cache_folder().parent == tmp_path
        assert _jit.is_cold("loop")
        _jit.cache_folder().mkdir()
        (_jit.cache_folder() / "base.loop_twin-0a1b-52.py311.nbi").touch()
        assert _jit.is_cold("loop")
        (_jit.cache_folder() / "base.loop-0a1b-52.py311.nbi").touch()
        assert not _jit.is_cold("loop")
        monkeypatch.setenv("NUMBA_DISABLE_JIT", "1")
        assert not _jit.is_cold("other")

    def test_a_wait_is_said_once_and_not_before_its_time(self, caplog, monkeypatch):
        waiting = _jit._Waiting(patience=1e6)
        monkeypatch.setattr(_jit, "_WAITING", waiting)
        times = iter([0.0, 4e5, 5e5, 1.2e6])
        monkeypatch.setattr(_jit.time, "monotonic", lambda: next(times))
        for _ in range(2):  # two waits, with a callee in each
            waiting.begin()
            waiting.begin()
            waiting.end()
            waiting.end()
        assert waiting._left == 0.0  # 4e5 and 7e5 of 1e6 s
        assert not caplog.messages
        monkeypatch.setattr(_jit.time, "monotonic", lambda: 0.0)
        waiting.begin()
        waiting._alarm.join(timeout=60.0)
        waiting.end()
        waiting.begin()
        assert waiting._alarm is None
        assert [message.partition(" for ")[0] for message in caplog.messages] == ["note: compiling Plumbob's kernels"]

    def test_what_the_command_line_said_is_not_said_again(self, caplog, monkeypatch):
        monkeypatch.setattr(_jit, "_WAITING", _jit._Waiting(patience=0.0))
        assert _jit.compiling("mekf").startswith("compiling mekf for this processor, which takes some seconds, ")
        _jit._WAITING.begin()
        assert _jit._WAITING._alarm is None
        _jit._WAITING.end()
        _jit._WAITING.say()
        assert not caplog.messages

    def test_specialised_copies_leave_the_pattern_alone(self, monkeypatch):
        monkeypatch.setenv("NUMBA_DISABLE_JIT", "1")

        @njit
        def twice(x):
            return 2.0 * x

        @njit
        def thrice(x):
            return 3.0 * x

        two, three = (specialise(pattern, "copy", inner=k) for k in (twice, thrice))
        assert (pattern(1.0), two(1.0), three(1.0)) == (2.0, 3.0, 4.0)
        assert two.py_func.__qualname__ != three.py_func.__qualname__
        assert two.py_func.__qualname__ == specialise(pattern, "copy", inner=twice).py_func.__qualname__


@njit
def inner(x):
    return x


@njit
def pattern(x):
    return inner(x) + 1.0


@njit
def divide(a, b):
    return a / b


@pytest.mark.skipif(sys.platform == "win32", reason="the system has no such locks")
def test_one_process_at_a_time_adds_to_the_cache(tmp_path):
    """Two that number their files by the index that they read before would give two kernels one number."""
    import fcntl

    added = threading.Event()

    class Cache:
        cache_path = str(tmp_path)

        def save_overload(self, *_args):
            added.set()

    with (tmp_path / ".lock").open("w") as other:
        fcntl.flock(other, fcntl.LOCK_EX)
        adding = threading.Thread(target=_jit._Forgiving(Cache()).save_overload, args=(None, None))
        adding.start()
        assert not added.wait(0.1)
    assert added.wait(10.0)
    adding.join()
