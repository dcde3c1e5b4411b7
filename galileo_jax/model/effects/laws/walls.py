"""Walls: pucks bounce off straight walls that are seen from above.

    v_n+ = -e v_n-,    |J_t| <= grip J_n    or as much as stops the rim's slip

n across the wall, t along it; the rim slips at v_t - r turning. Impacts slower than 0.02 m/s do not
rebound. A wall's ends are marked by eye: each may be off across the wall by some millimetres.

Closed form: without friction and grip a puck leaves at the angle of which the tangent is e times
that at which it came (both to the wall's normal: 1 / e times). With e = 1 its way, reflected at a
line one radius before the wall, is straight.

Source: Newton, Principia, laws of motion, scholium (1687); Walton (1993), in: Particulate two-phase
flow (the impulse along the wall).
"""

from galileo_jax.model.effects import Effect, Normal, Parameter, Uniform, Walls

END_SD_M = 0.003  # as well as a rail's face is measured, or marked in a picture
ENDS = ("from", "to")


class StraightWalls(Effect, where=lambda scene: "walls" in scene.laws):
    name = "walls"

    def parameters(self, scene):
        place = Normal(0.0, END_SD_M)
        return (
            Parameter("wall_restitution", "1", Uniform(0.0, 1.0), 0.0, "main", 0.05),
            Parameter("wall_grip", "1", Uniform(0.0, 1.0), 0.0, "main", 0.1),
            *(
                Parameter(name, "m", place, 0.0, "nuisance", 0.1)
                for i in range(len(scene.walls_m))
                for name in _offsets(i)
            ),
        )

    def walls(self, theta, scene):
        restitution = theta["wall_restitution"]
        xp = restitution.__array_namespace__()
        found = []
        for i, (one, other) in enumerate(scene.walls_m):
            along = xp.stack([xp.asarray(other[k]) - xp.asarray(one[k]) for k in range(2)])
            left = xp.stack([-along[1], along[0]]) / xp.sqrt(xp.sum(along**2))
            ends = [
                xp.stack([xp.asarray(end[k]) + theta[name] * left[k] for k in range(2)], axis=-1)
                for end, name in zip((one, other), _offsets(i), strict=True)
            ]
            found.append(xp.stack(ends, axis=-2))
        return Walls(xp.stack(found, axis=-3), restitution, theta["wall_grip"])


def _offsets(i: int) -> tuple[str, ...]:
    """Names of how far the ends of a wall are off."""
    return tuple(f"wall_offset_{end}{i + 1}" for end in ENDS)
