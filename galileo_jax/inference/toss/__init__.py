"""Tosses of a box onto a plane: one joint fit of poses with the body engine."""
