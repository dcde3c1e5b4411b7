"""A checkpoint belongs to one model: whatever changes what the chains sample changes its name."""

from dataclasses import replace

import numpy as np
import pytest

from galileo_jax.api.fit import FitOptions, checkpoint_identity, chosen_effects
from galileo_jax.assembly.build_problem import make_joint_problem
from galileo_jax.clip.load import load_clip
from galileo_jax.measurement.measure import measure
from galileo_jax.runtime.errors import InputError
from tests.clip.broken_clips import build_good_track

EFFECT = """
from galileo_jax.model.effects import Effect, LogNormal, Parameter, register

@register
class {name}(Effect):
    name = "{name}"

    def parameters(self, scene):
        return (Parameter("{name}", "N", LogNormal(0.3, 1.2), 0.0, "effect", 0.1),)
"""


pytestmark = pytest.mark.usefixtures("effects_restored")


@pytest.fixture(scope="module")
def measured(tmp_path_factory):
    return [measure(load_clip(build_good_track(tmp_path_factory.mktemp("clip"))))]


def identity(measured, **options):
    chosen = FitOptions(method="mh", **options)
    clips, seen = [one.clip for one in measured], [one.observation for one in measured]
    effects = chosen_effects(chosen.effects, chosen.effects_from)
    return checkpoint_identity(measured, make_joint_problem(clips, seen, "auto", effects), chosen)


def test_the_same_call_goes_on(measured):
    assert identity(measured) == identity(measured)
    assert identity(measured) == identity(measured, max_steps=50), "longer is the same run"


@pytest.mark.parametrize(
    "option",
    [
        {"init": "cnn"},
        {"seed": 1},
        {"effects": ("air_drag",)},
        {"sampler": "random_walk"},
        {"chains": 9},
    ],
    ids=lambda option: next(iter(option)),
)
def test_another_option_is_another_run(measured, option):
    assert identity(measured, **option) != identity(measured)


def test_a_user_s_file_counts_by_its_contents(measured, tmp_path):
    path = tmp_path / "push.py"
    path.write_text(EFFECT.format(name="identity_push"))
    options = {"effects_from": (str(path),), "effects": ("identity_push",)}
    before = identity(measured, **options)
    path.write_text(path.read_text().replace("0.3, 1.2", "0.4, 1.2"))
    assert identity(measured, **options) != before
    path.unlink()
    with pytest.raises(InputError, match=r"push\.py"):
        identity(measured, **options)


def test_data_count(measured):
    before = identity(measured)
    seen = measured[0].observation
    mask = seen.mask.copy()
    mask[0, -1] = False
    hidden = replace(measured[0], observation=replace(seen, mask=mask))
    assert np.any(mask != seen.mask) and identity([hidden]) != before
