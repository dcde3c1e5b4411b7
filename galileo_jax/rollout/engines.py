"""The engines by name, and which one `auto` takes."""

from galileo_jax.model.effects.effect import infers_gravity
from galileo_jax.model.model import Model
from galileo_jax.rollout.engine_names import ENGINES
from galileo_jax.rollout.engine_particle import EngineParticle
from galileo_jax.rollout.engine_path import EnginePath
from galileo_jax.rollout.rollout import Engine
from galileo_jax.runtime.errors import InputError


def make_engine(name: str, model: Model) -> Engine:
    """The engine `name` for a model.

    `auto` takes the rigid engine: exact where MuJoCo's contacts are compliant, and many times
    faster on every device (`python -m benchmarks rollouts`). MuJoCo's engines check it.

    Raises:
      InputError: unknown name (lists the known), or a scene that the engine does not have.
    """
    if name not in ENGINES:
        raise InputError(f"engine: unknown value {name!r}; known: {', '.join(ENGINES)}")
    if model.motion == "free":
        return _free(name, model)
    scene = model.scene.surroundings
    is_particle = scene.is_level or not scene.has_surface
    if name in ("auto", "rigid"):
        return EngineParticle(model) if is_particle else EnginePath(model)
    if is_particle:
        raise InputError(f"engine: {name!r} has no scene without a ramp; rigid or auto expected")
    if any(scene.rolls):
        raise InputError(f"engine: {name!r} has nothing that rolls; rigid or auto expected")
    if name == "mjx":
        from galileo_jax.rollout.engine_mjx import EngineMJX

        return EngineMJX(model)
    from galileo_jax.rollout.engine_c import EngineC

    return EngineC(model)


def _free(name: str, model: Model) -> Engine:
    """Boxes are JAX's, whatever else slides is the C engine's."""
    if name == "auto":
        name = "rigid" if all(shape == "box" for shape in model.scene.shapes) else "c"
    if name == "rigid":
        from galileo_jax.rollout.engine_boxes import EngineBoxes

        return EngineBoxes(model)
    if name != "c":
        raise InputError(
            f"engine: {name!r} moves objects in a plane; --motion free is of rigid, c or auto"
        )
    if infers_gravity(model.effects + model.nuisances):
        raise InputError(
            "free: gravity: engine c takes it as declared; leave it out, or rigid for boxes"
        )
    from galileo_jax.rollout.engine_c_free import EngineCFree

    return EngineCFree(model)
