"""A mass that acts on nothing is not shown; one that a force or a hit depends on is."""

import pytest

from galileo_jax.results.shown_parameters import shown_parameters


@pytest.mark.parametrize(
    ("parameters", "derived", "hidden"),
    [
        ({"m1": "kg", "k1": "1"}, {}, {"m1"}),
        ({"m1": "kg"}, {}, {"m1"}),
        ({"m1": "kg", "gravity": "m/s^2"}, {}, {"m1"}),
        ({"m1": "kg", "air_drag": "kg/m"}, {"air_drag_per_mass": "1/m"}, set()),
        ({"m1": "kg", "initial_push": "N s"}, {}, set()),
        ({"m1": "kg", "scale_error": "1"}, {}, {"m1"}),
        ({"m1": "kg", "period": "s"}, {"stiffness": "N/m", "stretch": "m"}, set()),
        ({"m1": "kg", "k1": "1", "m2": "kg", "k2": "1"}, {"mass_ratio": "1"}, set()),
    ],
)
def test_shown(parameters, derived, hidden):
    rooms = {"parameters": parameters, "derived": derived}
    result = {
        room: {name: {"unit": unit} for name, unit in units.items()}
        for room, units in rooms.items()
    }
    before = repr(result)
    shown = shown_parameters(result)
    assert list(shown) == [name for name in {**parameters, **derived} if name not in hidden]
    assert repr(result) == before
