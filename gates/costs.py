"""What the tests cost, by folder: CPU seconds with those of child processes, and which of them numba compiles in.

A plugin: ``make costs``, or ``pytest -p gates.costs``. Compiling in a child process counts as the child's.
"""

import os
import time
from collections import Counter

import pytest
from numba.core import event

DEAREST = 25  # tests that are listed one by one


class _Compiling(event.Listener):
    """CPU seconds within numba's compiler, whose calls are nested."""

    def __init__(self):
        self.seconds, self._depth, self._since = 0.0, 0, 0.0

    def on_start(self, _):
        if not self._depth:
            self._since = time.process_time()
        self._depth += 1

    def on_end(self, _):
        self._depth -= 1
        if not self._depth:
            self.seconds += time.process_time() - self._since


class Costs:
    """Gathers the costs of a worker, and shows those of all."""

    def __init__(self, config):
        self.config, self.rows, self.compiling = config, [], _Compiling()
        event.register("numba:compile", self.compiling)

    @staticmethod
    def _used():
        used = os.times()
        return used.user + used.system, used.children_user + used.children_system

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_runtest_protocol(self, item):
        own, children = self._used()
        compiled = self.compiling.seconds
        result = yield
        after, after_children = self._used()
        self.rows.append((item.nodeid, after - own, after_children - children, self.compiling.seconds - compiled))
        return result

    def pytest_sessionfinish(self):
        if hasattr(self.config, "workeroutput"):
            self.config.workeroutput["costs"] = self.rows, self._used()[0]

    @pytest.hookimpl(optionalhook=True)
    def pytest_testnodedown(self, node):
        rows, own = node.workeroutput["costs"]
        self.rows += [*map(tuple, rows), ("(start and collection)", own - sum(row[1] for row in rows), 0.0, 0.0)]

    def pytest_terminal_summary(self, terminalreporter):
        folders, tests = Counter(), Counter()
        for name, *seconds in self.rows:
            folder = name.partition("::")[0].rpartition("/")[0].removeprefix("tests/") or name
            tests[folder] += 1
            for kind, used in zip(("own", "children", "compiling"), seconds, strict=True):
                folders[folder, kind] += used
        write = terminalreporter.write_line
        write(f"\n{'folder':28}{'tests':>7}{'CPU s':>8}{'in children':>13}{'compiling':>11}")
        total = dict.fromkeys(tests, 0.0) | {name: folders[name, "own"] + folders[name, "children"] for name in tests}
        for name in sorted(tests, key=total.get, reverse=True):
            parts = f"{folders[name, 'children']:13.1f}{folders[name, 'compiling']:11.1f}"
            write(f"{name:28}{tests[name]:7}{total[name]:8.1f}{parts}")
        parts = (sum(folders[name, kind] for name in tests) for kind in ("children", "compiling"))
        write("{:28}{:7}{:8.1f}{:13.1f}{:11.1f}".format("together", sum(tests.values()), sum(total.values()), *parts))
        write("\nthe dearest tests, CPU s")
        for name, own, children, _ in sorted(self.rows, key=lambda row: -row[1] - row[2])[:DEAREST]:
            write(f"{own + children:8.1f}  {name}")


def pytest_configure(config):
    """Register what gathers and shows."""
    config.pluginmanager.register(Costs(config), "costs")
