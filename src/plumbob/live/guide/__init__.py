"""Guides of captures: what was seen, what to do next, and when it is enough."""
