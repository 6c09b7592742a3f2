"""Calibration: fits from captures, refusals with reasons, and applying a card."""
