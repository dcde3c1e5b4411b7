"""Floor: what falls on it leaves with a share of its speed.

    v_y+ = -e v_y-,    v_x+ = (1 - grip) v_x-

Impacts slower than 0.02 m/s do not rebound. The grip is that of each impact: a ball that slips
loses less and less of its speed along the floor, and what rolls nothing.

Source: Newton, Principia, laws of motion, scholium (1687); Cross (2002), Grip-slip behavior of
a bouncing ball, Am. J. Phys. 70, 1093.
"""

from galileo_jax.model.effects import Bounce, Effect, Normal, Parameter, Uniform

MOST_GRIP = 0.6  # a ball that stops slipping keeps 5/7 of its speed or so


class Floor(Effect, where=lambda scene: "floor" in scene.laws):
    name = "floor"

    def parameters(self, scene):
        height = Normal(*scene.expected["floor_height"])
        found = [
            Parameter("floor_restitution", "1", Uniform(0.0, 1.0), 0.0, "main", 0.05),
            Parameter("floor_height", "m", height, 0.0, "main", 0.05, per_clip=True),
        ]
        if scene.moves_in_plane:
            found.append(Parameter("floor_grip", "1", Uniform(0.0, MOST_GRIP), 0.0, "main", 0.05))
        return tuple(found)

    def bounce(self, theta, scene):
        restitution = theta["floor_restitution"]
        grip = theta["floor_grip"] if scene.moves_in_plane else 0.0 * restitution
        return Bounce(theta["floor_height"], restitution, grip)
