"""What is measured about Plumbob, from a checkout: each module says how to run it."""
