"""Conventions that a file does not say: units, axes, signs and delays of sensors, by what is consistent with physics."""

from plumbob.conventions.doctor import Answer, Diagnosis, Finding, doctor

__all__ = ["Answer", "Diagnosis", "Finding", "doctor"]
