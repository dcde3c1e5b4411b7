"""A zone of an object's path: where it begins, how long it is, how soft its edges are.

    share(q) = (tanh((q - start) / edge) - tanh((q - start - length) / edge)) / 2

What acts under a body of length L acts on the share of it that lies inside, which grows over L: as
tanh with an edge of L / 3. A magnet's field fades over its gap. So the edge is as unknown as the
zone.
"""

from galileo_jax.model.effects.effect import Array, Surroundings, Theta
from galileo_jax.model.parameters import LogNormal, Parameter, Uniform

PAST_FOOT_M, WITHOUT_FOOT_M = 0.3, 0.5  # how far along zones may begin
LENGTH_PRIOR = LogNormal(median=0.1, sd=0.7)
# A body of 5 cm, or a magnet that far away. Sharper than 5 mm (-1.2 sd) falls between two steps.
EDGE_PRIOR = LogNormal(median=0.015, sd=0.9)


def zone_parameters(name: str, scene: Surroundings) -> tuple[Parameter, ...]:
    """`NAME_start`, `NAME_length` and `NAME_edge`, m; without a strength they mean nothing.

    The start may be anywhere from object 1's own to somewhat past the foot (without one, to
    half a metre on, or as far as it is seen to go).
    """
    low = scene.start_path_m[0]
    high = PAST_FOOT_M if scene.comes_down[0] else low + max(WITHOUT_FOOT_M, scene.way_m)
    middle, long, edge = (low + high) / 2, LENGTH_PRIOR.median, EDGE_PRIOR.median
    return (
        Parameter(f"{name}_start", "m", Uniform(low, high), middle, "effect", 0.1),
        Parameter(f"{name}_length", "m", LENGTH_PRIOR, long, "effect", 0.1),
        Parameter(f"{name}_edge", "m", EDGE_PRIOR, edge, "effect", 0.1),
    )


def share_inside(path_m: Array, name: str, theta: Theta) -> Array:
    """How much of the zone's strength acts at `path_m` `[..., object]`: 0 to 1."""
    xp = path_m.__array_namespace__()
    start, edge = theta[f"{name}_start"][..., None], theta[f"{name}_edge"][..., None]
    end = start + theta[f"{name}_length"][..., None]
    return 0.5 * (xp.tanh((path_m - start) / edge) - xp.tanh((path_m - end) / edge))
