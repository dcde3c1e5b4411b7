"""`fit`: from tracks to masses, friction coefficients and effects, with honest intervals."""

import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from galileo_jax.api.fit_result import Fit, Found, make_fit
from galileo_jax.api.options import (
    OF_THESIS,
    FitOptions,
    check_choices,
    ignored_options,
    options_of,
)
from galileo_jax.api.track import TrackLike, as_measurements
from galileo_jax.assembly.build_problem import make_joint_problem
from galileo_jax.assembly.checkpoint_identity import identity_of
from galileo_jax.clip.schema import Clip
from galileo_jax.inference.fit_posterior import (
    fit_posterior,
    laplace_posterior,
    two_solutions,
    uncertain_width,
)
from galileo_jax.inference.fits.gradient import Code, GradientFitter
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.measurement.measure import Measurement
from galileo_jax.model.effects.effect import Effect
from galileo_jax.model.effects.free_quantities import make_free_quantities
from galileo_jax.model.effects.registry import effect_names, load_file, make_effects, register
from galileo_jax.model.parameters import inverse
from galileo_jax.observation.observation import Observation
from galileo_jax.rollout.engine_names import ENGINES
from galileo_jax.runtime import progress
from galileo_jax.runtime.errors import InputError
from galileo_jax.runtime.known_names import check_known, option_of
from galileo_jax.runtime.precision import in_float64
from galileo_jax.search.fit import best_fit
from galileo_jax.search.imperfect import World, Worlds, fit_worlds

WARMUP_STEPS = 200  # of every chain; with 100 the proposals are poor
BLOCK_STEPS = 25  # of every chain, between two looks at convergence
TRACKED, FITTED = 0.4, 0.6  # shares of the work, for progress
OFF_THE_PLANE = "an object has a z_m, which motion in a plane ignores; see --motion free"

EffectsLike = str | Sequence[str | type[Effect]]


@in_float64
def fit(
    tracks: TrackLike | Sequence[TrackLike],
    *,
    method: Literal["grad", "mh", "cnn"] = "grad",
    effects: EffectsLike = (),
    effects_from: Sequence[str | Path] = (),
    free: EffectsLike = (),
    discrepancy: Literal["auto", "none", "rough"] = "auto",
    motion: Literal["planar", "free"] = "planar",
    engine: str = "auto",
    noise: Literal["camera", "bodies", "tracker"] | None = None,
    seed: int = 0,
    pixels_per_metre: float | None = None,
    sampler: str = "mixture",
    max_steps: int = 4000,
    chains: int | None = None,
    init: Literal["grad", "cnn"] = "grad",
    preset: Literal["galileo", "thesis"] = "galileo",
    similarity: Literal["earth_mover", "root_mean", "thesis_gaussian"] = "thesis_gaussian",
    acceptance: Literal["coin", "metropolis"] = "coin",
    selection: Literal["best", "least_variance"] = "best",
    checkpoint: str | Path | None = None,
    on_progress: progress.OnProgress | None = None,
    cancel: progress.CancelFlag | None = None,
) -> Fit:
    """Estimates masses, friction coefficients and the strengths of effects.

    Args:
      tracks: a track or several (trials of the same objects: one joint fit); a clip or a file is
        tracked first.
      method: "grad": best fit and rollouts round it (seconds); "mh": Metropolis-Hastings chains,
        started from it; "cnn": a trained network (at once).
      effects: names of effects in the model ("a,b" or a sequence), or classes.
      effects_from: Python files that register more effects.
      free: declared quantities to infer instead, such as "gravity".
      discrepancy: "auto": what no surface, hit, trial or mark is free of may be there or not, and
        the evidence decides; "rough": it is there, by sizes that are inferred (`imperfections` of
        the result); "none": it is not.
      motion: "planar", or "free": from the first hit on objects turn and tip (boxes by the
        rigid engine, cylinders by MuJoCo's C engine).
      engine: what simulates the motion: "auto" (rigid), "rigid", "c" or "mjx".
      noise: the errors that a track is assumed to have: "camera", "bodies" or "tracker"; None: as
        the clip was measured.
      seed: of all random numbers; the same seed gives the same result.
      pixels_per_metre: overrides the clips' scale; None: the yaml's.
      sampler: for method "mh": how steps are proposed.
      max_steps: for method "mh": steps of each chain after the warm-up, a multiple of 25.
      chains: for method "mh": number of chains; None: 8 (preset "thesis": 16).
      init: for method "mh": where the chains start from, "grad" or "cnn".
      preset: for method "mh": "galileo", or "thesis": the sampler that this project began with.
      similarity: for preset "thesis": how velocity profiles are compared.
      acceptance: for preset "thesis": how a worse proposal is accepted, "coin" or "metropolis".
      selection: for preset "thesis": which sample of the chains is the answer, "best" or
        "least_variance".
      checkpoint: a file; chains that were interrupted go on from it.
      on_progress: called with the stage, the share done (0 to 1) and what there is of the result:
        of method "mh" first the gradient fit that the chains start from, a `Fit`.
      cancel: a flag with `is_set`, such as `threading.Event`.

    Returns:
      The fit: `summary()`, `posterior`, `residuals`, `plot()`, `report(path)`, `save(folder)`.

    Raises:
      InputError: a clip, an effect or an option is wrong.
      Cancelled: `cancel` was set; work stops between two batches.

    Examples:
      >>> import galileo_jax as gx
      >>> made = gx.simulate("ramp.csv", seed=1, track_only=True)
      >>> fit = gx.fit("ramp.csv", seed=0)
      >>> abs(fit.parameters["k1"]["mean"] - made.truths[0]["k1"]) < 0.01
      True
    """
    options = options_of(
        FitOptions,
        locals(),
        effects=names_of(effects),
        effects_from=tuple(map(str, effects_from)),
        free=names_of(free),
    )
    _check(options)

    def compile_for(clips: Sequence[Clip], likely: Sequence[Observation]) -> None:
        GradientFitter(_problem(clips, likely, options)).compile()

    with progress.scope(on_progress, cancel):
        with progress.part(0.0, TRACKED):
            measured, track_s = as_measurements(
                tracks, pixels_per_metre, None if method == "cnn" else compile_for
            )
        with progress.part(TRACKED, 1.0):
            return _fitted(measured, options, track_s, Path(checkpoint) if checkpoint else None)


