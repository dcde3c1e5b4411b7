"""Fixtures of the API's tests."""

import pytest

from galileo_jax.model.effects import registry


@pytest.fixture
def effects_restored(monkeypatch):
    """The effects that a test registers are gone after it."""
    entries = {name: registry.effect_registry[name] for name in registry.effect_names()}
    monkeypatch.setattr(registry.effect_registry, "_entries", entries)
    registry._load_resolved.cache_clear()
