"""Jacobians by differences, and a way to listen to what a kernel hands on."""

from types import FunctionType

import numpy as np


def by_differences(f, at, step=1e-3):
    """Central differences; exact but for rounding where f is quadratic, whose errors are about eps |f|/step."""
    columns = [(np.asarray(f(at + h)) - np.asarray(f(at - h))) / (2 * step) for h in step * np.eye(at.size)]
    return np.array(columns).T


def rows_of(kernel, *args):
    """Rows h that a kernel hands to `correct`, in order: the kernel's own code with a listener in its place."""
    rows = []
    listening = {**kernel.py_func.__globals__, "correct": lambda x, *numbers: rows.append(numbers[:4])}
    FunctionType(kernel.py_func.__code__, listening)(*args)
    return np.array(rows)
