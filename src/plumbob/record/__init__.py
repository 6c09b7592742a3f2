"""Recordings of a live line: raw bytes first, decoded samples beside them, in MCAP that survives a crash."""
