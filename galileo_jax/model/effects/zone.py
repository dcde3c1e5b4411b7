"""A zone of object 1's path: where it begins, how long it is, and what lies inside."""

from galileo_jax.model.effects.effect import Array, Surroundings, Theta
from galileo_jax.model.parameters import LogNormal, Parameter, Uniform

EDGE_M = 0.005  # tanh: at 2 m/s a step is 8 mm, and sharper edges would fall between steps
PAST_FOOT_M, WITHOUT_FOOT_M = 0.3, 0.5  # how far along zones may begin
LENGTH_PRIOR = LogNormal(median=0.1, sd=0.7)


def zone_parameters(name: str, scene: Surroundings) -> tuple[Parameter, Parameter]:
    """`NAME_start` and `NAME_length`, m; while the strength is absent they mean nothing.

    The start may be anywhere from object 1's own to somewhat past the foot (without one, to
    half a metre on).
    """
    low = scene.start_path_m[0]
    high = PAST_FOOT_M if scene.comes_down[0] else low + WITHOUT_FOOT_M
    middle, long = (low + high) / 2, LENGTH_PRIOR.median
    return (
        Parameter(f"{name}_start", "m", Uniform(low, high), middle, "effect", 0.1),
        Parameter(f"{name}_length", "m", LENGTH_PRIOR, long, "effect", 0.1),
    )


def share_inside(path_m: Array, name: str, theta: Theta) -> Array:
    """How much of the zone's strength acts at `path_m` `[..., object]`: 0 to 1."""
    xp = path_m.__array_namespace__()
    start = theta[f"{name}_start"][..., None]
    end = start + theta[f"{name}_length"][..., None]
    return 0.5 * (xp.tanh((path_m - start) / EDGE_M) - xp.tanh((path_m - end) / EDGE_M))
