"""Kernels as C: all of the package, a file for each room, for Python to call; or of one filter, without Python."""

import ast
from collections import defaultdict
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from types import FunctionType
from typing import Any

from plumbob.core.kernels import PACKAGE, Kernel, bare, name_in_extension
from plumbob.core.kernels import sources as subset
from plumbob.core.kernels.translate import Translator, order, typed, writes

HERE = Path(__file__).parent
KINDS = {"f64": "d", "i64": "lq", "u64": "LQ", "u32": "IL", "u8": "B", "truth": "?"}
HEAD = """/* Made by plumbob.core.kernels of the Python in plumbob/{room}. */
#include "python.h"
#include "kernels.h"
#include "door.h"
"""


def kernels() -> list[Kernel[..., Any]]:
    """Every kernel of the package, and those that its modules say they specialise."""
    by_id: dict[int, Kernel[..., Any]] = {}
    for file in sorted(PACKAGE.rglob("*.py")):
        if "@kernel" not in file.read_text(encoding="utf-8"):
            continue
        name = ".".join(("plumbob", *file.relative_to(PACKAGE).with_suffix("").parts))
        module = import_module(name)
        specialised = module.specialised() if hasattr(module, "specialised") else []
        for value in (*vars(module).values(), *specialised):
            if isinstance(value, Kernel) and value is not bare:
                by_id.setdefault(id(value), value)
    return list(by_id.values())


def rooms() -> dict[str, list[FunctionType]]:
    """Functions of all kernels by room."""
    by_room: dict[str, dict[str, FunctionType]] = defaultdict(dict)
    for kernel in kernels():
        func = subset.kernel_function(kernel)
        by_room[subset.room_name(func)].setdefault(subset.name_in_c(func), func)
    for func in (func for funcs in by_room.values() for func in funcs.values()):
        typed(func)  # all that is known of the fields of named tuples, before any is written
    typed.cache_clear()
    return {room: list(funcs.values()) for room, funcs in sorted(by_room.items())}


def unit(room: str, funcs: list[FunctionType]) -> str:
    """One file of C."""
    parts = list(order(funcs))
    entries = [door(part) for part in parts if part.func in set(funcs)]
    table = "\n".join(f'    {{"{key}", (PyCFunction)(void (*)(void))door_{name}, METH_FASTCALL, NULL}},'
                      for name, key, _ in entries)  # fmt: skip
    return "\n".join([
        HEAD.format(room=room),
        text(parts),
        *("\n" + text for _, _, text in entries),
        f"\nPyMethodDef kernels_of_{room}[] = {{\n{table}\n    {{NULL, NULL, 0, NULL}},\n}};\n",
    ])  # fmt: skip


def text(parts: list[Translator]) -> str:
    """C of kernels, each behind those that it calls, and before them the structs that they need."""
    structs = {name: struct for part in parts for name, struct in part.structs.items()}
    return "\n".join([*(struct.declaration() for struct in structs.values()), *("\n" + part.written for part in parts)])


def door(part: Translator) -> tuple[str, str, str]:
    """Name, key and C of the function by which Python calls a kernel."""
    key, written = name_in_extension(part.func), writes(part.func)
    if (count := sum(map(arrays, part.parameters.values()))) > 64:
        raise subset.UnsupportedError(f"{key} takes {count} arrays, but at most 64 are possible")
    lines, names = [], []
    for at, kind in enumerate(part.parameters.values()):
        lines.append(f"    {kind} a{at} = {{0}};")
        names.append(f"a{at}")
    lines.append("    Held held; held.open = 0;")
    lines.append("    PyObject *answer = NULL;")
    lines.append(f'    if (!are("{key}", {len(names)}, count)) return NULL;')
    for at, (name, kind) in enumerate(part.parameters.items()):
        lines += taken(f"a{at}", kind, f"args[{at}]", name in written, f"{key}, {name}")
    call = f"{part.name}({', '.join(names)})"
    others_run = "    void *thread = PyEval_SaveThread();", "    PyEval_RestoreThread(thread);"
    leave, come_back = others_run if loops(part) else ("", "")
    lines += ["    Way_out way;", "    way_out = &way;", leave, "    if (setjmp(way.back)) {", come_back]
    lines += [f'        is_outside("{key}", &way);', "        goto out;", "    }"]
    if part.answer == subset.NOTHING:
        lines += [f"    {call};", come_back, "    answer = &_Py_NoneStruct;", "    Py_IncRef(answer);"]
    else:
        lines += [f"    {part.answer} found = {call};", come_back, f"    answer = {given('found', part.answer)};"]
    lines += ["out:", "    let_go(&held);", "    return answer;"]
    head = f"static PyObject *door_{part.name}(PyObject *self, PyObject *const *args, Py_ssize_t count) {{"
    return part.name, key, "\n".join([head, "    (void)self;", *filter(None, lines), "}"])


def arrays(kind: subset.Type) -> int:
    """How many arrays a value of a type is, or holds."""
    return sum(map(arrays, kind.items)) if isinstance(kind, subset.Several) else int(isinstance(kind, subset.Array))


def loops(part: Translator) -> bool:
    """Whether a kernel may take long, so that other threads go on meanwhile."""
    return "for (" in part.written and any(isinstance(kind, subset.Array) for kind in part.parameters.values())


