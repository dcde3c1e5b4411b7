"""The scene with bodies that move freely: their drawn shapes touch, each has six coordinates."""

# mujoco's classes live in a compiled module without stubs.
# pyright: reportAttributeAccessIssue=false

from itertools import combinations

import mujoco

from galileo_jax.model.scene.scene import Scene
from galileo_jax.runtime.errors import InputError

SHAPES = (mujoco.mjtGeom.mjGEOM_BOX, mujoco.mjtGeom.mjGEOM_CYLINDER)
SURFACES = ("ramp", "table")
SOLVER_ITERATIONS = 50
# Four corners carry the weight: stiff, and without rebound. The force grows from no
# penetration, as in scenes/ramp.xml.
SURFACE_SOLREF, SURFACE_SOLIMP = (0.002, 2.0), (0.0, 0.999, 0.0005, 0.5, 2.0)
FACE_SOLIMP = (0.0, 0.999, 0.0002, 0.5, 2.0)
SMOOTH = 1e-5  # faces do not rub, as in the planar scene


def free_model(scene: Scene, timestep_s: float) -> mujoco.MjModel:
    """Compiles the scene with free joints, true shapes and masses of 1 kg.

    Objects stand flat and level; `z_m` of the scene puts them across the travel. Contact pairs
    are named `object1_table`, `object1_ramp` and `object1_object2`, as in scenes/ramp.xml.

    Raises:
      InputError: an object is neither a box nor an upright cylinder.
    """
    spec = scene.spec.copy()
    spec.option.timestep = timestep_s
    spec.option.iterations = spec.option.ls_iterations = SOLVER_ITERATIONS
    for pair in list(spec.pairs):
        spec.delete(pair)
    places = zip(scene.names, scene.surroundings.half_height_m, scene.z_m, strict=True)
    bodies = [f"object{i + 1}" for i in range(len(scene.names))]
    for name, (declared, height, z) in zip(bodies, places, strict=True):
        body, shape = spec.body(name), spec.geom(f"{name}_shape")
        if shape.type not in SHAPES:
            raise InputError(f"motion: free: {declared} is neither a box nor an upright cylinder")
        for element in (*body.joints, *body.geoms):
            if element.name != shape.name:
                spec.delete(element)
        body.add_freejoint(name=f"{name}_free")
        # MuJoCo's y points away from the camera.
        body.pos = [body.pos[0], -z, height]
        body.explicitinertial = False
        shape.mass = 1.0
        shape.alt.type, shape.quat = mujoco.mjtOrientation.mjORIENTATION_QUAT, [1, 0, 0, 0]
    pairs = [
        (f"{body}_{surface}", surface, f"{body}_shape", SURFACE_SOLIMP)
        for body in bodies
        for surface in SURFACES
    ]
    for one, other in combinations(bodies, 2):
        pairs.append((f"{one}_{other}", f"{one}_shape", f"{other}_shape", FACE_SOLIMP))
    for name, one, other, solimp in pairs:
        spec.add_pair(
            name=name,
            geomname1=one,
            geomname2=other,
            condim=3,
            friction=[SMOOTH, SMOOTH, 0, 0, 0],
            solref=SURFACE_SOLREF,
            solimp=solimp,
        )
    return spec.compile()
