"""Emulated rigs: the hardware of the five papers, speaking its real bytes, with faults where they are asked for.

``make_rig(PLANS["buoy"], load("buoy"), seed=1)`` gives frames with their times and the truth behind them, and
``serve(rig, port, ...)`` sends them as the hardware would. A format of your own makes a rig too: `plan_for`.
"""
