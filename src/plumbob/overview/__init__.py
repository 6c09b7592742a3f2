"""A recording seen as a whole, without a reference: its attitude and claims, its motion, its gaps, its quality."""
