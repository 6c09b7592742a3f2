"""Core: what every room stands on: units, constants, checks, errors, flags, text, time, schemas, kernels and files."""

__version__ = "0.1.0"  # the version of this package, in one place; the build reads it here