def names_of(effects: EffectsLike) -> tuple[str, ...]:
    """The effects' names; "a,b" is two of them, and a class that nobody registered is."""
    if isinstance(effects, str):
        return tuple(name.strip() for name in effects.split(",") if name.strip())
    known = effect_names()
    for one in effects:
        if not isinstance(one, str) and one.name not in known:
            register(one)
    return tuple(one if isinstance(one, str) else one.name for one in effects)


def chosen_effects(names: Sequence[str], files: Sequence[str | Path]) -> tuple[Effect, ...]:
    """The effects of these names, those that files register included."""
    for path in files:
        load_file(path)
    return make_effects(list(names))


def _check(options: FitOptions) -> None:
    """Raises `InputError` for what is wrong with a call whatever its clips are."""
    check_choices(options)
    if options.discrepancy == "rough" and not _has_imperfections(options):
        raise InputError(
            "--discrepancy rough: of --method grad or mh, --motion planar, --init grad and "
            f"--preset galileo, not of --method {options.method} and --motion {options.motion}"
        )
    check_known("--engine", "engine", options.engine, ENGINES)
    ignored, why = ignored_options(options.method, options.preset)
    for name in ignored:
        if getattr(options, name) != getattr(FitOptions(), name):
            raise InputError(f"{option_of(name)}: {why}")
    if options.method == "mh":
        from galileo_jax.inference.samplers.sampler import SAMPLERS

        check_known("--sampler", "sampler", options.sampler, SAMPLERS.names())
    if options.max_steps < BLOCK_STEPS or options.max_steps % BLOCK_STEPS:
        raise InputError(
            f"--max-steps: {options.max_steps} is not a multiple of {BLOCK_STEPS}, {BLOCK_STEPS} "
            "or more"
        )
    if options.motion == "free":
        if options.engine == "mjx":
            raise InputError(
                "--engine mjx: it moves objects in a plane only; --motion free needs rigid or c"
            )
        for name in ("method", "init"):
            if getattr(options, name) == "cnn":
                raise InputError(f"--{name} cnn: the network knows motion in a plane only")
    chosen_effects(options.effects, options.effects_from)
    make_free_quantities(options.free)


