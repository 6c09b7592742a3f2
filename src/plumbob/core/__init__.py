"""Core: what every room stands on: units, constants, checks, errors, flags, text, time, schemas, kernels and files."""
