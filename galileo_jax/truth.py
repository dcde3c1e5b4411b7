"""What a synthetic clip is made with: drawn at random where it is not given."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from galileo_jax import truth_solver
from galileo_jax.clip.schema import ClipObject
from galileo_jax.effects.effect import Effect, Surroundings
from galileo_jax.errors import InputError
from galileo_jax.rollout.motion import pitch, to_plane
from galileo_jax.scene.scene import extents, start_paths

Solver = Literal["rigid", "fine"]
SOLVERS: tuple[Solver, ...] = ("rigid", "fine")
GRAVITY_M_S2 = 9.81
LONGEST_S = 5.0
# Between two records the motion is drawn straight: 0.05 mm off at most, in a hard impact.
RECORD_S = truth_solver.STEP_S * truth_solver.STEPS_PER_RECORD
NUM_TRIES = 300
SLOWEST_HIT_M_S = 0.5  # a weaker hit says little about object 2


@dataclass(frozen=True)
class Truth:
    """One ramp experiment.

    Attributes:
      mass_kg, friction: of object 1 and object 2.
      ramp_angle_deg: of the ramp.
      objects: names, shapes and sizes.
      release_m: distance up the ramp from the foot to the point under object 1's centre.
      object2_x_m: where object 2's centre stands.
      gravity: m/s^2.
      effects: what acts besides gravity, friction and impact.
      effect_values: their parameters by name, all of them.
    """

    mass_kg: tuple[float, float]
    friction: tuple[float, float]
    ramp_angle_deg: float
    objects: tuple[ClipObject, ClipObject]
    release_m: float
    object2_x_m: float
    gravity: float = GRAVITY_M_S2
    effects: tuple[Effect, ...] = ()
    effect_values: Mapping[str, float] = field(default_factory=dict)

    @property
    def theta(self) -> dict[str, float]:
        """All parameters by name."""
        (m1, m2), (k1, k2) = self.mass_kg, self.friction
        return {"m1": m1, "k1": k1, "m2": m2, "k2": k2, **self.effect_values}

    @property
    def angle_rad(self) -> float:
        """The ramp's angle in radians."""
        return math.radians(self.ramp_angle_deg)

    @property
    def surroundings(self) -> Surroundings:
        """The geometry as the scene and the effects see it."""
        half = [extents(declared) for declared in self.objects]
        up, height = self.release_m, half[0][1]
        cos, sin = math.cos(self.angle_rad), math.sin(self.angle_rad)
        corner = tuple(height * math.tan(self.angle_rad / 2) for _, height in half)
        start = (
            (-up * cos + height * sin, up * sin + height * cos),
            (self.object2_x_m, half[1][1]),
        )
        return Surroundings(
            names=tuple(declared.name for declared in self.objects),
            angle_rad=self.angle_rad,
            gravity=self.gravity,
            half_length_m=tuple(length for length, _ in half),
            half_height_m=tuple(height for _, height in half),
            corner_m=corner,
            start_m=start,
            start_path_m=start_paths(start, corner, self.angle_rad),
            has_table=True,
            comes_down=(True, False),
        )

    @property
    def hit_speed_m_s(self) -> float:
        """Object 1's speed when it meets object 2, of a point with friction; 0 = never."""
        where = self.surroundings
        cos, sin = math.cos(self.angle_rad), math.sin(self.angle_rad)
        k1, twice_g = self.friction[0], 2 * self.gravity
        at_foot = twice_g * (sin - k1 * cos) * (self.release_m - where.corner_m[0])
        beyond = max(0.0, at_foot) * max(0.0, cos - k1 * sin) ** 2
        run = self.object2_x_m - sum(where.half_length_m) - where.corner_m[0]
        return math.sqrt(max(0.0, beyond - twice_g * k1 * run))


