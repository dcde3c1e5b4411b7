"""Metropolis-Hastings samplers and the driver that runs them."""
