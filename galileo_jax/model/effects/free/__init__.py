"""Quantities that a clip declares and a fit may infer instead: one file each."""
