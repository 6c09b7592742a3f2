"""The C of one filter with its state, for a program without Python."""

from importlib import import_module
from pathlib import Path

from plumbob.core.kernels import emit
from plumbob.core.kernels.sources import kernel_function
from plumbob.core.kernels.translate import order

HEADER = """/* Plumbob's filter '{name}', frame {frame}, default parameters. Made by plumbob.core.kernels. */
#ifndef PLUMBOB_{name}_H
#define PLUMBOB_{name}_H
#include <stdint.h>

/* All that the filter knows: from state[{q}] the attitude q_nb, scalar first (4), from state[{b}] the gyroscope bias
   (3) in rad/s. */
typedef struct {{ double state[{size}]; }} {name}_filter;

/* A filter before its first sample. */
extern const {name}_filter {name}_start;

/* Take one sample: time in ns; angular rate (3) in rad/s, specific force (3) in m/s^2, magnetic field (3) in uT, NAN
   where there is none. What it returns are the flags of Plumbob's documentation. */
int64_t {name}_update({name}_filter *filter, int64_t t_ns, double sample[9]);
#endif
"""
CODE = """#include "{name}.h"
#include "kernels.h"

/* No index of this program is outside its array; one that were would stop it here. */
void outside(int64_t i, int64_t n) {{
    (void)i;
    (void)n;
    for (;;) {{
    }}
}}

{kernels}

const {name}_filter {name}_start = {{{{{start}}}}};

int64_t {name}_update({name}_filter *filter, int64_t t_ns, double sample[9]) {{
    return {single}((f64_1){{filter->state, {size}}}, t_ns, 0, (f64_1){{sample, 9}});
}}
"""


def export(name: str, folder: Path, frame: str = "ENU") -> list[Path]:
    """Write a filter in C: NAME.c, NAME.h, kernels.h.

    Parameters
    ----------
    name : str
        The filter, as in `plumbob.filter_names`; the smoother has no step of its own.
    folder : Path
        Where to.
    frame : str
        Navigation frame, ENU or NED.

    Returns
    -------
    list of Path
        The files, C99, which need libm and no memory but the state.
    """
    base, layout = import_module("plumbob.filters.base"), import_module("plumbob.filters.layout")
    made = base.Filter(name, frame=frame)
    coefficients, state = made._c.size, made._s
    single = kernel_function(made._loops.single)
    parts = list(order([single]))
    words = {
        "name": name, "frame": frame, "size": state.size, "q": coefficients + layout.Q, "b": coefficients + layout.BIAS,
        "kernels": emit.text(parts), "single": parts[-1].name,
        "start": ", ".join(repr(float(number)).replace("inf", "INFINITY").replace("nan", "NAN") for number in state),
    }  # fmt: skip
    folder.mkdir(parents=True, exist_ok=True)
    written = {f"{name}.h": HEADER, f"{name}.c": CODE}
    for file, pattern in written.items():
        (folder / file).write_text(pattern.format(**words), encoding="utf-8")
    (folder / "kernels.h").write_text((emit.HERE / "kernels.h").read_text(encoding="utf-8"), encoding="utf-8")
    return [folder / file for file in (*written, "kernels.h")]
