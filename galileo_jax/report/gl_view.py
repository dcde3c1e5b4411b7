"""The scene rendered by MuJoCo from the side, in a process of its own.

OpenGL without a screen may be missing, and may take the process down with it; then the
answer is None, and the caller draws.
"""

import json
import math
import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

import mujoco
import numpy as np

from galileo_jax.model.scene.scene import Scene
from galileo_jax.report.side_view import SLAB_M, Still, View, surfaces
from galileo_jax.rollout.motion import pitch

TIMEOUT_S = 60
DEPTH_M = 0.15  # half of ramp's and table's extent towards the camera
HIDDEN_GROUP = 4
BACKGROUND = [0.95, 0.945, 0.935]

_CHILD = """
import json, sys
import mujoco
import numpy as np
job = json.load(open(sys.argv[1]))
model = mujoco.MjModel.from_xml_string(job["xml"])
data = mujoco.MjData(model)
pictures = []
with mujoco.Renderer(model, job["height"], job["width"]) as renderer:
    for qpos, quats in job["stills"]:
        data.qpos[:] = qpos
        for name, quat in quats.items():
            model.geom(name).quat[:] = quat
        mujoco.mj_forward(model, data)
        renderer.update_scene(data, camera="side")
        pictures.append(renderer.render())
np.save(sys.argv[2], np.stack(pictures))
"""


def render(scene: Scene, stills: Sequence[Still], view: View) -> np.ndarray | None:
    """Pictures `[still, height, width, 3]`, uint8 RGB; None where OpenGL does not work."""
    surroundings = scene.surroundings
    home = np.asarray(surroundings.start_m)
    jobs = []
    for still in stills:
        turned = pitch(still.position_m, surroundings)
        quats = {
            # MuJoCo's y axis points away from the camera: a positive turn is clockwise.
            f"object{i + 1}_shape": [math.cos(a / 2), 0.0, -math.sin(a / 2), 0.0]
            for i, a in enumerate(turned.tolist())
        }
        jobs.append(((still.position_m - home).reshape(-1).tolist(), quats))
    job = {
        "xml": _xml(scene, view),
        "width": view.width_px,
        "height": view.height_px,
        "stills": jobs,
    }
    environment = {"MUJOCO_GL": "egl", **os.environ}
    with tempfile.TemporaryDirectory() as folder:
        asked, answered = Path(folder) / "job.json", Path(folder) / "pictures.npy"
        asked.write_text(json.dumps(job), encoding="utf-8")
        try:
            subprocess.run(
                [sys.executable, "-c", _CHILD, str(asked), str(answered)],
                env=environment, check=True, capture_output=True, timeout=TIMEOUT_S,
            )  # fmt: skip
        except (subprocess.SubprocessError, OSError):
            return None
        pictures = np.load(answered)
    return pictures[:, :, ::-1] if view.is_mirrored else pictures


def _xml(scene: Scene, view: View) -> str:
    """The scene with slabs in place of the endless planes, a side camera and light."""
    spec = scene.spec.copy()
    for name in ("ramp", "table"):
        if (plane := spec.geom(name)) is not None:
            plane.group = HIDDEN_GROUP
    for (x, y), length, angle in surfaces(scene, view):
        if length <= 0:
            continue
        down = 1 if math.cos(angle) > 0 else -1
        centre = (
            x + length / 2 * math.cos(angle) + SLAB_M / 2 * down * math.sin(angle),
            y + length / 2 * math.sin(angle) - SLAB_M / 2 * down * math.cos(angle),
        )
        spec.worldbody.add_geom(
            type=mujoco.mjtGeom.mjGEOM_BOX,  # pyright: ignore
            size=[length / 2, DEPTH_M, SLAB_M / 2],
            pos=[centre[0], 0, centre[1]],
            quat=[math.cos(angle / 2), 0, -math.sin(angle / 2), 0],
            rgba=[0.73, 0.71, 0.67, 1],
            contype=0,
            conaffinity=0,
        )
    spec.add_texture(
        name="sky",
        type=mujoco.mjtTexture.mjTEXTURE_SKYBOX,  # pyright: ignore
        builtin=mujoco.mjtBuiltin.mjBUILTIN_FLAT,  # pyright: ignore
        rgb1=BACKGROUND,
        rgb2=BACKGROUND,
        width=32,
        height=192,
    )
    spec.worldbody.add_camera(
        name="side",
        pos=[(view.left_m + view.right_m) / 2, -3, (view.bottom_m + view.top_m) / 2],
        quat=[math.sqrt(0.5), math.sqrt(0.5), 0, 0],
        proj=mujoco.mjtProjection.mjPROJ_ORTHOGRAPHIC,  # pyright: ignore
        fovy=view.top_m - view.bottom_m,
    )
    spec.visual.headlight.ambient = [0.5, 0.5, 0.5]
    spec.visual.headlight.diffuse = [0.2, 0.2, 0.2]
    spec.visual.headlight.specular = [0, 0, 0]
    for light in spec.lights:
        light.diffuse, light.specular = [0.3, 0.3, 0.3], [0, 0, 0]
    spec.visual.global_.offwidth, spec.visual.global_.offheight = view.width_px, view.height_px
    spec.compile()
    return spec.to_xml()
