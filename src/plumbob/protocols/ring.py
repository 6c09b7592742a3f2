"""An image of a log that was written round and round: its frames in the order of their counter."""

from typing import Final, NamedTuple

import numpy as np

from plumbob.core.errors import DecodeError
from plumbob.protocols.decode import decode
from plumbob.protocols.format import Format

BLANK: Final = 0xFF  # what an erased byte reads


class Ring(NamedTuple):
    """What an image of a log holds."""

    stream: bytes  # its frames, the oldest first, and nothing else
    records: int  # number of them
    missing: int  # numbers between the first and the last that no frame has
    # blank, torn: bytes that belong to no frame: erased ones, and others
    blank: int
    torn: int


def read_ring(image: bytes, form: Format) -> Ring:
    """Find the frames in an image of a log, and order them.

    The counter may wrap: the widest gap in its circle is taken for the seam, so that the log must hold less than half
    of what it counts.
    """
    counter = form.messages[0].of_role("counter")
    if counter is None or len(form.messages) > 1:
        raise DecodeError(
            f"{form.name} cannot be a log's record, which is one message with a counter; leave out --ring."
        )
    by_message, counts = decode(image, form)
    if form.messages[0].name not in by_message:
        erased = ", which are blank, as an erased chip is" if image and image.count(BLANK) == len(image) else ""
        raise DecodeError(f"no record of {form.name} is in the {len(image)} bytes{erased}{counts.why_rejected()}.")
    frames = by_message[form.messages[0].name]
    length = form.messages[0].length
    numbers = frames.columns[counter.name].astype(np.int64)
    order = np.argsort(numbers, kind="stable")
    circle = 1 << counter.width
    steps = np.diff(numbers[order], append=numbers[order[0]] + circle)
    seam = int(np.argmax(steps)) + 1
    order, steps = np.roll(order, -seam), np.roll(steps, -seam)[:-1]
    data = np.frombuffer(image, dtype=np.uint8)
    places = frames.start[:, np.newaxis] + np.arange(length)
    rest = np.delete(data, places.ravel())
    blank = int(np.count_nonzero(rest == BLANK))
    return Ring(
        stream=data[places[order]].tobytes(),
        records=len(frames),
        missing=int(np.maximum(steps - 1, 0).sum()),
        blank=blank,
        torn=rest.size - blank,
    )
