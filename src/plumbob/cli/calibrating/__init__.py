"""Kinds of `plumbob calibrate`, one file each."""