def _problem(
    clips: Sequence[Clip], observations: Sequence[Observation], options: FitOptions
) -> JointProblem:
    """The joint problem of the model that was asked for."""
    effects = chosen_effects(options.effects, options.effects_from)
    problem = make_joint_problem(
        clips,
        observations,
        options.engine,
        effects,
        options.noise,
        options.motion,
        options.free,
        trials_differ=_has_imperfections(options),
    )
    if absent := problem.without_place():
        raise InputError(f"--effects: {absent[0]} has no place in {clips[0].path}")
    return problem


def _has_imperfections(options: FitOptions) -> bool:
    """Whether imperfections of unknown size may be in the model: networks and the thesis know none.

    Nor does motion off the plane, nor chains that start from the network.
    """
    is_plain = (options.init, options.preset, options.motion) == ("grad", "galileo", "planar")
    return options.discrepancy in ("auto", "rough") and options.method != "cnn" and is_plain


def _fitted(
    measured: Sequence[Measurement], options: FitOptions, track_s: float, checkpoint: Path | None
) -> Fit:
    if options.preset == "thesis" and len(measured) > 1:
        raise InputError("--preset thesis: one clip expected")
    clips = [one.clip for one in measured]
    problem = _problem(clips, [one.observation for one in measured], options)
    timings = {"track": track_s, "compile": 0.0, "fit": 0.0}

    def made(found: Found) -> Fit:
        return make_fit(
            measured,
            found,
            method=options.method,
            seed=options.seed,
            timings=timings,
            effects_from=options.effects_from,
        )

    began = time.perf_counter()
    if options.method == "cnn":
        from galileo_jax.neural.estimate import cnn_posterior

        found = Found(problem, *cnn_posterior(problem, options.seed))
    elif options.preset == "thesis":
        found = _by_thesis(problem, options)
    else:
        fitter = GradientFitter(problem)
        progress.report("compiling", 0.0)
        fitter.compile()
        timings["compile"] = time.perf_counter() - began
        began = time.perf_counter()
        worlds, starts, notes = _gradient(fitter, options)
        if worlds.best.fit.code is Code.FAILED:
            raise InputError(f"{clips[0].path}: {worlds.best.fit.code}")
        found = _of_worlds(worlds, options, notes)
        if options.method == "mh":
            progress.report("fitted by gradient", FITTED, made(found))
            found = _by_chains(found, starts, measured, options, checkpoint)
    timings["fit"] = time.perf_counter() - began
    result = made(replace(found, notes={**found.notes, **_notes(options, clips, found)}))
    progress.report("fitted", 1.0, result)
    return result


def _notes(options: FitOptions, clips: Sequence[Clip], found: Found) -> dict[str, Any]:
    """What result.json says beside the numbers: doubts, and what was asked for."""
    notes: dict[str, Any] = {"motion": options.motion}
    said: list[str | None] = []
    if found.gradient is not None and options.method != "mh":
        said.append(two_solutions(found.problem, found.gradient, found.posterior.flat()))
        said.append(uncertain_width(found.posterior))
    if options.motion == "planar" and any(item.z_m for clip in clips for item in clip.objects):
        said.append(OFF_THE_PLANE)
    if warnings := [line for line in said if line is not None]:
        notes["warnings"] = warnings
    if options.free:
        notes["free"] = sorted(options.free)
    return notes | {"discrepancy_asked": options.discrepancy}


def _gradient(
    fitter: GradientFitter, options: FitOptions
) -> tuple[Worlds, np.ndarray | None, dict[str, Any]]:
    """What the clips may show, where chains start in z (None: dispersed round it), and notes."""
    if options.init == "cnn":
        from galileo_jax.neural.start import start_from_network

        start = start_from_network(fitter.trials, options.seed, _num_chains(options))
        return Worlds(World(fitter.trials, start.fit), start.fit), start.z, start.notes
    shares = {"searching": 0.1, "refining": 0.3, "searching on": 0.3}

    def on_stage(stage: str) -> None:
        progress.report(stage, shares.get(stage, 0.2))

    if _has_imperfections(options):
        is_open = options.discrepancy == "auto"
        worlds = fit_worlds(fitter.trials, options.seed, on_stage, may_be_exact=is_open)
        share = worlds.share if worlds.best.fit.sizes is None else 1 - worlds.share
        return worlds, None, {"probability_imperfect": share} if is_open else {}
    exact = best_fit(fitter, options.seed, on_stage)
    return Worlds(World(fitter.trials, exact), exact), None, {}


