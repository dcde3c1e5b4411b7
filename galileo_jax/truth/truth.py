"""What a synthetic clip is made with: drawn at random where it is not given."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from galileo_jax.clip.schema import ClipObject
from galileo_jax.effects.effect import Effect, Surroundings
from galileo_jax.scene.scene import extents, start_paths

# What the clip's yaml says wrongly: the motion itself knows nothing of it.
DECLARED_WRONGLY = ("frame_rate", "ramp_angle", "scale_error")
GRAVITY_M_S2 = 9.81
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
      effects: what is hidden in the clip, in the motion or in what is declared of it.
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
    def motion_effects(self) -> tuple[Effect, ...]:
        """Those that change the motion. The others only change what is said of it."""
        return tuple(effect for effect in self.effects if effect.name not in DECLARED_WRONGLY)

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
