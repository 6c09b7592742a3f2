"""Conventions that a file does not say: units, axes, signs and delays of sensors, by what physics allows."""

from plumbob.conventions.diagnosis import Answer, Diagnosis, Finding, doctor

__all__ = ["Answer", "Diagnosis", "Finding", "doctor"]
