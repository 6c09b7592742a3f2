"""Calibration: applying a card (fitting one comes with its own modules)."""
