"""Make the extension ``plumbob._kernels`` beside the package: C of the kernels, one object for each room."""

import contextlib
import hashlib
import importlib.abc
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from importlib.machinery import ModuleSpec
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType
from typing import Any

from plumbob.core.kernels import CHECKOUT, PACKAGE, STAMP, content_hash, is_checkout

FLAGS = (
    "-O3", "-std=c99", "-fPIC", "-fwrapv", "-ffp-contract=off", "-fno-math-errno", "-fno-trapping-math",
    "-fno-builtin-pow", "-fvisibility=hidden",
)  # fmt: skip
"""No contraction of products and sums and nothing beyond the baseline processor: the same bits everywhere. Nobody reads
errno or the processor's floating-point flags; a power of 2 is the library's own, and not another function's."""
LIBRARIES = ("scipy", "pyarrow", "platformdirs", "rich", "mcap", "serial")
"""What modules with kernels import and kernels do without; where one is missing, an empty one stands for it."""
TARGETS = {
    "manylinux_2_28_x86_64": "x86_64-linux-gnu.2.28",
    "manylinux_2_28_aarch64": "aarch64-linux-gnu.2.28",
    "macosx_11_0_x86_64": "x86_64-macos.11.0",
    "macosx_11_0_arm64": "aarch64-macos.11.0",
    "win_amd64": "x86_64-windows-gnu",
}
"""Other machines that zig compiles for on this one: platforms of wheels, and zig's names of them."""


ZIG = (sys.executable, "-m", "ziglang")


class BuildError(Exception):
    """No extension could be made."""


def compiler() -> list[str]:
    """Words that call a C compiler: the one that CC names, the system's, or zig's from PyPI; empty where none is."""
    if named := os.environ.get("CC"):
        return named.split()
    for program in ("cc", "gcc", "clang"):
        if shutil.which(program):
            return [program]
    return [*ZIG, "cc"] if find_spec("ziglang") else []


class _Absent(ModuleType):
    """Stands for a library that is not there while Plumbob is built: no kernel needs one but NumPy."""

    __path__ = ()  # type: ignore[assignment]

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        return type(name, (), {"__class_getitem__": classmethod(lambda cls, item: cls)})


class _Absence(importlib.abc.MetaPathFinder, importlib.abc.Loader):
    def find_spec(self, fullname: str, path: Any = None, target: Any = None) -> ModuleSpec | None:
        return ModuleSpec(fullname, self, is_package=True) if fullname.partition(".")[0] in LIBRARIES else None

    def create_module(self, spec: ModuleSpec) -> ModuleType:
        return _Absent(spec.name)

    def exec_module(self, module: ModuleType) -> None:
        pass


@contextlib.contextmanager
def alone(folder: Path) -> Iterator[None]:
    """Let one process at a time build."""
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / ".lock").open("w") as lock:
        if sys.platform != "win32":
            import fcntl

            fcntl.flock(lock, fcntl.LOCK_EX)
        yield


def build(folder: Path | None = None, target: str = "") -> tuple[Path, Path]:
    """Make the extension, and only what has changed of it; gives it, and the file that says of which sources it is.

    `folder` is for C and objects, by default ``build/kernels`` of a checkout, or a temporary one. A target is built for
    that machine, by zig, into the folder; without one for this machine, beside the package.
    """
    if folder is None and (target or is_checkout()):
        folder = CHECKOUT / "build" / "kernels" / target
    if folder is None:
        with tempfile.TemporaryDirectory() as place:
            return build(Path(place))
    words = [*ZIG, "cc", "-target", TARGETS[target]] if target else compiler()
    if not words:
        raise BuildError("There is no C compiler. Install one, or ziglang from PyPI.")
    absence = _Absence()
    sys.meta_path.append(absence)
    try:
        from plumbob.core.kernels import emit

        emit.kernels()
    finally:
        sys.meta_path.remove(absence)
    with alone(folder):
        files = list(emit.write(folder))
        with ThreadPoolExecutor(os.cpu_count()) as pool:
            objects = list(
                pool.map(lambda file: compiled(words, file), sorted(files, key=lambda file: -file.stat().st_size))
            )
        made, stamp = folder / extension_file(target), folder / STAMP.name
        link(words, objects, made, target)
        sources = emit.sources()
        stamp.write_text(json.dumps({"hash": content_hash(sources), "files": sources}, indent=0), encoding="utf-8")
        if target:
            return made, stamp
        for file in (made, stamp):
            shutil.copy(file, part := PACKAGE / f".{file.name}.tmp")
            part.replace(PACKAGE / file.name)
    return PACKAGE / made.name, STAMP


def extension_file(target: str = "") -> str:
    """File of the extension on a machine, by default this one."""
    return f"_kernels.{'pyd' if _is_windows(target) else 'abi3.so'}"


def _is_windows(target: str) -> bool:
    return target.startswith("win") if target else os.name == "nt"


def compiled(words: list[str], file: Path) -> Path:
    """Object of a file of C, made again where the C, a header or the compiler is another."""
    content = [path.read_bytes() for path in (file, *sorted(file.parent.glob("*.h")))]
    mark = hashlib.sha256(b"".join(content) + repr((Path(words[0]).name, words[1:], FLAGS)).encode()).hexdigest()[:16]
    target = file.with_name(f"{file.stem}-{mark}.o")
    if not target.is_file():
        for old in file.parent.glob(f"{file.stem}-*.o"):
            old.unlink()
        part = target.with_suffix(".part")
        _run([*words, *FLAGS, "-c", str(file), "-o", str(part)])
        part.replace(target)
    return target


def link(words: list[str], objects: list[Path], made: Path, target: str = "") -> None:
    """Make one extension of objects; what it needs of Python is found when Python loads it."""
    python: list[str] = []
    if target.startswith("macosx") if target else sys.platform == "darwin":
        python = ["-undefined", "dynamic_lookup"]
    elif _is_windows(target):
        python = [str(_import_library(made.parent))]
    _run([*words, "-shared", *python, "-o", str(made), *map(str, objects), "-lm"])


def _import_library(folder: Path) -> Path:
    """What Windows' linker asks for: which names python3.dll has, those of our header."""
    header = (Path(__file__).parent / "python.h").read_text(encoding="utf-8")
    functions = re.findall(r"^FROM_PYTHON [^(]*?(\w+)\(", header, flags=re.MULTILINE)
    objects = re.findall(r"^FROM_PYTHON PyObject ([^(]*);", header, flags=re.MULTILINE)
    names = [*functions, *(f"{name} DATA" for line in objects for name in re.findall(r"\w+", line))]
    listed, library = folder / "python3.def", folder / "python3.lib"
    listed.write_text("\n".join(["LIBRARY python3.dll", "EXPORTS", *names, ""]), encoding="ascii")
    _run([*ZIG, "dlltool", "-m", "i386:x86-64", "-d", str(listed), "-l", str(library)])
    return library


def _run(words: list[str]) -> None:
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    if done.returncode:
        raise BuildError(f"{' '.join(words[:3])} … ended with {done.returncode}:\n{done.stderr[-4000:]}")
