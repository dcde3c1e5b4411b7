"""Fits: from a problem to the best parameters and how sharp they are."""
