"""Where the real recordings lie, and which tests cannot do without compiled kernels."""

import os
from pathlib import Path

import pytest

DATA = Path(os.environ.get("PLUMBOB_DATA") or Path(__file__).parents[2] / "shared" / "data")


@pytest.fixture(scope="session")
def broad_folder():
    folder = DATA / "broad"
    if not folder.is_dir():
        pytest.skip(f"no BROAD recordings at {folder}; set PLUMBOB_DATA")
    return folder
