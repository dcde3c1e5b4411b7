"""Spring tether: a spring (a rubber band) ties object 1 to where it is let go.

    F = -K (q - q_start)          along the path,
    F = -K (r - r_start)          straight to that point,

slack at the declared start. On the ramp both are the same. On the table a band led round the foot
pulls along the path; a free one pulls straight, so that it also lifts the object and lightens what
rubs. `spring_tether_straightness` is 0 for the one and 1 for the other.

Source: Hooke, De potentia restitutiva (1678).
Confused with: constant_force and k1 on a short path; air_drag in part (both grow on the way).
"""

from galileo_jax.model.effects import Effect, LogNormal, Normal, Parameter, register

PRIOR = LogNormal(median=1.0, sd=1.2)
STRAIGHTNESS_PRIOR = Normal(0.5, 0.5)  # led round the foot or free: both one sd from the middle


@register
class SpringTether(Effect):
    name = "spring_tether"

    def parameters(self, scene):
        stiffness = Parameter("spring_tether", "N/m", PRIOR, 0.0, "effect", 0.1)
        name, prior = "spring_tether_straightness", STRAIGHTNESS_PRIOR
        # It means nothing while the strength is absent.
        straightness = Parameter(name, "1", prior, prior.mean, "effect", 0.1)
        return (stiffness, straightness) if scene.crosses_foot else (stiffness,)

    def force(self, theta, scene):
        stiffness = scene.only(theta["spring_tether"], 0)
        start = scene.start_path_m[0]
        if not scene.crosses_foot:
            return lambda state: -stiffness * (state.path_m - start)
        # On the table a straight band is shorter: its start is not so far back as along the ramp.
        straight = theta["spring_tether_straightness"][..., None]
        cos = stiffness.__array_namespace__().cos(scene.angle_rad)
        nearer = straight * start * (cos - 1.0)

        def pull(state):
            on_table = (state.path_m > 0.0).astype(state.path_m.dtype)
            return -stiffness * (state.path_m - start - on_table * nearer)

        return pull

    def friction(self, theta, scene):
        if not scene.crosses_foot or not scene.has_surface:
            return None
        stiffness = scene.only(theta["spring_tether"], 0)
        xp = stiffness.__array_namespace__()
        height_m = -scene.start_path_m[0] * xp.sin(scene.angle_rad)
        lifts = stiffness * height_m * theta["spring_tether_straightness"][..., None]
        carried = lifts / scene.weight(theta)

        def law(state, k):
            on_table = (state.path_m > 0.0).astype(state.path_m.dtype)
            return k * (1.0 - on_table * carried)

        return law
