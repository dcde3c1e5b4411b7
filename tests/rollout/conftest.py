"""One MJX engine for all tests of this room: it takes half a minute to compile."""

import pytest

from galileo_jax.rollout.engine_c import EngineC
from galileo_jax.rollout.engine_mjx import EngineMJX
from galileo_jax.rollout.rollout import Engine
from tests.precision import in_64_bit
from tests.ramp_model import HIT, make_model

CLIP_S = 1.2  # past the hit


@pytest.fixture(scope="session")
def engines() -> dict[str, Engine]:
    """MuJoCo's engines on the same model, `HIT`."""
    with in_64_bit():
        model = make_model(HIT, CLIP_S)
        return {"c": EngineC(model), "mjx": EngineMJX(model)}


@pytest.fixture(autouse=True)
def precision():
    """What the commands compute in."""
    with in_64_bit():
        yield
