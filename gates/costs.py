"""What the tests cost, by folder: CPU seconds with those of child processes.

A plugin: ``make costs``, or ``pytest -p gates.costs``.
"""

import os
from collections import Counter

import pytest

DEAREST = 25  # tests that are listed one by one


class Costs:
    """Gathers the costs of a worker, and shows those of all."""

    def __init__(self, config):
        self.config, self.rows = config, []

    @staticmethod
    def _used():
        used = os.times()
        return used.user + used.system, used.children_user + used.children_system

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_runtest_protocol(self, item):
        own, children = self._used()
        result = yield
        after, after_children = self._used()
        self.rows.append((item.nodeid, after - own, after_children - children))
        return result

    def pytest_sessionfinish(self):
        if hasattr(self.config, "workeroutput"):
            self.config.workeroutput["costs"] = self.rows, self._used()[0]

    @pytest.hookimpl(optionalhook=True)
    def pytest_testnodedown(self, node):
        rows, own = node.workeroutput["costs"]
        self.rows += [*map(tuple, rows), ("(start and collection)", own - sum(row[1] for row in rows), 0.0)]

    def pytest_terminal_summary(self, terminalreporter):
        folders, tests = Counter(), Counter()
        for name, *seconds in self.rows:
            folder = name.partition("::")[0].rpartition("/")[0].removeprefix("tests/") or name
            tests[folder] += 1
            for kind, used in zip(("own", "children"), seconds, strict=True):
                folders[folder, kind] += used
        write = terminalreporter.write_line
        write(f"\n{'folder':28}{'tests':>7}{'CPU s':>8}{'in children':>13}")
        total = dict.fromkeys(tests, 0.0) | {name: folders[name, "own"] + folders[name, "children"] for name in tests}
        for name in sorted(tests, key=total.get, reverse=True):
            write(f"{name:28}{tests[name]:7}{total[name]:8.1f}{folders[name, 'children']:13.1f}")
        children = sum(folders[name, "children"] for name in tests)
        write(f"{'together':28}{sum(tests.values()):7}{sum(total.values()):8.1f}{children:13.1f}")
        write("\nthe dearest tests, CPU s")
        for name, own, children in sorted(self.rows, key=lambda row: -row[1] - row[2])[:DEAREST]:
            write(f"{own + children:8.1f}  {name}")


def pytest_configure(config):
    """Register what gathers and shows."""
    config.pluginmanager.register(Costs(config), "costs")
