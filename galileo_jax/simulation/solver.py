"""A second integrator for truths, which shares no event logic with the rigid engine.

Moreau's time stepping: small steps of fixed length in which friction and contacts are
impulses, found together. With h = 1/9600 s, M the inertias and d, b the drive and the brake
of `rollout/motion.py` (the effects act there and nowhere else),

    M (v+ - v) = h d + p + l,    |p| <= h b, p opposes v+ or stops it,    l >= 0 pushes apart,
    q+ = q + h (v + v+) / 2.

Where a body rolls, p opposes or stops its slip v+ - u+, and turns its rim: u+ - u = -p / (beta m).

Forces are evaluated at the middle of the step, predicted with the acceleration of the previous
step. A hit within a step is placed at its time from the speeds before and after; at the foot the
step is divided. A clip simulated by the same engine that fits it would be no independent test.

Source: J. J. Moreau, Unilateral contact and dry friction in finite freedom dynamics (1988),
doi:10.1007/978-3-7091-2624-0_1.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from galileo_jax.model.effects.effect import Effect, Surroundings
from galileo_jax.rollout.motion import Dynamics, dynamics, state_at

STEP_S = 1 / 9600
STEPS_PER_RECORD = 2
STILL_S = 0.5  # at rest for so long: the rest of the motion is rest
PLASTIC_M_S = 0.02  # slower impacts do not rebound, which is part of what restitution means here
TOUCH_M = 1e-12
MAX_SWEEPS, TOLERANCE_M_S = 200, 1e-13


def solve(
    effects: Sequence[Effect],
    scene: Surroundings,
    theta: Mapping[str, float],
    seconds: float,
) -> tuple[np.ndarray, np.ndarray, Dynamics]:
    """Integrates a truth.

    Returns:
      path (m) and speed (m/s), each `[record, object]`, every `STEPS_PER_RECORD` steps from
      the release on, at rest where the integration stopped early; and the equations of motion.
    """
    law = dynamics(effects, scene, {name: np.asarray(value) for name, value in theta.items()}, np)
    bodies = _Bodies(law, scene)
    num_records = round(seconds / STEP_S / STEPS_PER_RECORD) + 1
    path = np.empty((num_records, len(scene.names)))
    speed = np.zeros_like(path)
    still = 0
    for record in range(num_records):
        path[record], speed[record] = bodies.path, bodies.speed
        still = still + 1 if not any(bodies.speed) else 0
        if still * STEPS_PER_RECORD * STEP_S > STILL_S:
            path[record:] = bodies.path
            break
        for step in range(STEPS_PER_RECORD):
            bodies.step((record * STEPS_PER_RECORD + step) * STEP_S)
    return path, speed, law


class _Bodies:
    """The bodies' state, in plain floats: NumPy is slow on two numbers."""

    def __init__(self, law: Dynamics, scene: Surroundings):
        self.law, self.scene = law, scene
        self.path: list[float] = law.start_m.tolist()
        self.speed: list[float] = law.start_speed_m_s.tolist()
        self.inertia: list[float] = law.inertia.tolist()
        self.rim: list[float] = law.rim.tolist()
        self.rim_speed = [v if w else 0.0 for v, w in zip(self.speed, self.rim, strict=True)]
        pairs = zip(self.inertia, self.rim, strict=True)
        self.resists = [m / (1 + m * w) for m, w in pairs]  # impulse over change of slip
        self.acceleration = [0.0] * len(self.path)
        x = np.add(scene.half_length_m, scene.corner_m)
        y = np.subtract(scene.half_length_m, scene.corner_m)
        self.between = (x[:-1] + y[1:]).tolist()  # path lengths apart when faces meet

    def step(self, time_s: float, h: float = STEP_S) -> None:
        """Moves on by `h`; a step in which a body passes the foot is split there."""
        path, speed, rim_speed = self._moved(time_s, h)
        if self.scene.has_table:
            for i, (before, after) in enumerate(zip(self.path, path, strict=True)):
                if (before < 0) == (after < 0) or before == after:
                    continue
                part = h * before / (before - after)
                self.path, self.speed, self.rim_speed = self._moved(time_s, part)
                self.path[i] = 0.0 if before < 0 else -TOUCH_M
                self._turn_at_foot(i, time_s)
                return self.step(time_s + part, h - part)
        self.path, self.speed, self.rim_speed = path, speed, rim_speed

    def _moved(self, time_s: float, h: float) -> tuple[list[float], list[float], list[float]]:
        """Paths and speeds, of centres and rims, after `h`."""
        ahead = zip(self.path, self.speed, self.acceleration, strict=True)
        middle = [(q + 0.5 * h * v, v + 0.5 * h * a) for q, v, a in ahead]
        halfway, speeds = np.transpose(middle)
        state = state_at(halfway, speeds, time_s + 0.5 * h, self.scene)
        slipping = state._replace(speed_m_s=speeds - self.rim_speed)
        drive, brake = self.law.drive(state).tolist(), self.law.brake(slipping).tolist()
        pulls = zip(self.speed, drive, self.inertia, strict=True)
        free = [v + h * d / m for v, d, m in pulls]
        after, rims, hit_s = self._impulses(free, [h * b for b in brake], h)
        path = list(self.path)
        for i, (v, w, hit) in enumerate(zip(self.speed, after, hit_s, strict=True)):
            self.acceleration[i] = 0.0 if hit is not None or h == 0 else (w - v) / h
            early = 0.5 * h if hit is None else hit
            path[i] += early * v + (h - early) * w
        return path, after, rims

    def _impulses(
        self, free: list[float], limits: list[float], h: float
    ) -> tuple[list[float], list[float], list[float | None]]:
        """Speeds of centres and rims after friction and contacts, and when each body was hit.

        Gauss-Seidel sweeps over one-body friction and two-body contacts.
        """
        v, u, m = list(free), list(self.rim_speed), self.inertia
        rub, push = [0.0] * len(v), [0.0] * (len(v) - 1)
        hit_s: list[float | None] = [None] * len(v)
        rebound = [0.0] * len(push)
        for sweep in range(MAX_SWEEPS):
            change = 0.0
            for i, limit in enumerate(limits):
                wanted = min(limit, max(-limit, rub[i] - self.resists[i] * (v[i] - u[i])))
                change = max(change, abs(wanted - rub[i]) / m[i])
                v[i] += (wanted - rub[i]) / m[i]
                u[i] -= (wanted - rub[i]) * self.rim[i]
                rub[i] = wanted
            for j, already in enumerate(push):
                gap = self.path[j + 1] - self.path[j] - self.between[j]
                if sweep == 0 and gap - h * (v[j] - v[j + 1]) <= TOUCH_M:
                    approach = self.speed[j] - self.speed[j + 1]
                    if approach > PLASTIC_M_S:
                        rebound[j] = float(self.law.restitution) * approach
                        hit_s[j] = hit_s[j + 1] = min(h, gap / approach)
                elif already == 0.0 and gap - h * (v[j] - v[j + 1]) > TOUCH_M:
                    continue
                together = 1 / (1 / m[j] + 1 / m[j + 1])
                wanted = max(0.0, already + together * (v[j] - v[j + 1] + rebound[j]))
                change = max(change, abs(wanted - already) / together)
                v[j] -= (wanted - already) / m[j]
                v[j + 1] += (wanted - already) / m[j + 1]
                push[j] = wanted
            if change < TOLERANCE_M_S or not any(push):
                break
        return [0.0 if abs(w) < TOLERANCE_M_S else w for w in v], u, hit_s

    def _turn_at_foot(self, i: int, time_s: float) -> None:
        """The impulse where the path bends, and its friction: all, or what ends slip."""
        law, at_foot = self.law, np.zeros(len(self.path))
        slips = np.subtract(self.speed, self.rim_speed)
        cos, sin = (float(part) for part in law.turn)
        most = law.coefficient(state_at(at_foot, slips, time_s, self.scene))[i]
        most *= abs(self.speed[i] * sin)
        slip = self.speed[i] * cos - self.rim_speed[i]
        ending = slip * self.resists[i] / self.inertia[i]
        rubbed = float(np.clip(ending, -most, most))
        self.speed[i] = float(law.foot) * (self.speed[i] * cos - rubbed)
        turned = self.rim_speed[i] + rubbed * self.inertia[i] * self.rim[i]
        self.rim_speed[i] = float(law.foot) * turned
