"""Effects of users: whatever they are called, and whatever attributes they have."""

from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest

import galileo_jax as gx
from galileo_jax.assembly.build_problem import make_joint_problem
from galileo_jax.clip.load import load_clip
from galileo_jax.measurement.measure import measure
from galileo_jax.model.effects.effect import Effect
from galileo_jax.model.parameters import LogNormal, Normal, Parameter
from galileo_jax.search.moves.copy_shape import shape_of
from galileo_jax.search.score_tests import strength_of


class Drag(Effect):
    name: ClassVar[str] = "drag"

    def parameters(self, scene):
        return (
            Parameter("drag", "kg/s", LogNormal(0.1, 1.0), 0.0, "effect", 0.1),
            Parameter("drag_start", "m", Normal(0.0, 1.0), 0.0, "effect", 0.1),
        )


class DragOfMine(Effect):
    """Its name begins with that of another."""

    name: ClassVar[str] = "drag_of_mine"

    def __init__(self, power: float = 1.0):
        self.power = power

    def parameters(self, scene):
        return (
            Parameter("drag_of_mine", "N", Normal(0.0, 1.0), 0.0, "effect", 0.1),
            Parameter("drag_of_mine_start", "m", Normal(0.0, 1.0), 0.0, "effect", 0.1),
        )


@pytest.fixture
def clip(tmp_path: Path) -> Path:
    path = tmp_path / "slide.csv"
    gx.simulate(path, scenario="incline", seed=1, track_only=True)
    return path


@pytest.mark.parametrize("effects", [(Drag(), DragOfMine()), (DragOfMine(), Drag())])
def test_an_effect_is_known_by_its_parameters_not_by_how_its_name_begins(clip, effects):
    measured = measure(load_clip(clip))
    trials = make_joint_problem([measured.clip], [measured.observation], effects=effects)
    names = [p.name for p in trials.model_parameters]
    for effect in ("drag", "drag_of_mine"):
        assert [names[i] for i in trials.brought_by(effect)] == [effect, f"{effect}_start"]
        assert strength_of(trials, effect)[0].tolist() == [names.index(effect)]
        assert shape_of(trials, effect) == {"_start": names.index(f"{effect}_start")}
    with pytest.raises(ValueError, match="effects not in the model: draggy; there: "):
        trials.brought_by("draggy")


def test_effects_that_do_not_the_same_are_not_the_same():
    assert DragOfMine(1.0) == DragOfMine(1.0) and hash(DragOfMine(1.0)) == hash(DragOfMine(2.0))
    assert DragOfMine(1.0) != DragOfMine(2.0)
    assert Drag() == Drag() and Drag() != DragOfMine()


KEEL = """
from galileo_jax.model.effects.effect import Effect
from galileo_jax.model.effects.registry import register
from galileo_jax.model.parameters import Normal, Parameter

@register
class Keel(Effect):
    name = "keel"
    def parameters(self, scene):
        return (Parameter("keel", "1", Normal(0.0, 0.3), 0.0, "effect", None),)
    def measure(self, position_m, theta, scene):
        xp = position_m.__array_namespace__()
        x, y = position_m[:, 0], position_m[:, 1]
        return xp.stack([x, y + theta["keel"] * x], axis=1)
"""


def test_a_name_that_begins_with_k_is_no_friction(tmp_path):
    """With an unknown scale friction is not determined: what is no friction may be."""
    file = tmp_path / "keel.py"
    file.write_text(KEEL)
    t = np.arange(60) / 60
    place = np.outer([np.cos(0.4), 0.1 * np.cos(0.4) - np.sin(0.4)], 120 * t**2)
    place += 0.1 * np.random.default_rng(0).standard_normal((2, 60))
    rows = [f"{a},{x},{y}" for a, x, y in zip(t, *place, strict=True)]
    (tmp_path / "s.csv").write_text("\n".join(["t,x,y", *rows]) + "\n")
    (tmp_path / "s.yaml").write_text(
        "track: s.csv\nscenario: incline\nramp_angle_deg: 22.918\ntrack_units: px\ntrack_y: up\n"
        "pixels_per_metre: null\nobjects: [{name: object1, shape: box}]\n"
    )
    found = gx.fit(tmp_path / "s.yaml", effects=["keel"], effects_from=[file])
    keel = found.parameters["keel"]
    assert not found.parameters["k1"]["identified"]
    assert keel["identified"] and abs(keel["mean"] - 0.1) < 0.02
