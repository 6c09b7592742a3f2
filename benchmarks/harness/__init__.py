"""The proof harness: what is measured about Plumbob, from a checkout; not installed."""
