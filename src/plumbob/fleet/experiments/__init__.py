"""Many evaluations in one table: estimators on folders of recordings, or on a scenario with many seeds."""
