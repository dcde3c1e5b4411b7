"""Trials of the same objects, with the same effects hidden in all of them."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from galileo_jax.clip.fields import Shape
from galileo_jax.model.effects.nuisances.foot_transition import FootTransition
from galileo_jax.model.effects.nuisances.impact_restitution import ImpactRestitution
from galileo_jax.model.effects.nuisances.release_instant import ReleaseInstant
from galileo_jax.runtime import progress
from galileo_jax.simulation.hidden import Hidden, hide
from galileo_jax.simulation.motion import Motion, Solver, roll_out
from galileo_jax.simulation.truth import Truth, draw_truth

NUM_TRIES = 12
FARTHEST_M = 2.0  # an object beyond it left the table

# Range of the nuisance parameters in real clips: no verdict may result from them.
KEPT_AT_FOOT, REBOUND, RELEASE_FRAMES = (0.96, 1.0), (0.0, 0.04), (-0.3, 0.3)


def draw_series(
    ramp_angle_deg: float,
    given: Mapping[str, float],
    hidden: Sequence[Hidden],
    count: int,
    *,
    solver: Solver,
    things: np.random.Generator,
    secrets: np.random.Generator,
    frame_s: float | None = None,
    scenario: str = "ramp",
    shapes: Sequence[Shape] = ("box", "box"),
) -> list[tuple[Truth, Motion]]:
    """Draws `count` trials of the same objects from other heights and distances.

    Where the given values allow it, object 1 hits object 2 in each and nothing leaves the
    table.

    Args:
      ramp_angle_deg: as declared.
      given: masses and frictions (m1, k1, ...) that are not to be drawn; z2, see `draw_truth`.
      hidden: what is hidden; of the parameters drawn, those of a trial differ between clips.
      count: how many clips.
      solver: see `roll_out`.
      things: for the experiment.
      secrets: for what is hidden.
      frame_s: time between frames; given, clips have the small faults of real ones (release
        between frames, a foot and an impact that are not ideal).
      scenario: see `draw_truth`.
      shapes: see `draw_truth`.
    """
    first, motion = _try(
        lambda: _with_hidden(
            draw_truth(things, ramp_angle_deg, given, scenario, shapes), hidden, secrets, frame_s
        ),
        solver,
    )
    trials = [(first, motion)]
    known = [_shared(each, first) for each in hidden]
    while len(trials) < count:
        progress.report("simulating", len(trials) / count)
        trials.append(
            _try(
                lambda: _with_hidden(
                    _moved(first, ramp_angle_deg, given, things), known, secrets, frame_s
                ),
                solver,
            )
        )
    return trials


def _try(draw, solver: Solver) -> tuple[Truth, Motion]:
    """The first of some draws in which the objects on the table are hit; else the last."""
    for _ in range(NUM_TRIES):
        truth = draw()
        motion = roll_out(truth, solver)
        events = motion.events_s(truth)
        is_hit = all(events[name] is not None for name in events if name.startswith("hit"))
        if len(truth.objects) < 2 or (len(truth.objects) == 2 and not truth.effects):
            break
        if is_hit and motion.position_m[:, 0].max() < FARTHEST_M:
            break
    return truth, motion


def _with_hidden(
    truth: Truth, hidden: Sequence[Hidden], rng: np.random.Generator, frame_s: float | None
) -> Truth:
    for each in hidden:
        truth = hide(truth, each, rng)
    return with_faults(truth, rng, frame_s)


def with_faults(truth: Truth, rng: np.random.Generator, frame_s: float | None) -> Truth:
    """The truth with the small faults of real clips, drawn anew; without where `frame_s` is None.

    Args:
      truth: what is hidden in it stays.
      rng: of the faults.
      frame_s: time between frames.
    """
    if frame_s is None:
        return truth
    faults = {
        "foot_transition": rng.uniform(*KEPT_AT_FOOT),
        "impact_restitution": rng.uniform(*REBOUND),
        "release_instant": frame_s * rng.uniform(*RELEASE_FRAMES),
    }
    return replace(
        truth,
        effects=(*truth.effects, FootTransition(), ImpactRestitution(), ReleaseInstant()),
        effect_values={**truth.effect_values, **faults},
    )


def _shared(hidden: Hidden, first: Truth) -> Hidden:
    """The same effect, with the first clip's values where they are the objects'.

    Those of a trial are drawn anew, of any strength.
    """
    parameters = hidden.effect.parameters(first.surroundings)
    same = {p.name: first.effect_values[p.name] for p in parameters if not p.per_clip}
    return hidden._replace(given={**hidden.given, **same}, strength=None)


def _moved(
    first: Truth, ramp_angle_deg: float, given: Mapping[str, float], rng: np.random.Generator
) -> Truth:
    """The objects of the first clip without effects, from another height to another place."""
    shapes: list[Shape] = [each.shape for each in first.objects]
    other = draw_truth(rng, ramp_angle_deg, {**given, **first.known}, first.scenario, shapes)
    return replace(other, objects=first.objects)