@dataclass(frozen=True)
class Motion:
    """The motion of a truth, in the engine's time steps from the release on.

    Attributes:
      times_s: `[time]`.
      position_m, velocity_m_s: `[object, 2, time]`.
      pitch_rad: `[object, time]`, counter-clockwise positive.
    """

    times_s: np.ndarray
    position_m: np.ndarray
    velocity_m_s: np.ndarray
    pitch_rad: np.ndarray

    @property
    def rest_s(self) -> float:
        """When the last object comes to rest; the end if none does."""
        moving = np.abs(self.velocity_m_s).max(axis=(0, 1)) > 1e-3
        last = np.flatnonzero(moving)
        return float(self.times_s[min(last[-1] + 1, len(moving) - 1)]) if last.size else 0.0

    def at(self, times_s: np.ndarray) -> "Motion":
        """The motion at other times, linear in between; at rest after the end."""

        def between(values: np.ndarray) -> np.ndarray:
            rows = values.reshape(-1, values.shape[-1])
            found = [np.interp(times_s, self.times_s, row) for row in rows]
            return np.reshape(found, (*values.shape[:-1], len(times_s)))

        return Motion(
            times_s,
            between(self.position_m),
            between(self.velocity_m_s),
            between(self.pitch_rad),
        )

    def events_s(self, truth: Truth) -> dict[str, float | None]:
        """When object 1's centre turns at the foot and when it meets object 2; None = never."""
        x = self.position_m[:, 0]
        # The bumpers give way by a fraction of a millimetre: moved says hit more surely.
        return {
            "foot": self._first_s(x[0] - truth.surroundings.corner_m[0]),
            "hit": self._first_s(x[1] - x[1, 0] - 1e-5),
        }

    def _first_s(self, value: np.ndarray) -> float | None:
        """When `value` `[time]`, negative at first, reaches zero."""
        reached = np.flatnonzero(value >= 0)
        if not reached.size:
            return None
        pair = slice(reached[0] - 1, reached[0] + 1)
        return round(float(np.interp(0.0, value[pair], self.times_s[pair])), 4)


def draw_truth(
    rng: np.random.Generator, ramp_angle_deg: float, given: Mapping[str, float]
) -> Truth:
    """Draws what `given` (m1, k1, m2, k2) leaves open.

    Where the given values allow it, object 1 hits object 2 at more than 0.5 m/s.
    """
    truth = _draw(rng, ramp_angle_deg, given)
    for _ in range(NUM_TRIES):
        if truth.hit_speed_m_s > SLOWEST_HIT_M_S:
            break
        truth = _draw(rng, ramp_angle_deg, given)
    return truth


def roll_out(truth: Truth, solver: Solver = "rigid", seconds: float = LONGEST_S) -> Motion:
    """Simulates a truth for `seconds`.

    Args:
      truth: effects of the motion act; those of the clock and the camera are the caller's.
      solver: "rigid": the engine that also fits; "fine": small steps that share no event
        logic with it (`truth_solver`), for data that are to examine the fit.
      seconds: s.

    Raises:
      InputError: the simulation failed at these values.
    """
    scene = truth.surroundings
    if solver == "fine":
        path, speed, law = truth_solver.solve(truth.effects, scene, truth.theta, seconds)
        slopes = law.ramp_rad[None], law.table_rad[None]
        moved = to_plane(path, speed, *slopes, scene)
        position, velocity = (np.moveaxis(values, 0, -1) for values in moved)
    else:
        position, velocity = _roll_out_rigid(truth, scene, seconds)
    if not np.isfinite(position).all():
        raise InputError(
            f"the simulation fails at masses {truth.mass_kg}, k {truth.friction}, "
            f"{dict(truth.effect_values)}"
        )
    times = RECORD_S * np.arange(position.shape[-1])
    turned = pitch(np.moveaxis(position, -1, 0), scene).T
    return Motion(times, position, velocity, turned)


def _roll_out_rigid(
    truth: Truth, scene: Surroundings, seconds: float
) -> tuple[np.ndarray, np.ndarray]:
    import jax
    import jax.numpy as jnp

    from galileo_jax.rollout import engine_rigid

    names = tuple(truth.theta)
    num_records = round(seconds / RECORD_S) + 1
    with jax.enable_x64(True):
        rolled = jax.jit(engine_rigid.roll_out, static_argnums=(0, 1, 2, 3))(
            truth.effects,
            names,
            num_records,
            RECORD_S,
            jnp.array([truth.theta[name] for name in names]),
            scene,
        )
        return np.asarray(rolled[0]), np.asarray(rolled[1])


def _draw(rng: np.random.Generator, ramp_angle_deg: float, given: Mapping[str, float]) -> Truth:
    mass1, mass2 = np.exp(rng.uniform(np.log(0.15), np.log(1.0), 2))
    k1, k2 = rng.uniform((0.03, 0.05), (0.26, 0.32))
    sizes = rng.uniform(0.045, 0.080, (2, 3)).round(3)
    drawn = {"m1": mass1, "k1": k1, "m2": mass2, "k2": k2, **given}
    first, second = (
        ClipObject(name=f"object{i + 1}", shape="box", size_m=tuple(map(float, size)))
        for i, size in enumerate(sizes)
    )
    return Truth(
        mass_kg=(float(drawn["m1"]), float(drawn["m2"])),
        friction=(float(drawn["k1"]), float(drawn["k2"])),
        ramp_angle_deg=ramp_angle_deg,
        objects=(first, second),
        release_m=float(rng.uniform(0.40, 0.65)),
        object2_x_m=float(rng.uniform(0.20, 0.30)),
    )
