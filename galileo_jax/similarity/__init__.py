"""The likelihood of a measured motion."""
