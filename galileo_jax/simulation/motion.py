"""How the objects of a truth move."""

from dataclasses import dataclass, fields
from typing import Literal

import jax
import jax.numpy as jnp
import numpy as np

from galileo_jax.model.effects.effect import Surroundings
from galileo_jax.model.model import SUBSTEPS, Model
from galileo_jax.model.scene.scene import Scene
from galileo_jax.rollout import engine_path
from galileo_jax.rollout.motion import pitch, to_plane
from galileo_jax.runtime.errors import InputError
from galileo_jax.simulation import solver as fine
from galileo_jax.simulation.truth import Truth

Solver = Literal["rigid", "fine", "free"]
SOLVERS: tuple[Solver, ...] = ("rigid", "fine")  # of motion in a plane
LONGEST_S = 5.0
# Between two records the motion is drawn straight: 0.05 mm off at most, in a hard impact.
RECORD_S = fine.STEP_S * fine.STEPS_PER_RECORD


@dataclass(frozen=True)
class Motion:
    """The motion of a truth, in the engine's time steps from the release on."""

    times_s: np.ndarray  # `[time]`
    position_m: np.ndarray  # `[object, 2, time]`
    velocity_m_s: np.ndarray
    pitch_rad: np.ndarray  # `[object, time]`, counter-clockwise positive
    z_m: np.ndarray | None = None  # `[object, time]`, towards the camera; None in a plane
    # `[object, 4, time]`, how each is turned from flat and level, as `free_start.Poses`; None in a
    # plane
    quaternion: np.ndarray | None = None

    @property
    def rest_s(self) -> float:
        """When the last object comes to rest; the end if none does."""
        moving = np.abs(self.velocity_m_s).max(axis=(0, 1)) > 1e-3
        last = np.flatnonzero(moving)
        return float(self.times_s[min(last[-1] + 1, len(moving) - 1)]) if last.size else 0.0

    def leaves_s(self, x_m: float) -> float:
        """When the first object is beyond `x_m`; the end if none ever is."""
        beyond = np.flatnonzero(self.position_m[:, 0].max(axis=0) > x_m)
        return float(self.times_s[beyond[0] if beyond.size else -1])

    def at(self, times_s: np.ndarray) -> "Motion":
        """The motion at other times, linear in between; at rest after the end."""

        def between(values: np.ndarray) -> np.ndarray:
            rows = values.reshape(-1, values.shape[-1])
            found = [np.interp(times_s, self.times_s, row) for row in rows]
            return np.reshape(found, (*values.shape[:-1], len(times_s)))

        each = ((one.name, getattr(self, one.name)) for one in fields(self))
        found = {name: between(values) for name, values in each if values is not None}
        if self.quaternion is not None:
            found["quaternion"] /= np.linalg.norm(found["quaternion"], axis=1, keepdims=True)
        return Motion(**{**found, "times_s": times_s})

    def events_s(self, truth: Truth) -> dict[str, float | None]:
        """When object 1's centre turns at the foot and when it meets object 2; None = never.

        And for each further object, `hitN`: when object N is first moved.
        """
        x = self.position_m[:, 0]
        # The bumpers give way by a fraction of a millimetre: moved says hit more surely.
        moved = [self._first_s(each - each[0] - 1e-5) for each in x[1:]]
        names = ("hit", *(f"hit{i}" for i in range(3, len(x) + 1)))
        found: dict[str, float | None] = {"foot": None, "hit": None}
        if truth.surroundings.has_table:
            found["foot"] = self._first_s(x[0] - truth.surroundings.corner_m[0])
        return found | dict(zip(names, moved, strict=False))

    def _first_s(self, value: np.ndarray) -> float | None:
        """When `value` `[time]`, negative at first, reaches zero."""
        reached = np.flatnonzero(value >= 0)
        if not reached.size:
            return None
        pair = slice(reached[0] - 1, reached[0] + 1)
        return round(float(np.interp(0.0, value[pair], self.times_s[pair])), 4)


def roll_out(truth: Truth, solver: Solver = "rigid", seconds: float = LONGEST_S) -> Motion:
    """Simulates a truth for `seconds`.

    By the engine that also fits ("rigid"), by small steps that share no event logic with it, for
    data that are to examine the fit ("fine", `solver.py`), or from the first hit on by MuJoCo's
    bodies, which turn and tip ("free").

    Raises:
      InputError: the simulation failed at these values.
    """
    scene = truth.surroundings
    if solver == "free":
        return _checked(truth, _roll_out_free(truth, seconds))
    if solver == "fine":
        path, speed, law = fine.solve(truth.motion_effects, scene, truth.theta, seconds)
        slopes = law.ramp_rad[None], law.table_rad[None]
        moved = to_plane(path, speed, *slopes, scene)
        position, velocity = (np.moveaxis(values, 0, -1) for values in moved)
    else:
        position, velocity = _roll_out_rigid(truth, scene, seconds)
    times = RECORD_S * np.arange(position.shape[-1])
    turned = pitch(np.moveaxis(position, -1, 0), scene).T
    return _checked(truth, Motion(times, position, velocity, turned))


def _checked(truth: Truth, motion: Motion) -> Motion:
    if not np.isfinite(motion.position_m).all():
        raise InputError(
            f"the simulation fails at masses {truth.mass_kg}, k {truth.friction}, "
            f"{dict(truth.effect_values)}"
        )
    return motion


def _roll_out_free(truth: Truth, seconds: float) -> Motion:
    from galileo_jax.rollout.engine_c_free import EngineCFree

    scene = Scene(truth.surroundings, truth.objects, RECORD_S / SUBSTEPS)
    model = Model(scene, seconds, truth.motion_effects, nuisances=(), motion="free")
    with jax.enable_x64(True):
        poses = EngineCFree(model).poses(np.array([[truth.theta[name] for name in model.names]]))
    place, speed, turned = (values[0] for values in poses)
    w, x, y, z = np.moveaxis(turned, 1, 0)
    tipped = np.arcsin(np.clip(2 * (x * z - w * y), -1.0, 1.0))
    planar = pitch(np.moveaxis(place[:, :2], -1, 0), scene.surroundings).T
    times = RECORD_S * np.arange(place.shape[-1])
    return Motion(times, place[:, :2], speed[:, :2], planar + tipped, place[:, 2], turned)


def _roll_out_rigid(
    truth: Truth, scene: Surroundings, seconds: float
) -> tuple[np.ndarray, np.ndarray]:
    names = tuple(truth.theta)
    num_records = round(seconds / RECORD_S) + 1
    with jax.enable_x64(True):
        rolled = jax.jit(engine_path.roll_out, static_argnums=(0, 1, 2, 3))(
            truth.motion_effects,
            names,
            num_records,
            RECORD_S,
            jnp.array([truth.theta[name] for name in names]),
            scene,
        )
        return np.asarray(rolled[0]), np.asarray(rolled[1])
