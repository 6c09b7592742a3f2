"""An array of units on one body: combined, watched, and each compared with the others."""

from typing import TYPE_CHECKING

from plumbob.core import lazily

if TYPE_CHECKING:
    from plumbob.arm.array.channels import joined
    from plumbob.arm.array.monitoring import Monitor, Monitored, MonitoringSettings, monitor
    from plumbob.arm.array.paper import Scheme, sets_of, teaching_arm
    from plumbob.arm.array.relative import ArrayInfo, combine, info
    from plumbob.arm.array.virtual_unit import Combined, estimate

__all__ = [
    "ArrayInfo", "Combined", "Monitor", "Monitored", "MonitoringSettings", "Scheme", "combine", "estimate", "info",
    "joined", "monitor", "sets_of", "teaching_arm",
]  # fmt: skip

__getattr__, __dir__ = lazily(__name__, {
    "ArrayInfo": "relative", "Combined": "virtual_unit", "Monitor": "monitoring", "Monitored": "monitoring",
    "MonitoringSettings": "monitoring", "Scheme": "paper", "combine": "relative", "estimate": "virtual_unit",
    "info": "relative", "joined": "channels", "monitor": "monitoring", "sets_of": "paper", "teaching_arm": "paper",
})  # fmt: skip
