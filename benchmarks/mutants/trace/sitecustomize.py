"""Which functions of the package each test runs; every process of a traced run imports this at its start.

What a fixture runs counts for all tests of its file. Of compiled kernels only the call from Python is seen: with it
count all kernels that it reaches.
"""

import atexit
import contextlib
import gc
import json
import os
import sys
import threading
import uuid
from pathlib import Path

ROOT = os.environ.get("PLUMBOB_TRACE_ROOT", "") + os.sep
OUT = os.environ.get("PLUMBOB_TRACE")
seen = {}
current = seen.setdefault(os.environ.get("PYTEST_CURRENT_TEST", ""), set())


def note(code):
    if code not in current:
        current.add(code)


def reach(kernel):
    from plumbob.core.kernels import Kernel

    current.add(kernel.py_func.__code__)
    for name in kernel.py_func.__code__.co_names:
        if isinstance(callee := kernel.py_func.__globals__.get(name), Kernel):
            reach(callee)


def start():
    if sys.version_info >= (3, 12):
        watch = sys.monitoring
        watch.use_tool_id(4, "mutants")
        watch.register_callback(4, watch.events.PY_START, lambda code, _: (note(code), watch.DISABLE)[1])
        watch.set_events(4, watch.events.PY_START)
    else:
        sys.setprofile(profile)
        threading.setprofile(profile)


def profile(frame, event, _):
    if event == "call":
        note(frame.f_code)


def switch(name):
    global current  # noqa: PLW0603
    current = seen.setdefault(name, set())
    if sys.version_info >= (3, 12):
        sys.monitoring.restart_events()
    else:
        start()  # again: a test may have watched calls itself, and left nobody watching


def save():
    sys.setprofile(None)  # what follows would be noted while it is counted
    if "plumbob.core.kernels" in sys.modules:
        from plumbob.core.kernels import Kernel

        if not any(seen):  # a process of its own, whose kernels nobody watched
            for one in gc.get_objects():
                if isinstance(one, Kernel) and one._compiled is not None:
                    reach(one)
    found = {
        name: sorted({f"{code.co_filename.removeprefix(ROOT)}:{code.co_firstlineno}" for code in codes
                      if code.co_filename.startswith(ROOT)})
        for name, codes in seen.items() if name
    }  # fmt: skip
    with contextlib.suppress(OSError):
        begun = Path(OUT, f"{uuid.uuid4().hex}.begun")  # a process that is killed meanwhile leaves no half of a file
        begun.write_text(json.dumps(found), encoding="utf-8")
        begun.replace(begun.with_suffix(".json"))


if OUT:
    start()
    atexit.register(save)
