"""Effects by name, from a user's file and from installed packages."""

import importlib.metadata
from pathlib import Path

import numpy as np
import pytest

from galileo_jax.model.effects import (
    Effect,
    effect_names,
    load_file,
    make_effects,
    register,
    registry,
)
from galileo_jax.model.effects.effect import State
from galileo_jax.rollout.engine_path import EnginePath
from galileo_jax.runtime.errors import InputError
from tests.model.effects.motion import (
    LIBRARY,
    LONG_TABLE,
    OFF_THE_RAMP,
    PAIR,
    absent_theta,
    model_of,
)
from tests.ramp_model import make_surroundings

EXAMPLE = Path(__file__).resolve().parents[3] / "examples" / "my_effect.py"
RTOL = 3e-4  # steps of 1/240 s, and MuJoCo's least friction

SIMPLE = """
from galileo_jax.model.effects import Effect, register

@register
class Mine(Effect):
    name = "{name}"

    def parameters(self, scene):
        return ()
"""


@pytest.fixture(autouse=True)
def forgotten(monkeypatch):
    """What a test registers is gone after it."""
    effect_names()
    monkeypatch.setattr(registry.effect_registry, "_entries", dict(_entries()))
    registry._load_resolved.cache_clear()


def _entries():
    return registry.effect_registry._entries


def test_effects_are_made_by_name_in_one_order():
    made = make_effects(["release_delay", "air_drag", "frame_rate"])
    assert [effect.name for effect in made] == ["air_drag", "frame_rate", "release_delay"]
    assert all(isinstance(effect, Effect) for effect in made)
    again = make_effects(["frame_rate", "air_drag", "release_delay"])
    assert made == again and hash(made) == hash(again), "one compiled program"
    assert make_effects([]) == ()


def test_an_unknown_name_lists_the_known():
    with pytest.raises(InputError, match="unknown effect 'drga'; known: added_mass, air_drag"):
        make_effects(["drga"])
    with pytest.raises(
        InputError, match=r"uneven_pressure, viscous_drag; did you mean air_drag\?$"
    ):
        make_effects(["airdrag"])


def test_a_name_given_twice():
    with pytest.raises(InputError, match="'rolling' is named twice"):
        make_effects(["rolling", "air_drag", "rolling"])


def test_the_example_is_an_effect_like_any_other():
    assert load_file(EXAMPLE) == ("cubic_drag",)
    assert set(effect_names()) == {*LIBRARY, *OFF_THE_RAMP, "cubic_drag"}
    (effect,) = make_effects(["cubic_drag"])
    (parameter,) = effect.parameters(PAIR)
    assert (parameter.name, parameter.absent, parameter.role) == ("cubic_drag", 0.0, "effect")
    force = effect.force({"cubic_drag": np.array(2.0)}, PAIR)
    assert force is not None
    state = State(np.zeros(2), np.array([-1.0, 0.5]), np.array(0.0), np.zeros(2, bool))
    assert force(state) == pytest.approx([2.0, -0.25])


def test_the_example_rolls_out():
    """Without friction dv/dq = -c v^2 / m: 1 / v grows by c / m per metre."""
    load_file(EXAMPLE)
    engine = EnginePath(model_of(make_surroundings(LONG_TABLE), ("cubic_drag",)))
    theta = absent_theta(engine.model, (0.5, 0.3), (0.0, 0.0))
    theta[engine.model.index("cubic_drag")] = 0.7
    position, velocity = engine.simulate(theta[None])
    x, v = position[0, 0, 0], velocity[0, 0, 0]
    past = np.flatnonzero(x > 0.01)
    growth = (1 / v[past[-1]] - 1 / v[past[0]]) / (x[past[-1]] - x[past[0]])
    assert growth == pytest.approx(0.7 / 0.5, rel=RTOL)


def test_a_file_is_run_once(tmp_path):
    file = tmp_path / "mine.py"
    file.write_text(SIMPLE.format(name="mine"))
    assert load_file(file) == load_file(str(file)) == ("mine",)


def test_a_missing_file(tmp_path):
    with pytest.raises(InputError, match=r"nowhere\.py: no such file"):
        load_file(tmp_path / "nowhere.py")


def test_no_python_file(tmp_path):
    file = tmp_path / "effects.txt"
    file.write_text("air_drag")
    with pytest.raises(InputError, match=r"effects\.txt: no Python file \(\.py\)"):
        load_file(file)


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("import math\n\nmath.nothing()\n", "line 3: AttributeError"),
        ("def broken(:\n", "SyntaxError"),
        ("import no_such_package_here\n", "line 1: ModuleNotFoundError: No module named"),
        ("x = 1\n", "registers no effect; decorate one with @register"),
        (SIMPLE.format(name="air_drag"), "line 4: two effects are named 'air_drag'"),
        (
            SIMPLE.format(name="one") + SIMPLE.format(name="one"),
            "line 13: two effects are named 'one'",
        ),
    ],
)
def test_a_file_that_will_not_do(tmp_path, text, complaint):
    file = tmp_path / "mine.py"
    file.write_text(text)
    with pytest.raises(InputError) as raised:
        load_file(file)
    assert complaint in str(raised.value) and str(file) in str(raised.value)
    assert len(str(raised.value).splitlines()) == 1


def test_register_takes_named_effects_only():
    class Taken(Effect):
        name = "rolling"

    class Nameless(Effect):
        pass

    for wrong, complaint in (
        (Taken, "two effects are named 'rolling'"),
        (Nameless, "Nameless has no name"),
        (dict, "is not a subclass of Effect"),
    ):
        with pytest.raises(InputError, match=complaint):
            register(wrong)  # pyright: ignore[reportArgumentType]


def announce(monkeypatch, value):
    entry = importlib.metadata.EntryPoint("any", value, registry.ENTRY_POINTS)

    def entry_points(group):
        return [entry] if group == registry.ENTRY_POINTS else []

    monkeypatch.setattr(importlib.metadata, "entry_points", entry_points)
    monkeypatch.setattr(registry.effect_registry, "_is_loaded", False)


def test_installed_packages_bring_effects(tmp_path, monkeypatch):
    (tmp_path / "their_effects.py").write_text(SIMPLE.format(name="theirs"))
    monkeypatch.syspath_prepend(tmp_path)
    announce(monkeypatch, "their_effects")
    assert "theirs" in effect_names()
    assert make_effects(["theirs"])[0].name == "theirs"


def test_an_installed_package_that_will_not_load(monkeypatch):
    announce(monkeypatch, "package_that_is_gone")
    with pytest.raises(InputError, match="effects of package_that_is_gone"):
        effect_names()
