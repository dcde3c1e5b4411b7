"""From a video of a sliding object to its masses and friction coefficients."""

__version__ = "0.1.0"