def _of_worlds(worlds: Worlds, options: FitOptions, notes: Mapping[str, Any]) -> Found:
    """The posterior round the best fit, of method "grad" with its other world mixed in."""
    problem, gradient = worlds.best.trials, worlds.best.fit
    make = laplace_posterior if options.method == "mh" else fit_posterior
    posterior = make(problem, gradient, options.seed)
    if worlds.other is not None and options.method != "mh":
        other = fit_posterior(worlds.other.trials, worlds.other.fit, options.seed)
        posterior = posterior.mixed_with(other, worlds.share)
    notes = {"status": gradient.code.value, **notes}
    return Found(problem, posterior, gradient.z, notes, gradient, worlds.exact)


def _by_chains(
    found: Found,
    starts: np.ndarray | None,
    measured: Sequence[Measurement],
    options: FitOptions,
    checkpoint: Path | None,
) -> Found:
    """Samples from the gradient fit on; resumes what an interruption left in the checkpoint."""
    from galileo_jax.inference.metropolis import metropolis_posterior
    from galileo_jax.inference.samplers.driver import Progress, Settings

    settings = Settings(
        warmup_steps=WARMUP_STEPS, block_steps=BLOCK_STEPS, max_steps=options.max_steps
    )

    def on_block(state: Progress) -> None:
        share = state.num_steps / (WARMUP_STEPS + options.max_steps)
        progress.report("sampling", FITTED + (1 - FITTED) * share, state)

    progress.report("sampling", FITTED)
    if checkpoint is not None:
        checkpoint.parent.mkdir(parents=True, exist_ok=True)
    assert found.gradient is not None
    posterior = metropolis_posterior(
        found.problem,
        found.gradient,
        options.seed,
        sampler=options.sampler,
        settings=settings,
        num_chains=_num_chains(options),
        starts=starts,
        checkpoint=checkpoint,
        identity=checkpoint_identity(measured, found.problem, options),
        on_block=on_block,
    )
    status = posterior.status.value
    if found.gradient.code is Code.MISFIT:
        status += f"; at the start of the chains: {found.gradient.code.value}"
    notes = {
        **found.notes,
        "status": status,
        "sampler": options.sampler,
        "sampling": dict(posterior.stats),
    }
    return replace(found, posterior=posterior, notes=notes)


def checkpoint_identity(
    measured: Sequence[Measurement], problem: JointProblem, options: FitOptions
) -> str:
    """What the chains sample: a checkpoint of anything else is refused."""
    chosen = (options.sampler, options.seed, options.effects, options.free, options.init)
    chosen += (_num_chains(options),)
    return identity_of(measured, problem, effects_from=options.effects_from, options=chosen)


def _num_chains(options: FitOptions) -> int:
    from galileo_jax.inference.metropolis import NUM_CHAINS

    return options.chains or NUM_CHAINS


def _by_thesis(problem: JointProblem, options: FitOptions) -> Found:
    """The thesis's sampler on our rollouts: a point, and draws that are no posterior."""
    from galileo_jax.thesis.sampler import NUM_CHAINS, thesis_posterior

    chosen = {name: getattr(options, name) for name in OF_THESIS}
    posterior, best = thesis_posterior(
        problem, options.seed, **chosen, num_chains=options.chains or NUM_CHAINS
    )
    middle = problem.theta(np.zeros(len(problem.names)))
    theta = [best.get(name, rest) for name, rest in zip(problem.names, middle, strict=True)]
    z_best = inverse(problem.parameters, np.asarray(theta))
    notes = {"status": posterior.status.value, "preset": options.preset, **chosen, "best": best}
    return Found(problem, posterior, z_best, notes)
