"""Every catalogued format against the battery, and the same bits as plain Python."""

import json
import os
import subprocess
import sys
from pathlib import Path

from plumbob.protocols import catalog
from tests.helpers.decoder_battery import DecoderBattery, digest

DIGESTS = "import json; from tests.helpers.decoder_battery import catalog, digest; "
DIGESTS += "print(json.dumps({name: digest(name) for name in catalog.names()}))"


class TestEveryFormat(DecoderBattery):
    pass


def test_compiled_and_plain_python_give_the_same_bits():
    root = Path(__file__).parents[2]
    ours = {name: digest(name) for name in catalog.names()}
    other = "0" if os.environ.get("NUMBA_DISABLE_JIT") == "1" else "1"
    env = os.environ | {"NUMBA_DISABLE_JIT": other}
    done = subprocess.run(
        [sys.executable, "-c", DIGESTS], cwd=root, env=env, capture_output=True, text=True, check=True
    )
    assert json.loads(done.stdout) == ours
