"""Ellipsoids of vectors of one length: closed forms, maximum likelihood, outliers, and which shape is needed."""
