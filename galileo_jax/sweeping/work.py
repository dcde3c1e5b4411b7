"""What workers do: from a clip's files to a measurement, and from measurements to a result."""

import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from galileo_jax import __version__
from galileo_jax.commands.clip_options import load_clips
from galileo_jax.measurement.measure import Measurement, inferred, measure
from galileo_jax.runtime.errors import InputError
from galileo_jax.runtime.jax_setup import set_up
from galileo_jax.sweeping.clip_files import Packed
from galileo_jax.sweeping.settings import Cnn, Diagnose, Mh, Settings, Thesis

if TYPE_CHECKING:
    from galileo_jax.inference.fits.gradient import GradientFit
    from galileo_jax.inference.joint_problem import JointProblem
    from galileo_jax.inference.posterior import Posterior

Found = tuple["Posterior", np.ndarray, dict[str, Any]]  # draws, the best z, notes for result.json


def measure_files(packed: Packed) -> Measurement:
    """Loads and tracks a clip.

    Raises:
      InputError: something is wrong with it.
    """
    with packed.unpacked() as path:
        (clip,) = load_clips([str(path)])
        measured = measure(clip)
    came_from = {"path": packed.path.with_name(clip.path.name)}
    for key in ("video", "track"):
        if (file := getattr(clip, key)) is not None:
            came_from[key] = packed.path.with_name(Path(file).name)
    return replace(measured, clip=measured.clip.model_copy(update=came_from))


def run_cell(settings: Settings, measured: Sequence[Measurement]) -> dict[str, Any]:
    """The result.json of a cell: as `galileo fit` would write it, or a diagnosis.

    Raises:
      InputError: the clips do not go with each other or with the method.
    """
    set_up()
    began = time.perf_counter()
    if isinstance(settings, Diagnose):
        result = _diagnosis(settings, measured)
    else:
        result = _fit(settings, measured)
    result |= inferred(measured)
    return result | {"timings_s": {settings.method: round(time.perf_counter() - began, 3)}}


def _fit(settings: Settings, measured: Sequence[Measurement]) -> dict[str, Any]:
    from galileo_jax.inference.result import make_result
    from galileo_jax.model.effects.registry import make_effects

    effects = make_effects(getattr(settings, "effects", ()))
    trials = _trials(settings, measured, effects)
    notes: dict[str, Any] = {"engine": trials.problems[0].engine.name}
    posterior, z_best, extra = _found(settings, trials)
    return make_result(
        trials,
        posterior,
        z_best,
        clips=[str(one.clip.path) for one in measured],
        method=settings.method,
        seed=settings.seed,
        timings_s={},
        notes=notes | extra,
    )


def _found(settings: Settings, trials: "JointProblem") -> Found:
    """What the settings' method says."""
    if isinstance(settings, Cnn):
        from galileo_jax.neural.estimate import cnn_posterior

        return cnn_posterior(trials, settings.seed)
    if isinstance(settings, Thesis):
        return _by_thesis(settings, trials)
    from galileo_jax.inference.fits.gradient import Code, GradientFitter
    from galileo_jax.inference.laplace import laplace_posterior

    fit = GradientFitter(trials).fit(settings.seed)
    if fit.code is Code.FAILED:
        raise InputError(f"{trials.problems[0].name}: {fit.code}")
    if isinstance(settings, Mh):
        return _by_chains(settings, trials, fit)
    posterior = laplace_posterior(trials, fit, settings.seed)
    return posterior, fit.z, {"status": fit.code.value}


def _by_thesis(settings: Thesis, trials: "JointProblem") -> Found:
    """The thesis's sampler: errors are told at its answer."""
    import jax
    import jax.numpy as jnp

    from galileo_jax.model.parameters import inverse
    from galileo_jax.thesis.estimate import thesis_posterior

    if len(trials.problems) > 1:
        raise InputError("method thesis: one clip expected")
    posterior, best = thesis_posterior(
        trials,
        settings.seed,
        settings.similarity,
        settings.acceptance,
        settings.selection,
        settings.chains,
    )
    theta = trials.theta(np.zeros(len(trials.names)))
    theta = np.array([best.get(name, rest) for name, rest in zip(trials.names, theta, strict=True)])
    z_best = np.asarray(inverse(trials.parameters, jnp.asarray(theta)))
    jax.clear_caches()  # chains compile their own density: kept, it would never be used again
    return posterior, z_best, {"status": posterior.status.value, "best": best}


def _by_chains(settings: Mh, trials: "JointProblem", fit: "GradientFit") -> Found:
    import jax

    from galileo_jax.inference.density import density_of
    from galileo_jax.inference.metropolis import metropolis_posterior
    from galileo_jax.inference.samplers.driver import Settings as Steps
    from galileo_jax.inference.samplers.program import Program

    posterior = metropolis_posterior(
        trials,
        fit,
        settings.seed,
        sampler=settings.sampler,
        settings=Steps(max_steps=settings.max_steps),
        num_chains=settings.chains,
    )
    if not isinstance(density_of(trials), Program):  # those serve the next clip
        jax.clear_caches()
    sampling = {"sampler": settings.sampler, "sampling": dict(posterior.stats)}
    return posterior, fit.z, {"status": posterior.status.value} | sampling


def _diagnosis(settings: Diagnose, measured: Sequence[Measurement]) -> dict[str, Any]:
    from galileo_jax.diagnosis.diagnose import diagnose
    from galileo_jax.diagnosis.document import diagnosis_document
    from galileo_jax.inference.fits.gradient import Code
    from galileo_jax.model.effects.registry import effect_names, make_effects

    trials = _trials(settings, measured, make_effects(effect_names()))
    scenes = [problem.model.scene.surroundings for problem in trials.problems]
    effects = trials.problems[0].model.effects
    there = tuple(e for e in effects if any(e.parameters(scene) for scene in scenes))
    trials = _trials(settings, measured, there)
    found = diagnose(trials, seed=settings.seed, add=settings.add)
    if found.rounds[0].hypothesis.fit.code is Code.FAILED:
        raise InputError(f"{measured[0].clip.path}: {Code.FAILED}")
    return {
        "clips": [str(one.clip.path) for one in measured],
        "method": settings.method,
        **diagnosis_document(trials, found, settings.seed),
        "engine": trials.problems[0].engine.name,
        "version": __version__,
        "seed": settings.seed,
    }


def _trials(settings: Settings, measured: Sequence[Measurement], effects: Any) -> "JointProblem":
    from galileo_jax.inference.build_problem import make_joint_problem

    return make_joint_problem(
        [one.clip for one in measured],
        [one.observation for one in measured],
        settings.engine,
        effects,
        getattr(settings, "noise", "camera"),
    )
