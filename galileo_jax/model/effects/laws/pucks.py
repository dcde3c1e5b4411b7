"""Pucks: discs on a level table, seen from above.

    w = (v_x, v_y, r turning / sqrt(2)),    w' = -k g w / |w|

A puck's friction is opposed to its sliding and its turning together: it slides straight and turns
evenly less, both come to rest at once, and friction takes k m g of its energy m w^2 / 2 for each
metre of |w|. This is the ellipsoidal limit surface with a torque of m k g r / sqrt(2) about the
centre of a puck that turns on the spot (evenly pressed discs: 2/3 in place of 0.71; rings: 1).

At a hit, n along the centres and t across them,

    v_n+ = -e v_n-,    |J_t| <= grip J_n    or as much as stops the rims' slip

Closed form: without another force a puck stops after v^2 / (2 k g); discs of the same mass that
meet head-on at e = 1 exchange their velocities.

Source: Goyal, Ruina and Papadopoulos (1991), Planar sliding with dry friction, Wear 143, 307; Howe
and Cutkosky (1996), Practical force-motion models for sliding manipulation, Int. J. Robotics Res.
15, 557; Farkas et al. (2003), Frictional coupling between sliding and spinning motion, Phys. Rev.
Lett. 90, 248302 (both stop at once); Walton (1993), in: Particulate two-phase flow (impact).
"""

from galileo_jax.model.effects import (
    Effect,
    LogNormal,
    Normal,
    Parameter,
    Rims,
    Role,
    Uniform,
    by_object,
)

# In `Surroundings.expected`: how well places relative to each other are known.
OFFSET = "hit_offset"
OFFSETS = (f"{OFFSET}_x", f"{OFFSET}_y")
# Friction of two rims: plastics 0.1 to 0.4, rubber 1; magnets in rims repel, and hardly touch.
GRIP, GRIP_SD = 0.1, 1.5  # the median; of the logarithm
START = ("start_velocity_x", "start_velocity_y", "start_turning")


class Pucks(Effect, where=lambda scene: "pucks" in scene.laws):
    name = "pucks"

    def parameters(self, scene):
        units = ("m/s", "m/s", "rad/s")
        # Turning that is not in the track is known from the picture, and no result of the fit.
        roles: tuple[Role, ...] = ("main", "main", "main" if scene.num_axes == 3 else "nuisance")
        found = [
            Parameter(name, unit, Normal(*scene.expected[name]), 0.0, role, 0.05, per_clip=True)
            for own in scene.numbered(*START)
            for name, unit, role in zip(own, units, roles, strict=True)
            if name in scene.expected
        ]
        if len(scene.names) > 1:
            found += [
                Parameter("restitution", "1", Uniform(0.0, 1.0), 0.0, "main", 0.05),
                Parameter("grip", "1", LogNormal(GRIP, GRIP_SD), 0.0, "main", 0.1),
            ]
            place = Normal(*scene.expected[OFFSET])
            found += [
                Parameter(name, "m", place, 0.0, "nuisance", 0.1)
                for own in scene.numbered(*OFFSETS)[1:]
                for name in own
            ]
        return tuple(found)

    def start_velocity(self, theta, scene):
        return by_object(theta, scene.numbered(*START))

    def rims(self, theta, scene):
        zero = 0.0 * theta["m1"]
        places = by_object(theta, scene.numbered(*OFFSETS))
        return Rims(theta.get("restitution", zero), theta.get("grip", zero), places)

    def derived(self, theta, scene):
        if scene.is_scale_known:
            return {}
        return {
            f"deceleration{i + 1}": (
                theta[f"k{i + 1}"] * scene.gravity / scene.half_length_m[i],
                "radii/s^2",
            )
            for i in range(len(scene.names))
        }
