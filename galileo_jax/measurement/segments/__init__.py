"""Segments: which part of a track is motion of the scene, and what begins and ends it."""
