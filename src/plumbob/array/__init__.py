"""An array of units on one body: combined, watched, and each compared with the others."""
