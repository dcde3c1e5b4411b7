"""What stands in NAME.truth.json; y along the travel and z up, as in clips made elsewhere."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from galileo_jax.simulation.motion import Motion
from galileo_jax.simulation.plane import PlaneTruth
from galileo_jax.simulation.settings import Settings
from galileo_jax.simulation.truth import Declared, Truth


def truth_record(
    truth: Truth, declared: Declared, motion: Motion, frames: Motion
) -> dict[str, Any]:
    """The experiment, what was hidden in it, said of it, and what became of it.

    `motion`: from the release on. `frames`: at the times of the clip's frames.
    """
    parameters = {
        effect.name: [p for p in effect.parameters(truth.surroundings) if p.role == "effect"]
        for effect in truth.effects
    }
    hidden = {name: found for name, found in parameters.items() if found}
    names = [parameter.name for found in hidden.values() for parameter in found]
    values = truth.effect_values
    events = motion.events_s(truth)
    return {
        "engine": "galileo_jax",
        "effect": "+".join(hidden) or "none",
        "effect_parameters": {name: values[name] for name in names},
        "nuisances": {name: value for name, value in values.items() if name not in names},
        "scenario": truth.scenario,
        "objects": len(truth.objects),
        **truth.known,
        "gravity": truth.gravity,
        "ramp_angle_deg_true": truth.ramp_angle_deg,
        "ramp_angle_deg_declared": declared.ramp_angle_deg,
        "release_m": truth.release_m,
        **{f"object{i}_y_m": place for i, place in enumerate(truth.stand_x_m, 2)},
        **{f"size{i}_m": each.size_m for i, each in enumerate(truth.objects, 1)},
        "shapes": [each.shape for each in truth.objects],
        "rolls": [each.rolls for each in truth.objects],
        "events_s": {
            name: None if time is None else round(time + declared.release_s, 4)
            for name, time in events.items()
        },
        **_off_the_plane(truth, motion),
        "trajectory": {"t": _rounded(frames.times_s + declared.release_s)}
        | {each.name: _trajectory(frames, i) for i, each in enumerate(truth.objects)},
        "frames": len(frames.times_s),
        "fps_true": declared.true_fps,
        "fps_declared": declared.fps,
    }


def plane_record(
    name: str, settings: Settings, truth: PlaneTruth, frames: Motion
) -> dict[str, Any]:
    """As `truth_record`, of what is on no ramp, without its events."""
    scene = truth.surroundings
    names = [parameter.name for e in truth.effects for parameter in e.parameters(scene)]
    return {
        "name": name,
        "engine": "galileo_jax",
        "scenario": truth.scenario,
        "effect": "+".join(effect.name for effect in truth.effects) or "none",
        "effect_parameters": {name: truth.values[name] for name in names},
        "parameters": dict(truth.values),
        "gravity": truth.gravity,
        "frames": len(frames.times_s),
        "fps_declared": settings.fps,
        "seed": settings.seed,
    }


def _trajectory(frames: Motion, index: int) -> Mapping[str, list[Any]]:
    found = {
        "y": frames.position_m[index, 0],
        "z": frames.position_m[index, 1],
        "pitch": frames.pitch_rad[index],
        "vy": frames.velocity_m_s[index, 0],
        "vz": frames.velocity_m_s[index, 1],
    }
    if frames.z_m is not None and frames.quaternion is not None:
        found |= {"across": frames.z_m[index], "quaternion": frames.quaternion[index].T}
    return {name: _rounded(values) for name, values in found.items()}


def _off_the_plane(truth: Truth, motion: Motion) -> Mapping[str, Any]:
    """Of free motion: that it is, and where the objects stand across the travel."""
    if motion.z_m is None:
        return {}
    return {"motion": "free", "z_m": {each.name: each.z_m for each in truth.objects}}


def _rounded(values: np.ndarray) -> list[Any]:
    return np.round(values, 6).tolist()
