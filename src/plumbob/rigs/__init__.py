"""Emulated rigs: the hardware of the five papers, speaking its real bytes, with faults where they are asked for.

``make_rig(PLANS["buoy"], load("buoy"), seed=1)`` gives frames with their times and the truth behind them, and
``serve(rig, port, ...)`` sends them as the hardware would. A format of one's own makes a rig too: `plan_for`.
"""

from typing import TYPE_CHECKING

from plumbob._lazy import lazily
from plumbob.rigs.find import find_format
from plumbob.rigs.formats import load, names

if TYPE_CHECKING:
    from plumbob.rigs.faults import KINDS, Fault
    from plumbob.rigs.plan import PLANS, Plan, Unit, plan_for
    from plumbob.rigs.port import FilePort, Port
    from plumbob.rigs.rig import Rig, make_rig
    from plumbob.rigs.serving import Served, serve
    from plumbob.rigs.sockets import TcpPort, UdpPort
    from plumbob.rigs.terminal import PtyPort

__getattr__, __dir__ = lazily(
    __name__,
    {
        "KINDS": "faults",
        "PLANS": "plan",
        "Fault": "faults",
        "FilePort": "port",
        "Plan": "plan",
        "Port": "port",
        "PtyPort": "terminal",
        "Rig": "rig",
        "Served": "serving",
        "TcpPort": "sockets",
        "UdpPort": "sockets",
        "Unit": "plan",
        "make_rig": "rig",
        "plan_for": "plan",
        "serve": "serving",
    },
)

__all__ = [
    "KINDS",
    "PLANS",
    "Fault",
    "FilePort",
    "Plan",
    "Port",
    "PtyPort",
    "Rig",
    "Served",
    "TcpPort",
    "UdpPort",
    "Unit",
    "find_format",
    "load",
    "make_rig",
    "names",
    "plan_for",
    "serve",
]
