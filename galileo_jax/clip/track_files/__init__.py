"""Tracks from the tools that people use: one reader per file, known by content."""