def taken(name: str, kind: subset.Type, source: str, written: bool, key: str) -> list[str]:
    """C that takes an argument from Python."""
    if isinstance(kind, subset.Array):
        size = f"sizeof *{name}.p"
        return [f'    if (!take({source}, &held, "{key}", "{name}", "{KINDS[kind.item]}", {size}, {kind.axes}, '
                f"{int(written)}, &{name}.p, &{name}.n0)) goto out;"]  # fmt: skip
    if isinstance(kind, subset.Several):
        lines = []
        for at, (field, of) in enumerate(zip(kind.fields, kind.items, strict=True)):
            part = f"{name}_{field}".replace(".", "_")
            lines += [f'    {{ PyObject *{part} = part_of({source}, {at}, {len(kind.items)}, "{key}");']
            lines += [f"    if (!{part}) goto out;", *taken(f"{name}.{field}", of, part, written, key)]
            lines += ["    }"]
        return lines
    return [f"    if (!take_{kind}({source}, &{name})) goto out;"]


def given(code: str, kind: subset.Type) -> str:
    """C that gives a value to Python."""
    if isinstance(kind, str):
        makers = {
            subset.DOUBLE: "PyFloat_FromDouble",
            subset.INTEGER: "PyLong_FromLongLong",
            subset.TRUTH: "PyBool_FromLong",
        }
        return f"{makers[kind]}({code})"
    if isinstance(kind, subset.Several) and not any(isinstance(item, subset.Array) for item in kind.items):
        parts = [given(f"{code}.{field}", item) for field, item in zip(kind.fields, kind.items, strict=True)]
        return f'Py_BuildValue("({"N" * len(parts)})", {", ".join(parts)})'
    raise subset.UnsupportedError(f"{kind} is not given to Python")


def module(names: list[str]) -> str:
    """The file that makes one extension of all rooms."""
    tables = "\n".join(f"extern PyMethodDef kernels_of_{name}[];" for name in names)
    added = "\n".join(f"    if (PyModule_AddFunctions(module, kernels_of_{name})) return -1;" for name in names)
    return f"""{HEAD.format(room="all its rooms")}
{tables}

__thread Way_out *way_out;
void outside(int64_t i, int64_t n) {{
    way_out->i = i;
    way_out->n = n;
    longjmp(way_out->back, 1);
}}

static int fill(PyObject *module) {{
{added}
    return 0;
}}

static PyModuleDef_Slot slots[] = {{{{Py_mod_exec, (void *)fill}}, {{0, NULL}}}};
static PyModuleDef definition = {{.base = {{1, NULL}}, .name = "_kernels", .slots = slots}};
TO_PYTHON PyObject *PyInit__kernels(void) {{ return PyModuleDef_Init(&definition); }}
"""


def write(folder: Path) -> Iterator[Path]:
    """Write the C of all rooms into a folder; a file whose text is as it was is left alone."""
    texts, names = {}, []
    for room, funcs in rooms().items():
        texts[f"{room}.c"] = unit(room, funcs)
        names.append(room)
    texts["module.c"] = module(names)
    for header in ("python.h", "kernels.h", "door.h"):
        texts[header] = (HERE / header).read_text(encoding="utf-8")
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in texts.items():
        path = folder / name
        if not path.is_file() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")
        if name.endswith(".c"):
            yield path


def sources() -> list[str]:
    """Files of the package on which the C depends: those of kernels, what they import, and what makes C of them."""
    files = set()
    for kernel in kernels():
        file = Path(subset.kernel_function(kernel).__code__.co_filename)
        files.add(file)
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("plumbob."):
                path = PACKAGE.joinpath(*(node.module or "").split(".")[1:])
                files.update(
                    path_of for path_of in (path.with_suffix(".py"), path / "__init__.py") if path_of.is_file()
                )
                files.update(path_of for name in node.names if (path_of := path / f"{name.name}.py").is_file())
    files.update([*HERE.glob("*.py"), *HERE.glob("*.h")])
    return sorted(path.relative_to(PACKAGE).as_posix() for path in files)


def export(name: str, folder: Path, frame: str = "ENU") -> list[Path]:
    """Write a filter in C99: NAME.c, NAME.h, kernels.h, which need libm and no memory but the state; gives their paths.

    The frame is ENU or NED; the smoother has no step of its own.
    """
    base, layout = import_module("plumbob.filters.base"), import_module("plumbob.filters.layout")
    made = base.Filter(name, frame=frame)
    coefficients, state = made._c.size, made._s
    single = subset.kernel_function(made._loops.single)
    parts = list(order([single]))
    words = {
        "name": name, "frame": frame, "size": state.size, "q": coefficients + layout.Q, "b": coefficients + layout.BIAS,
        "kernels": text(parts), "single": parts[-1].name,
        "start": ", ".join(repr(float(number)).replace("inf", "INFINITY").replace("nan", "NAN") for number in state),
    }  # fmt: skip
    folder.mkdir(parents=True, exist_ok=True)
    written = {f"{name}.{end}": (HERE / f"filter.{end}.in").read_text(encoding="utf-8") for end in "hc"}
    for file, pattern in written.items():
        (folder / file).write_text(pattern.format(**words), encoding="utf-8")
    (folder / "kernels.h").write_text((HERE / "kernels.h").read_text(encoding="utf-8"), encoding="utf-8")
    return [folder / file for file in (*written, "kernels.h")]
