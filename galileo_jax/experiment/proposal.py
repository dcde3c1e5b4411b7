"""An experiment that has not been made: the scene at other settings, and the noise it would have.

Everything that is not set stays as it was in the first clip: shapes, sizes, where object 2 stands,
how far up the ramp object 1 is released, the errors of a frame.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from galileo_jax.assembly.build_problem import make_problem
from galileo_jax.clip.fields import MIN_RAMP_ANGLE_DEG
from galileo_jax.clip.scenarios import SCENARIOS
from galileo_jax.clip.schema import Clip
from galileo_jax.clip.sizes import extents
from galileo_jax.experiment.settings import Setting, known_as
from galileo_jax.inference.joint_problem import NOISE_SCALE_RANGE, JointProblem
from galileo_jax.inference.problem import Problem
from galileo_jax.model.scene.scene import on_ramp
from galileo_jax.observation.observation import Observation
from galileo_jax.runtime.errors import InputError

LONGEST_S = 3.0  # of a clip that nobody has filmed yet, unless those that were are longer
MOST_FRAMES = 128  # of a fast camera's frames the mean of several is taken, with its smaller error


@dataclass(frozen=True)
class Proposal:
    """An experiment that could be made."""

    problem: Problem  # its scene and model; the observation has times and errors, and stands still
    # Name in this problem to name in the trials, of what has changed its place.
    renamed: Mapping[str, str]
    fixed: Mapping[str, float]  # name to value, of what the setting says


def propose(
    clip: Clip,
    trials: JointProblem,
    noise_scale: float,
    setting: Setting,
    seconds: float | None = None,
) -> Proposal:
    """The experiment with a setting.

    `noise_scale` is that fitted of the first clip; `seconds` None: long enough for most.

    Raises:
      InputError: a setting has no place in the scene.
    """
    given = {known_as(name): value for name, value in setting.items()}
    _check(clip, given)
    first = trials.problems[0]
    is_swapped = bool(given.get("swap", False))
    angle_deg = float(given.get("angle", clip.ramp_angle_deg or 90.0))
    fps = float(given.get("fps", clip.fps))
    start = _start(clip, first, given, angle_deg)
    objects = clip.objects[::-1] if is_swapped else clip.objects
    update = {"fps": fps, "objects": objects}
    if SCENARIOS[clip.scenario].is_sloped:
        update["ramp_angle_deg"] = angle_deg
    clip = clip.model_copy(update=update)
    seconds = seconds or max(LONGEST_S, float(first.observation.times_s[-1]))
    observation = _observation(first.observation, start, seconds, fps, noise_scale, is_swapped)
    problem = make_problem(
        clip, observation, first.engine.name, first.model.effects, first.noise, first.model.motion
    )
    pairs = [(f"{kind}{i}", f"{kind}{3 - i}") for kind in "mk" for i in (1, 2)]
    fixed = {f"m{i}": float(given[f"mass{i}"]) for i in (1, 2) if f"mass{i}" in given}
    renamed = dict(pairs) if is_swapped else {}
    # mass1 is that of object 1 wherever it stands.
    return Proposal(problem, renamed, {renamed.get(n, n): v for n, v in fixed.items()})


def release_m(clip: Clip, problem: Problem) -> float:
    """How far up the ramp object 1 is released: from the foot to the point under its centre."""
    x, y = problem.model.scene.surroundings.start_m[0]
    angle = math.radians(clip.ramp_angle_deg or 90.0)
    return y * math.sin(angle) - x * math.cos(angle)


def height_m(clip: Clip, problem: Problem) -> float:
    """How high the point under object 1's centre is above the foot when it is released."""
    if not SCENARIOS[clip.scenario].is_sloped:
        return problem.model.scene.surroundings.start_m[0][1]
    return release_m(clip, problem) * math.sin(math.radians(clip.ramp_angle_deg or 90.0))


def _check(clip: Clip, given: Setting) -> None:
    scenario = SCENARIOS[clip.scenario]
    if not scenario.is_sloped:
        without = {"height", "fps"} if clip.scenario == "fall" else {"fps"}
        if beyond := sorted(set(given) - without):
            raise InputError(f"--can: {beyond[0]} has no place in scenario {clip.scenario}")
        return
    if "height" in given and "release" in given:
        raise InputError("--can: height and release say the same; give one of them")
    if len(clip.objects) < 2 and (two := sorted({"swap", "mass2", "place2"} & set(given))):
        raise InputError(f"--can: {two[0]}: there is one object in the clip")
    if len(clip.objects) > 2 and "swap" in given:
        raise InputError("--can: swap: of two objects only")
    if "angle" in given and not MIN_RAMP_ANGLE_DEG <= float(given["angle"]) < 90.0:
        raise InputError(
            f"--can: angle: {given['angle']:g} is not a slope; 1 to 89 degrees expected"
        )


def _start(clip: Clip, first: Problem, given: Setting, angle_deg: float) -> np.ndarray:
    """Where the objects' centres stand, `[object, 2]`, in the order of the travel."""
    scene = first.model.scene.surroundings
    start = np.array(scene.start_m, float)
    if not SCENARIOS[clip.scenario].is_sloped:
        if "height" in given:
            start[0, 1] = float(given["height"])
        return start
    angle = math.radians(angle_deg)
    up = release_m(clip, first)
    if "release" in given:
        up = float(given["release"])
    elif "height" in given:
        up = float(given["height"]) / math.sin(angle)
    objects = clip.objects[::-1] if given.get("swap") else clip.objects
    half = [extents(one)[1] for one in objects]
    start[0] = on_ramp(-up, half[0], angle)
    if len(start) > 1:
        start[1, 0] = float(given.get("place2", start[1, 0]))
        start[1:, 1] = half[1:]
    return start


def _observation(
    seen: Observation,
    start: np.ndarray,
    seconds: float,
    fps: float,
    noise_scale: float,
    is_swapped: bool,
) -> Observation:
    """Times and errors of a clip, its objects at their start."""
    every = math.ceil(seconds * fps / MOST_FRAMES)
    times = np.arange(math.floor(seconds * fps / every + 1e-6) + 1) * every / fps
    scale = float(np.clip(noise_scale, *NOISE_SCALE_RANGE))
    covariance = np.nanmedian(seen.covariance_m2, axis=-1) * scale**2 / every
    order = slice(None, None, -1) if is_swapped else slice(None)
    count = len(seen.names)
    return Observation(
        names=seen.names[order],
        times_s=times,
        position_m=np.repeat(start[:, :, None], len(times), axis=2),
        covariance_m2=np.repeat(covariance[order][..., None], len(times), axis=3),
        mask=np.ones((count, len(times)), bool),
    )
