"""Benchmarks: how accurate, how honest and how fast the package is (`python -m benchmarks`)."""
