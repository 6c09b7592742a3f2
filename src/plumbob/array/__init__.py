"""An array of units on one body: combined, watched, and each compared with the others."""

from typing import TYPE_CHECKING

from plumbob.core.lazy import lazily

if TYPE_CHECKING:
    from plumbob.array.attitude import estimate
    from plumbob.array.combination import Combined, combine
    from plumbob.array.monitoring import Monitor, Monitored, monitor
    from plumbob.array.relative import ArrayInfo, info
    from plumbob.array.timeline import joined

_HOME = {
    "ArrayInfo": "relative",
    "Combined": "combination",
    "Monitor": "monitoring",
    "Monitored": "monitoring",
    "combine": "combination",
    "estimate": "attitude",
    "info": "relative",
    "joined": "timeline",
    "monitor": "monitoring",
}

__all__ = [
    "ArrayInfo",
    "Combined",
    "Monitor",
    "Monitored",
    "combine",
    "estimate",
    "info",
    "joined",
    "monitor",
]

__getattr__, __dir__ = lazily(__name__, _HOME)
