"""Puts a model together from what a clip declares and what was seen: scene, priors, problem."""
