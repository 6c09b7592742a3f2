"""Suites that every member of a family inherits."""
