"""Command line: one file per verb, each with `add_parser` and `run`; heavy imports wait until a verb runs."""
