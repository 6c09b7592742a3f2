"""Evaluation: what an attitude is worth against a reference, with every decision on record."""
