"""Scans of IIO devices taken apart: by a program of its own, and by the decoder of the format that says the same."""

import numpy as np

from plumbob.core.units import unit
from plumbob.live.source_toml import iio_format
from plumbob.live.transports.iio_layout import TIMESTAMP
from plumbob.protocols.decode import decode

AXES = "xyz"


def decoded(layout, data):
    """Columns by our names, as a line decodes whole scans."""
    frames, counts = decode(data, iio_format(layout))
    assert counts.junk == 0
    return {name.replace(".", "_"): column for name, column in frames[layout.device].columns.items()}


def taken_apart(layout, data):
    """Time stamps, None where there are none, and columns by our names, in the axes of the board."""
    table = np.frombuffer(data, np.uint8).reshape(-1, layout.size)
    t_ns, columns = None, {}
    for channel, at in zip(layout.channels, layout.places, strict=True):
        raw = numbers(channel.type, table[:, at : at + channel.type.size])
        if channel.name == TIMESTAMP:
            t_ns = raw
        else:
            u = unit(channel.unit_name)
            columns[channel.column] = (raw.astype(np.float64) + channel.offset) * channel.scale * u.factor + u.offset
    for triad, matrix in layout.mounts.items():
        chip = {j: columns.pop(f"{triad}_{axis}") for j, axis in enumerate(AXES) if f"{triad}_{axis}" in columns}
        for row, axis in zip(matrix, AXES, strict=True):
            if chip and not any(row[j] for j in range(3) if j not in chip):
                columns[f"{triad}_{axis}"] = sum(row[j] * values for j, values in chip.items())
    return t_ns, columns


def numbers(kind, table):
    """Numbers (N,) as the driver counts them."""
    words = np.ascontiguousarray(table).view(f"{kind.order}u{kind.storage // 8}").astype(np.uint64)[:, 0]
    counts = ((words >> np.uint64(kind.shift)) & np.uint64(2**kind.bits - 1)).view(np.int64)
    sign = np.int64(1 << kind.bits - 1) if kind.signed and kind.bits < 64 else np.int64(0)
    return (counts ^ sign) - sign
