"""The scenarios a clip can show: one small file each in `library/`, in one registry."""

from galileo_jax.clip.scenarios.scenario import SCENARIOS, Scenario, register

__all__ = ["SCENARIOS", "Scenario", "register"]
