"""Rotation vectors at every critical size and in every leading shape."""

import itertools

import numpy as np
import pytest

SIZES = {
    "identity": 0.0, "1e-12": 1e-12, "1e-8": 1e-8, "1e-4": 1e-4, "random": None, "near pi": np.pi - 1e-8, "pi": np.pi,
}  # fmt: skip
SHAPES = ((), (1,), (3, 2), (0,))


def rotation_vectors(size, shape, seed=7):
    rng = np.random.default_rng(seed)
    axis = rng.normal(size=(*shape, 3))
    axis /= np.linalg.norm(axis, axis=-1, keepdims=True)
    return axis * (rng.uniform(0.0, np.pi, (*shape, 1)) if SIZES[size] is None else SIZES[size])


@pytest.fixture(params=itertools.product(SIZES, SHAPES), ids=lambda p: f"{p[0]}-{p[1]}")
def rotvec(request):
    return rotation_vectors(*request.param)


@pytest.fixture
def quats():
    """1000 rotations spread evenly."""
    q = np.random.default_rng(11).normal(size=(1000, 4))
    return q / np.linalg.norm(q, axis=1, keepdims=True)
