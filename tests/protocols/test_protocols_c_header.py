"""A struct that a C program fills gives the bytes that the encoder gives."""

import shutil
import subprocess

import numpy as np
import pytest

from plumbob.protocols.c_header import c_header
from plumbob.protocols.encode import encode
from plumbob.protocols.format_toml import device_names, find_format, rig_names
from plumbob.protocols.unpack import field_values

CC = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
FORMS = {name: find_format(name) for name in (*device_names(), *rig_names())}


def identifier(name):
    made = "".join(c if c.isalnum() else "_" for c in name)
    return f"_{made}" if made[0].isdigit() else made


def drawn(field, rng):
    if field.type[0] == "f":
        return float(rng.integers(-99, 99))
    low, high = field.range or field.clip or field.limits
    return int(rng.integers(max(low, -(2**40)), min(high, 2**40), endpoint=True))


def filled(form, message, counts):
    """Statements that set, get back and write a message."""
    kind = f"plumbob_{identifier(form.name)}"
    if len(form.messages) > 1:
        kind += f"_{identifier(message.name)}"
    lines = [f"    {{ {kind} f;", "    memset(&f, 0, sizeof f);"]
    for field, count in counts:
        lines.append(f"    {kind}_set_{identifier(field.name)}(&f, {count});")
        if field.type != "bcd":
            lines.append(f"    if ({kind}_get_{identifier(field.name)}(&f) != {count}) return 1;")
    return [*lines, f"    {kind}_seal(&f);", "    if (fwrite(&f, sizeof f, 1, stdout) != 1) return 1; }"]


@pytest.mark.skipif(CC is None, reason="no C compiler")
def test_the_structs_in_c_have_the_bytes_of_the_encoder(tmp_path):
    lines, encoded, rng = ["int main(void) {"], b"", np.random.default_rng(4)
    for name, found in FORMS.items():
        form = found.bind({key: next(iter(o.choices), "1") for key, o in found.options.items() if o.default is None})
        (tmp_path / f"{name}.h").write_text(c_header(form))
        lines.insert(0, f'#include "{name}.h"')
        for message in form.messages:
            counts = [(f, drawn(f, rng)) for f in message.fields if not (f.fixed or f.derived)]
            columns = {f.name: np.array([c]) if not f.physical else field_values(f, np.array([c])) for f, c in counts}
            if columns:
                lines += filled(form, message, counts)
                encoded += encode(form, columns, message=message.name)[0].tobytes()
    (tmp_path / "main.c").write_text("\n".join(["#include <stdio.h>", *lines, "    return 0; }", ""]))
    strict = ["-std=c11", "-Wall", "-Wextra", "-Werror", "-Wconversion", "-pedantic", "-Wno-unused-function"]
    made = subprocess.run(
        [CC, *strict, "-o", "main", "main.c"], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert made.returncode == 0, made.stderr
    assert subprocess.run([tmp_path / "main"], capture_output=True, check=True).stdout == encoded
