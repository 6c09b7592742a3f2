"""Recordings of a live line: raw bytes first, decoded samples beside them, in MCAP that survives a crash."""

from plumbob.files.mcap.layout import Channel, Schema
from plumbob.files.mcap.log import Log, LogMessage, open_log
from plumbob.files.mcap.recorder import Recorder
from plumbob.files.mcap.scan import Damage
from plumbob.files.mcap.verdict import Verdict, repair, verify

__all__ = ["Channel", "Damage", "Log", "LogMessage", "Recorder", "Schema", "Verdict", "open_log", "repair", "verify"]
