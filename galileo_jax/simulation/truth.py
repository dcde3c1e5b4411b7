"""What a synthetic clip is made with: drawn at random where it is not given."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from galileo_jax.clip.fields import Shape
from galileo_jax.clip.scenarios import SCENARIOS
from galileo_jax.clip.schema import ClipObject
from galileo_jax.model.effects.effect import Effect, Surroundings
from galileo_jax.model.scene.scene import extents, rolling, start_paths

# What the clip's yaml says wrongly: the motion itself knows nothing of it.
DECLARED_WRONGLY = ("frame_rate", "ramp_angle", "scale_error")
GRAVITY_M_S2 = 9.81
NUM_TRIES = 300
SLOWEST_HIT_M_S = 0.5  # a weaker hit says little about object 2


@dataclass(frozen=True)
class Truth:
    """One experiment on a ramp.

    Attributes:
      mass_kg, friction: of the objects.
      ramp_angle_deg: of the ramp.
      objects: names, shapes and sizes.
      release_m: distance up the ramp from the foot to the point under object 1's centre.
      object2_x_m: where object 2's centre stands.
      scenario: ramp, multi or incline.
      beyond_x_m: where the centres of the objects beyond object 2 stand.
      gravity: m/s^2.
      effects: what is hidden in the clip, in the motion or in what is declared of it.
      effect_values: their parameters by name, all of them.
    """

    mass_kg: tuple[float, ...]
    friction: tuple[float, ...]
    ramp_angle_deg: float
    objects: tuple[ClipObject, ...]
    release_m: float
    object2_x_m: float
    gravity: float = GRAVITY_M_S2
    scenario: str = "ramp"
    beyond_x_m: tuple[float, ...] = ()
    effects: tuple[Effect, ...] = ()
    effect_values: Mapping[str, float] = field(default_factory=dict)

    @property
    def motion_effects(self) -> tuple[Effect, ...]:
        """Those that change the motion. The others only change what is said of it."""
        return tuple(effect for effect in self.effects if effect.name not in DECLARED_WRONGLY)

    @property
    def theta(self) -> dict[str, float]:
        """All parameters by name."""
        return {**self.known, **self.effect_values}

    @property
    def known(self) -> dict[str, float]:
        """Masses and frictions by name: m1, k1, m2, ..."""
        pairs = enumerate(zip(self.mass_kg, self.friction, strict=True), 1)
        return {name: value for i, (m, k) in pairs for name, value in ((f"m{i}", m), (f"k{i}", k))}

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
        has_table = SCENARIOS[self.scenario].has_table
        bend = math.tan(self.angle_rad / 2) if has_table else math.inf
        corner = tuple(height * bend for _, height in half)
        standing = (self.object2_x_m, *self.beyond_x_m)[: len(half) - 1]
        start = (
            (-up * cos + height * sin, up * sin + height * cos),
            *((x, height) for x, (_, height) in zip(standing, half[1:], strict=True)),
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
            has_table=has_table,
            comes_down=(has_table,) + (False,) * (len(half) - 1),
            **rolling(self.objects),
        )

    @property
    def hit_speed_m_s(self) -> float:
        """Object 1's speed when it meets object 2, of a point; 0 = never."""
        if len(self.objects) < 2:
            return 0.0
        where = self.surroundings
        cos, sin = math.cos(self.angle_rad), math.sin(self.angle_rad)
        k1, twice_g = self.friction[0], 2 * self.gravity
        down = self.release_m - where.corner_m[0]
        if beta := self.objects[0].roll_inertia:
            rubs = min(k1 * cos, sin * beta / (1 + beta))
            return math.sqrt(twice_g * (sin - rubs) * down) * (cos + beta) / (1 + beta)
        at_foot = twice_g * (sin - k1 * cos) * down
        beyond = max(0.0, at_foot) * max(0.0, cos - k1 * sin) ** 2
        run = self.object2_x_m - sum(where.half_length_m[:2]) - where.corner_m[0]
        return math.sqrt(max(0.0, beyond - twice_g * k1 * run))


def draw_truth(
    rng: np.random.Generator,
    ramp_angle_deg: float,
    given: Mapping[str, float],
    scenario: str = "ramp",
    shapes: Sequence[Shape] = ("box", "box"),
) -> Truth:
    """Draws what `given` (m1, k1, m2, ...) leaves open.

    Where the given values allow it, object 1 hits object 2 at more than 0.5 m/s.

    Args:
      rng: of everything drawn.
      ramp_angle_deg: of the ramp.
      given: masses and frictions; places across the travel (z2), which are 0 otherwise.
      scenario: ramp, multi or incline.
      shapes: of the objects, in the order of the travel; what is round rolls.
    """
    truth = _draw(rng, ramp_angle_deg, given, scenario, shapes)
    for _ in range(NUM_TRIES):
        if len(shapes) < 2 or truth.hit_speed_m_s > SLOWEST_HIT_M_S:
            break
        truth = _draw(rng, ramp_angle_deg, given, scenario, shapes)
    return truth


def _draw(
    rng: np.random.Generator,
    ramp_angle_deg: float,
    given: Mapping[str, float],
    scenario: str,
    shapes: Sequence[Shape],
) -> Truth:
    mass1, mass2 = np.exp(rng.uniform(np.log(0.15), np.log(1.0), 2))
    k1, k2 = rng.uniform((0.03, 0.05), (0.26, 0.32))
    sizes = list(rng.uniform(0.045, 0.080, (2, 3)).round(3))
    release, object2_x = float(rng.uniform(0.40, 0.65)), float(rng.uniform(0.20, 0.30))
    mass, friction, beyond = [mass1, mass2], [k1, k2], [object2_x]
    for _ in shapes[2:]:
        mass.append(np.exp(rng.uniform(np.log(0.15), np.log(1.0))))
        friction.append(rng.uniform(0.05, 0.32))
        sizes.append(rng.uniform(0.045, 0.080, 3).round(3))
        beyond.append(beyond[-1] + float(rng.uniform(0.09, 0.13)))
    objects = tuple(
        ClipObject(
            name=f"object{i + 1}",
            shape=shape,
            size_m=_size(shape, sizes[i]),
            rolls=True if shape in ("cylinder", "torus") else None,
            z_m=float(given.get(f"z{i + 1}", 0.0)),
        )
        for i, shape in enumerate(shapes)
    )
    numbers = range(len(shapes))
    return Truth(
        mass_kg=tuple(float(given.get(f"m{i + 1}", mass[i])) for i in numbers),
        friction=tuple(float(given.get(f"k{i + 1}", friction[i])) for i in numbers),
        ramp_angle_deg=ramp_angle_deg,
        objects=objects,
        release_m=release,
        object2_x_m=object2_x,
        scenario=scenario,
        beyond_x_m=tuple(beyond[1:]),
    )


def _size(shape: Shape, sides_m: np.ndarray) -> tuple[float, ...]:
    """An object as long as a box of these sides."""
    length, depth, height = map(float, sides_m)
    radius = round(length / 2, 4)
    return {
        "box": (length, depth, height),
        "sphere": (radius,),
        "cylinder": (radius, depth),
        "torus": (round(0.75 * radius, 4), round(0.25 * radius, 4)),
    }[shape]
