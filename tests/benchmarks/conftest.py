"""Effects that benchmarks bring are gone after each of their tests."""

import pytest

from galileo_jax.model.effects import registry


@pytest.fixture(autouse=True)
def _effects_stay_as_they_were(monkeypatch):
    registry.effect_names()  # those of the package
    monkeypatch.setattr(
        registry.effect_registry, "_entries", dict(registry.effect_registry._entries)
    )
