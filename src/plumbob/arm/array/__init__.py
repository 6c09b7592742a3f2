"""An array of units on one body: combined, watched, and each compared with the others."""

from typing import TYPE_CHECKING

from plumbob.core import lazily

if TYPE_CHECKING:
    from plumbob.arm.array.channels import joined
    from plumbob.arm.array.monitoring import Monitor, Monitored, monitor
    from plumbob.arm.array.relative import ArrayInfo, combine, info
    from plumbob.arm.array.virtual_unit import Combined, estimate

__all__ = ["ArrayInfo", "Combined", "Monitor", "Monitored", "combine", "estimate", "info", "joined", "monitor"]

__getattr__, __dir__ = lazily(__name__, {
    "ArrayInfo": "relative", "Combined": "virtual_unit", "Monitor": "monitoring", "Monitored": "monitoring",
    "combine": "relative", "estimate": "virtual_unit", "info": "relative", "joined": "channels",
    "monitor": "monitoring",
})  # fmt: skip
