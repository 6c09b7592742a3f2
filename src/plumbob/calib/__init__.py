"""Calibration: applying a card, and the drift of a gyroscope (fitting a card comes with its own modules)."""
