"""What acts in one place is compared with all else that acts in one place, in that place."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from galileo_jax.diagnosis import fitted_pairs
from tests.diagnosis.test_verdict import candidate

NAMES = [
    "k1",
    "patch",
    "patch_start",
    "patch_length",
    "brake",
    "brake_start",
    "brake_length",
    "air",
]
LIBRARY = ("air", "brake", "patch")


def parameters() -> list[Any]:
    return [SimpleNamespace(name=name) for name in NAMES]


@pytest.fixture
def raced(monkeypatch):
    """What a race is asked to fit, `{effects: starts}`."""
    asked: dict[tuple[str, ...], np.ndarray] = {}

    def race(bases, sets, starts):
        asked.update(zip(sets, starts, strict=True))
        return []

    caller: Any = type("Caller", (SimpleNamespace,), {"__call__": staticmethod(race)})
    monkeypatch.setattr(fitted_pairs, "reduced", lambda *_: None)
    trials = SimpleNamespace(model_parameters=parameters())
    return caller(fitter=SimpleNamespace(trials=trials)), asked


def pair(*effects: str) -> Any:
    z = np.arange(1.0, 1.0 + len(NAMES))
    return SimpleNamespace(effects=effects, hypothesis=SimpleNamespace(fit=SimpleNamespace(z=z)))


def test_a_brake_starts_in_the_patch_s_place(raced):
    race, asked = raced
    fitted_pairs._in_its_place(race, pair("air", "patch"), LIBRARY)
    assert list(asked) == [("air", "brake")]
    starts = asked["air", "brake"]
    assert starts[:, NAMES.index("brake")].tolist() == list(fitted_pairs.STRENGTHS_Z)
    for part in ("_start", "_length"):
        own = NAMES.index("patch" + part) + 1.0
        assert (starts[:, NAMES.index("brake" + part)] == own).all()


def test_two_of_a_place_or_none(raced):
    race, asked = raced
    assert fitted_pairs._in_its_place(race, pair("patch", "brake"), LIBRARY) == []
    assert fitted_pairs._in_its_place(race, pair("air", "other"), LIBRARY) == []
    assert not asked


def test_of_the_same_effects_the_best_fit_stays():
    fits = [
        candidate("a+b", 1.0),
        candidate("b+a", 5.0),
        candidate("a+c", 2.0),
    ]
    found = fitted_pairs.best_of_each(fits)
    assert sorted(c.effects for c in found) == [("a", "c"), ("b", "a")]
