"""Sensor formats: one description per device gives its decoder, its encoder, its units and its page."""
