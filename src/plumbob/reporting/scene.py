"""A body that moves, for a page: lines between points in three dimensions, to be turned by hand and played.

It is drawn on a canvas by one constant script beside this file.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np

from plumbob.core.check import Floats
from plumbob.reporting.style import said

_FRAMES: Final = 1500
_RATE: Final = 30.0  # frames per second, which look smooth
_DIGITS: Final = 4  # of lengths in m: a tenth of a millimetre


@dataclass(frozen=True, eq=False)
class Scene:
    """A body of points and lines over time.

    Attributes
    ----------
    caption : str
        A noun.
    t : ndarray (N,)
        Times, s.
    points : mapping of str to ndarray (N, 3)
        Places by name, m; z is up. A name that begins with a dot is a helper's: no mark, no label, thin lines.
    lines : sequence of (str, str)
        Points that are joined.
    trail : str
        Point whose way is drawn; none where empty.
    values : mapping of str to ndarray (N,)
        Numbers that are shown beside the time, by name.
    unit : str
        Of these numbers.
    shadow : mapping of str to ndarray (N, 3)
        A second body with the same lines, drawn pale: what the first one is compared with; may have fewer points.
    """

    caption: str
    t: Floats
    points: Mapping[str, Floats]
    lines: Sequence[tuple[str, str]]
    trail: str = ""
    values: Mapping[str, Floats] = field(default_factory=dict)
    unit: str = "°"
    shadow: Mapping[str, Floats] = field(default_factory=dict)


def scene_data(scene: Scene, lang: str) -> dict[str, Any]:
    """What the script of the page is given of a scene."""
    rows = _rows(scene.t)
    names = list(scene.points)
    shaded = names if scene.shadow else []
    return {
        "t": _rounded(scene.t[rows], 3),
        "names": [said(name, lang) for name in names],
        "points": [_rounded(scene.points[name][rows], _DIGITS) for name in names],
        "shadow": [_rounded(scene.shadow[name][rows], _DIGITS) if name in scene.shadow else [] for name in shaded],
        "lines": [[names.index(start), names.index(end)] for start, end in scene.lines],
        "trail": names.index(scene.trail) if scene.trail else -1,
        "values": [[said(name, lang), _rounded(values[rows], 1)] for name, values in scene.values.items()],
        "unit": scene.unit,
        "grid": said("grid", lang),
    }


def _rows(t: Floats) -> Any:
    """Rows of the frames: at most so many a second, and so many in all."""
    wanted = int(min(t.size, _FRAMES, 1 + np.ceil((t[-1] - t[0]) * _RATE)))
    return np.unique(np.searchsorted(t, np.linspace(t[0], t[-1], max(wanted, 2))).clip(0, t.size - 1))


def _rounded(values: Floats, digits: int) -> Any:
    """Lists of numbers; None where one is not known."""
    flat = [round(value, digits) if np.isfinite(value) else None for value in values.ravel().tolist()]
    if values.ndim == 1:
        return flat
    width = values.shape[1]
    return [flat[k : k + width] for k in range(0, len(flat), width)]
