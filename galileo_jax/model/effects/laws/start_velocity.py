"""Start velocity: the object moves when it is first seen, nobody lets it go.

    v(0) = (start_velocity_x, start_velocity_y)    in the plane, x along the travel, y up;
                                                   in space with start_velocity_z
    v(0) = start_speed                             on a straight path, downward; on a thread forward

    launch_speed = start_velocity_x / cos(launch_angle)

where a launcher at a declared angle stands before the first frame: it is the speed where the path
has that angle. Drag on the way from there is neglected.

A throw, a swing that is under way, a body that was let go before the clip begins.
"""

from galileo_jax.model.effects import Effect, Normal, Parameter, by_object

SPACE = ("start_velocity_x", "start_velocity_y", "start_velocity_z")
PLANE = SPACE[:2]
PATH = ("start_speed",)
LAUNCH = "launch_angle"


class StartVelocity(Effect, where=lambda scene: "start_velocity" in scene.laws):
    name = "start_velocity"

    def parameters(self, scene):
        found = [
            Parameter(name, "m/s", Normal(*scene.expected[name]), 0.0, "main", 0.05, per_clip=True)
            for name in (SPACE[: scene.num_axes] if scene.is_thrown else PATH)
        ]
        if scene.is_thrown and LAUNCH in scene.expected:
            prior = Normal(*scene.expected[LAUNCH])
            found.append(Parameter(LAUNCH, "rad", prior, prior.mean, "nuisance", step=None))
        return tuple(found)

    def start_velocity(self, theta, scene):
        if not scene.is_thrown:
            return None
        return by_object(theta, [SPACE[: scene.num_axes]])

    def start_speed(self, theta, scene):
        if scene.is_thrown:
            return None
        return scene.only(theta[PATH[0]], 0)

    def derived(self, theta, scene):
        if not scene.is_thrown:
            return {}
        x, y, *z = (theta[name] for name in SPACE[: scene.num_axes])
        xp = x.__array_namespace__()
        level = xp.hypot(x, z[0]) if z else x
        found = {
            "start_speed": (xp.hypot(level, y), "m/s"),
            "start_angle": (xp.atan2(y, level), "rad"),
        }
        if LAUNCH in scene.expected:
            found["launch_speed"] = (x / xp.cos(theta[LAUNCH]), "m/s")
        return found
