"""What no model knows exactly, as random functions whose size is inferred.

The world follows a rollout up to a small deviation, linear and Gaussian, and a camera or a hand
marks where a body is up to another. A term (`terms/`) is one such function: its covariance at unit
size, and a prior of its size in units that a person knows.
"""
