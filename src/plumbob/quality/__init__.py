"""Conventions that a file does not say: units, axes, signs and delays of sensors, by what physics allows."""
