"""Many recordings at once: one job for each, a partitioned dataset of attitudes, and a table of verdicts."""
