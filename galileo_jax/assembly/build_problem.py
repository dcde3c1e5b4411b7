"""Builds the inverse problem of clips and observations: scene, effects, engine, noise model."""

from collections.abc import Sequence

from galileo_jax.assembly.build_scene import build_scene
from galileo_jax.clip.scenarios import SCENARIOS
from galileo_jax.clip.schema import Clip
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.inference.problem import Problem, with_shared_parameters
from galileo_jax.model.effects.effect import Effect, Surroundings
from galileo_jax.model.effects.forms import FORM_NAMES, FORMS
from galileo_jax.model.effects.free_quantities import make_free_quantities
from galileo_jax.model.effects.laws import LAWS
from galileo_jax.model.effects.nuisances import NUISANCES
from galileo_jax.model.effects.nuisances.trial_friction import TrialFriction
from galileo_jax.model.effects.registry import effect_names, make_effects
from galileo_jax.model.model import Model
from galileo_jax.observation.observation import Observation
from galileo_jax.rollout.engines import make_engine
from galileo_jax.runtime.errors import InputError
from galileo_jax.similarity.gaussian_likelihood import NoiseModel

LONGER = 1.15  # an effect may run the clock faster: the frame rate's does
RELEASE_SDS = 6.0  # of the release's prior: no search goes further


def noise_of(clip: Clip, scene: Surroundings) -> NoiseModel:
    """Which imperfections a clip's observation has.

    Positions on a ramp in metres, without any scale in pixels, were measured by no camera that
    anybody knows of. Those of a fall were read off a picture, whoever declared them.
    """
    has_pixels = clip.video is not None or clip.pixels_per_metre is not None
    is_measured = scene.has_surface and scene.is_scale_known and not has_pixels
    return "bodies" if is_measured else "camera"


def make_problem(
    clip: Clip,
    observation: Observation,
    engine: str = "auto",
    effects: tuple[Effect, ...] = (),
    noise: NoiseModel | None = None,
    motion: str = "planar",
    free: Sequence[str] = (),
    trials_differ: bool = False,
) -> Problem:
    """A clip with a model of it: the base model, or one with effects.

    `effects` are besides the scenario's own laws, `noise` is by default `noise_of` the clip,
    `motion` as of `Model`, `free` names declared quantities that are inferred ("gravity"), and
    `trials_differ` says that this is a trial of several, between which friction differs.

    Raises:
      InputError: an effect has no place in the scenario, the engine is not for this model, or
        a name in `free` is unknown.
    """
    for effect in effects:
        if effect.name in SCENARIOS[clip.scenario].without:
            raise InputError(
                f"{clip.path}: effects: {effect.name} has no place in scenario {clip.scenario}, "
                "whose own laws do the same"
            )
    scene = build_scene(clip, observation)
    model = Model(
        scene,
        _duration_s(scene.surroundings, observation, LONGER if effects else 1.0),
        effects,
        LAWS
        + make_free_quantities(free)
        + NUISANCES
        + ((TrialFriction(),) if trials_differ else ()),
        motion=motion,
    )
    noise = noise or noise_of(clip, scene.surroundings)
    return Problem(observation, model, make_engine(engine, model), clip.path.stem, noise)


def _duration_s(scene: Surroundings, observation: Observation, margin: float) -> float:
    """From the earliest release that may be to the last frame: no data lie behind a rollout."""
    release_s, sd_s = scene.release_s
    earliest_s = 0.0 if scene.starts_moving else min(0.0, release_s - RELEASE_SDS * sd_s)
    return margin * (float(observation.times_s[-1]) - earliest_s)


def make_joint_problem(
    clips: Sequence[Clip],
    observations: Sequence[Observation],
    engine: str = "auto",
    effects: tuple[Effect, ...] = (),
    noise: NoiseModel | None = None,
    motion: str = "planar",
    free: Sequence[str] = (),
    trials_differ: bool = False,
) -> JointProblem:
    """Clips of the same objects with the same model; arguments and errors as `make_problem`.

    With `trials_differ` friction differs between them, where there are several.

    Raises:
      InputError: besides, clips that declare different gravities and are to tell one.
    """
    if "gravity" in free:
        first = clips[0]
        for clip in clips[1:]:
            if clip.gravity != first.gravity:
                raise InputError(
                    f"{clip.path}: gravity: {clip.gravity:g}, but {first.path}: "
                    f"{first.gravity:g}; one gravity is inferred for all clips"
                )
    differ = trials_differ and len(clips) > 1
    problems = [
        make_problem(clip, observation, engine, effects, noise, motion, free, differ)
        for clip, observation in zip(clips, observations, strict=True)
    ]
    return JointProblem(with_shared_parameters(problems))


def with_library(
    clips: Sequence[Clip],
    observations: Sequence[Observation],
    engine: str,
    library: Sequence[str] | None = None,
) -> JointProblem:
    """The joint problem with all effects and nameless forms that have a place in the scene.

    `library`: names of the effects; None: all that are registered.
    """

    def problem_with(names: Sequence[str]) -> JointProblem:
        forms = tuple(form for form in FORMS if form.name in names)
        effects = make_effects([name for name in names if name not in FORM_NAMES])
        return make_joint_problem(clips, observations, engine, (*effects, *forms))

    without = SCENARIOS[clips[0].scenario].without
    effects = effect_names() if library is None else library
    names = [name for name in (*effects, *FORM_NAMES) if name not in without]
    problem = problem_with(names)
    absent = problem.without_place()
    return problem_with([name for name in names if name not in absent]) if absent else problem
