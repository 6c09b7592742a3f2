"""What random bytes pass for: declared in the catalogue, computed from the format, and counted."""

import re
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.harness.false_accepts import false_accepts
from plumbob.protocols.decode import decode
from plumbob.protocols.format_toml import device_names, find_format
from plumbob.protocols.overlap import passes_anything
from plumbob.protocols.page import framing_words
from tests.helpers import slow_as_python

STREAMS = [name for name in device_names() if not find_format(name).framing.transfers]


def settled(name):
    """A device with options that are not known given some number: they do not change what passes."""
    form = find_format(name)
    return form.bind({key: "1" for key, option in form.options.items() if option.default is None})


@pytest.mark.parametrize("name", device_names())
def test_a_format_that_takes_anything_is_one_that_every_random_transfer_passes(name):
    form = settled(name)
    assert passes_anything(form) == (form.framing.transfers and false_accepts(form) == 1.0)
    rows = np.random.default_rng(1).integers(0, 256, 2000 * form.framing.most, dtype=np.uint8)
    taken = sum(decode(rows.tobytes(), form)[1].frames.values())
    assert (taken == 2000) == passes_anything(form)
    assert passes_anything(form) == (", NO CHECK" in framing_words(form))


@pytest.mark.parametrize("name", STREAMS)
def test_the_catalogue_declares_what_follows_from_the_format(name):
    text, _ = find_format(name).facts["false_accepts"]
    declared = float(re.search(r" (\S+) per byte", text)[1])
    assert declared == float(f"{false_accepts(settled(name)):.1e}")


@pytest.mark.parametrize(("name", "odds"), [
    # sync twice (confirmed), sum of 8 bits, a pitch of 32769 and a temperature of 4096 counts among 65536
    ("ahrs400", 256.0**-2 / 256 * 32769 / 65536 * 4096 / 65536),
    # sync of 16 bits, two sums of 16 bits, pitch as above
    ("ahrs500ga", 256.0**-2 * 2 * 256.0**-2 * 32769 / 65536),
    # sync, kind out of 5, sum of 8 bits, the next sync
    ("witmotion", 256.0**-4 * 5),
    # one of two beginnings of 16 bits, three messages with a register behind; the next, of either kind, confirms
    ("witmotion_ble", 256.0**-2 * (1 + 3 * 256.0**-2) * 2 * 256.0**-2),
    # sync of 24 bits out of 8 twice (confirmed), base and identity of 9 reports; the sync says the length
    ("bno08x_shtp", (8 * 256.0**-3) ** 2 * 9 * 256.0**-2),
    # sync of 32 bits, check of 16
    ("vectornav_ypr", 256.0**-6),
])  # fmt: skip
def test_it_is_the_product_of_what_guards(name, odds):
    assert false_accepts(settled(name)) == pytest.approx(odds, rel=1e-12)


@slow_as_python
@pytest.mark.parametrize("name", ["ahrs400", "witmotion", "witmotion_ble"])
def test_random_bytes_pass_as_often_as_computed(name):
    form = settled(name)
    form = replace(form, framing=replace(form.framing, confirm=False))  # else there would be nothing to count
    size = 40_000_000 if name == "witmotion" else 20_000_000
    noise = np.random.default_rng(1).integers(0, 256, size, dtype=np.uint8).tobytes()
    expected = false_accepts(form) * size
    found = sum(decode(noise, form)[1].frames.values())
    assert expected > 9 and abs(found - expected) < 4 * expected**0.5  # a Poisson count within four of its deviations
