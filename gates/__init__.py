"""Every gate of the project: what runs them, and what they measure."""

import os
import sys

PYTEST = (sys.executable, "-m", "pytest", "-n", os.environ.get("JOBS", "2"), "--dist", "loadfile")
