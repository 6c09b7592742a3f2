"""Recordings of a live line: raw bytes first, decoded samples beside them, in MCAP that survives a crash."""

from plumbob.record.channels import Channel, Schema
from plumbob.record.damage import Damage
from plumbob.record.log import Log, LogMessage, open_log
from plumbob.record.recorder import Recorder
from plumbob.record.repair import repair
from plumbob.record.verdict import Verdict, verify

__all__ = ["Channel", "Damage", "Log", "LogMessage", "Recorder", "Schema", "Verdict", "open_log", "repair", "verify"]
