"""Emulated rigs: the hardware of the five papers, speaking its real bytes, with faults where they are asked for.

``make_rig(PLANS["buoy"], load("buoy"), seed=1)`` gives frames with their times and the truth behind them, and
``serve(rig, port, ...)`` sends them as the hardware would. A format of your own makes a rig too: `plan_for`.
"""

from typing import TYPE_CHECKING

from plumbob.core.lazy import lazily

if TYPE_CHECKING:
    from plumbob.simulation.rigs.faults import KINDS, Fault
    from plumbob.simulation.rigs.firmware import Firmware, Processor, run_firmware
    from plumbob.simulation.rigs.flash import FlashLog
    from plumbob.simulation.rigs.plan import PLANS, Plan, Unit, plan_for
    from plumbob.simulation.rigs.rig import Rig, make_rig
    from plumbob.simulation.rigs.serving import FilePort, Port, Served, TcpPort, UdpPort, serve
    from plumbob.simulation.rigs.terminal import PtyPort

__getattr__, __dir__ = lazily(
    __name__,
    {
        "KINDS": "faults",
        "PLANS": "plan",
        "Fault": "faults",
        "FilePort": "serving",
        "Firmware": "firmware",
        "FlashLog": "flash",
        "Plan": "plan",
        "Port": "serving",
        "Processor": "firmware",
        "PtyPort": "terminal",
        "Rig": "rig",
        "Served": "serving",
        "TcpPort": "serving",
        "UdpPort": "serving",
        "Unit": "plan",
        "make_rig": "rig",
        "plan_for": "plan",
        "run_firmware": "firmware",
        "serve": "serving",
    },
)

__all__ = [
    "KINDS",
    "PLANS",
    "Fault",
    "FilePort",
    "Firmware",
    "FlashLog",
    "Plan",
    "Port",
    "Processor",
    "PtyPort",
    "Rig",
    "Served",
    "TcpPort",
    "UdpPort",
    "Unit",
    "make_rig",
    "plan_for",
    "run_firmware",
    "serve",
]
