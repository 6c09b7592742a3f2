"""A struct that a C program fills gives the bytes that the encoder gives."""

import shutil
import subprocess

import numpy as np
import pytest

from plumbob.protocols import catalog
from plumbob.protocols.c_header import c_header
from plumbob.protocols.encode import encode
from plumbob.protocols.rigs import load, names
from plumbob.protocols.unpack import values_of

CC = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
FORMS = {name: catalog.load(name) for name in catalog.names()} | {name: load(name) for name in names()}


def bound(form):
    """With the first choice, or 1, of every option that has no default."""
    needed = {name: next(iter(o.choices), "1") for name, o in form.options.items() if o.default is None}
    return form.bind(needed)


def identifier(name):
    made = "".join(c if c.isalnum() else "_" for c in name)
    return f"_{made}" if made[0].isdigit() else made


def drawn(field, rng):
    low, high = field.range or field.clip or field.limits
    return int(rng.integers(max(low, -(2**40)), min(high, 2**40), endpoint=True))


def program(form, message, counts):
    kind = f"plumbob_{identifier(form.name)}"
    if len(form.messages) > 1:
        kind += f"_{identifier(message.name)}"
    lines = []
    for field, count in counts:
        lines.append(f"    {kind}_set_{identifier(field.name)}(&f, {count});")
        if field.type != "bcd":
            lines.append(f"    if ({kind}_get_{identifier(field.name)}(&f) != {count}) return 1;")
    return "\n".join(
        [
            '#include "frame.h"', "#include <stdio.h>", "int main(void)", "{", f"    {kind} f;",
            "    memset(&f, 0, sizeof f);", *lines, f"    {kind}_seal(&f);",
            "    return fwrite(&f, sizeof f, 1, stdout) != 1;", "}", "",
        ]
    )  # fmt: skip


@pytest.mark.skipif(CC is None, reason="no C compiler")
@pytest.mark.parametrize("name", FORMS)
def test_the_struct_in_c_has_the_bytes_of_the_encoder(name, tmp_path):
    form, rng = bound(FORMS[name]), np.random.default_rng(4)
    (tmp_path / "frame.h").write_text(c_header(form))
    for message in form.messages:
        own = [f for f in message.fields if not (f.fixed or f.derived)]
        counts = [(f, drawn(f, rng) if f.type[0] != "f" else float(rng.integers(-99, 99))) for f in own]
        columns = {f.name: np.array([c]) if not f.physical else values_of(f, np.array([c])) for f, c in counts}
        if not columns:
            continue
        (tmp_path / "main.c").write_text(program(form, message, counts))
        strict = ["-std=c11", "-Wall", "-Wextra", "-Werror", "-pedantic", "-Wno-unused-function"]
        made = subprocess.run(
            [CC, *strict, "-o", "main", "main.c"], cwd=tmp_path, capture_output=True, text=True, check=False
        )
        assert made.returncode == 0, made.stderr
        done = subprocess.run([tmp_path / "main"], capture_output=True, check=False)
        assert done.returncode == 0
        assert done.stdout == encode(form, columns, message=message.name)[0].tobytes()


def test_the_header_says_units_and_size():
    text = c_header(load("buoy").bind())
    assert "static_assert(sizeof(plumbob_buoy) == 31" in text
    assert "/* acc.x: s16, big-endian; count * 0.00119710083 [m/s2] */" in text  # 9.80665 / 8192
    assert "uint8_t gyr_x[2];" in text
