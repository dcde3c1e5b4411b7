"""`galileo fit`: from a clip to masses and friction coefficients."""

import argparse
import hashlib
import json
import shlex
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from galileo_jax import __version__
from galileo_jax.api.precompile import Build, work_ahead
from galileo_jax.clip.schema import Clip
from galileo_jax.commands import command
from galileo_jax.commands.clip_options import add_clip_options, load_clips
from galileo_jax.files.atomic_write import write_json
from galileo_jax.inference.mass_ratios import mass_ratios
from galileo_jax.measurement.measure import Measurement, inferred, measure
from galileo_jax.results.stale_outputs import PREDICTION, outdated
from galileo_jax.rollout.engine_names import MOTIONS
from galileo_jax.runtime.errors import InputError
from galileo_jax.runtime.jax_setup import set_up
from galileo_jax.runtime.registry import entry_names

if TYPE_CHECKING:
    from galileo_jax.inference.fits.gradient import GradientFit, GradientFitter
    from galileo_jax.inference.joint_problem import JointProblem
    from galileo_jax.inference.posterior import Posterior
    from galileo_jax.model.effects.effect import Effect
    from galileo_jax.observation.observation import Observation

BLOCK_STEPS = 25  # of every chain, between two looks at convergence
WARMUP_STEPS = 200  # of every chain; with 100 the proposals are poor
METHODS = ("grad", "mh", "cnn")
PRESETS = ("galileo", "thesis")
OF_GALILEO, OF_THESIS = (
    ("--sampler", "--max-steps", "--init"),
    ("--similarity", "--acceptance", "--selection"),
)
INITS = ("grad", "cnn")
OFF_THE_PLANE = "an object has a z_m: motion in a plane takes no notice; see --motion free"
SAMPLERS = entry_names("galileo_jax.inference.samplers.library")
SIMILARITIES = entry_names("galileo_jax.similarity.library")


def main(argv: Sequence[str]) -> int | None:
    """Fits a clip, or several trials together, and writes a run."""
    call = _parser().parse_args(argv)
    _refuse_ignored(call, argv)
    if call.motion == "free":
        _refuse_planar_only(call)
    clips = load_clips(call.clips, call.pixels_per_metre)
    out = out_folder(call, clips)
    if call.preset == "thesis" and len(clips) > 1:
        raise InputError("--preset thesis: one clip expected")
    truth = read_truth(clips[0])
    if call.effects or call.effects_from:
        chosen_effects(call)  # a wrong name is told before anything is tracked
    ahead = work_ahead(clips, None if call.method == "cnn" else fitter_of(call, call.motion))
    timings = {"track": 0.0, "compile": 0.0, "fit": 0.0}
    began = time.perf_counter()
    measured = [measure(clip) for clip in clips]
    ahead.join()
    timings["track"] = time.perf_counter() - began
    has_prediction = (out / PREDICTION).is_file()
    result = fit_clips(measured, call, out, timings)
    print(_table(result, truth))
    if has_prediction and not (out / PREDICTION).is_file():
        command.console().print(
            f"{out}: the earlier fit's prediction is gone; make it again: galileo predict {out} "
            "--seconds S",
            soft_wrap=True,
        )
    for sentence in outdated(out, [one.observation for one in measured]):
        command.console().print(f"warning: {sentence}", soft_wrap=True)
    told = {doubt for one in measured for doubt in one.doubts}  # when they were found
    for warning in (each for each in result.get("warnings", []) if each not in told):
        command.console().print(f"warning: {warning}")
    pages = [out] if len(clips) == 1 else [out / one.name for one in measured]
    command.console().print(", ".join([f"{out}/result.json", *(f"{p}/report.html" for p in pages)]))
    return None


def _refuse_ignored(call: argparse.Namespace, argv: Sequence[str]) -> None:
    """Options of a sampler that does not run."""
    if call.method != "mh":
        where = f"of --method mh, not of {call.method}"
        command.refuse_ignored(argv, ("--preset", *OF_GALILEO, *OF_THESIS), where)
    elif call.preset == "thesis":
        command.refuse_ignored(argv, OF_GALILEO, "not of --preset thesis")
    else:
        command.refuse_ignored(argv, OF_THESIS, "of --preset thesis only")


def _refuse_planar_only(call: argparse.Namespace) -> None:
    if call.engine not in ("auto", "c"):
        raise InputError(
            f"--engine {call.engine}: it moves objects in a plane; --motion free takes c"
        )
    for option in ("method", "init"):
        if getattr(call, option) == "cnn":
            raise InputError(f"--{option} cnn: the network knows motion in a plane only")


def out_folder(call: argparse.Namespace, clips: Sequence[Clip]) -> Path:
    """Where a call's results go: `--out`, or runs/ and the clips' names."""
    out = Path(call.out) if call.out else Path("runs") / "+".join(clip.path.stem for clip in clips)
    if out.exists() and not out.is_dir():
        raise InputError(f"--out: {out} is a file; a folder expected")
    return out


def chosen_effects(call: argparse.Namespace) -> "tuple[Effect, ...]":
    """The effects that `--effects` and `--effects-from` name."""
    from galileo_jax.model.effects.registry import load_file, make_effects

    for path in call.effects_from:
        load_file(path)
    return make_effects([name for name in call.effects.split(",") if name])


def built(
    clips: Sequence[Clip],
    observations: "Sequence[Observation]",
    call: argparse.Namespace,
    motion: str = "planar",
) -> "JointProblem":
    """The joint problem of the model that a call asks for.

    Raises:
      InputError: an effect is unknown, or has no place in these clips.
    """
    from galileo_jax.inference.build_problem import make_joint_problem

    effects = chosen_effects(call)
    trials = make_joint_problem(clips, observations, call.engine, effects, motion=motion)
    if absent := trials.without_place():
        raise InputError(f"--effects: {absent[0]} has no place in {clips[0].path}")
    return trials


def fitter_of(call: argparse.Namespace, motion: str = "planar") -> Build:
    """What fits the clips of a call by gradients."""

    def build(clips: Sequence[Clip], observations: "Sequence[Observation]") -> "GradientFitter":
        from galileo_jax.inference.fits.gradient import GradientFitter

        return GradientFitter(built(clips, observations, call, motion))

    return build


def fit_clips(
    measured: Sequence[Measurement], call: argparse.Namespace, out: Path, timings: dict[str, float]
) -> dict[str, Any]:
    """Fits tracked clips, writes the run and its reports, and returns result.json.

    Of several clips each has a run of its own below `out`, with the joint posterior.
    """
    set_up()
    observations = [m.observation for m in measured]
    trials = built([m.clip for m in measured], observations, call, call.motion)
    if call.method == "cnn":
        posterior, z_best, notes = _network(trials, call, timings)
    else:
        posterior, z_best, notes = _search(trials, measured, call, out, timings)
    notes["motion"] = call.motion
    if call.motion == "planar" and any(item.z_m for m in measured for item in m.clip.objects):
        notes["warnings"] = [OFF_THE_PLANE]
    if call.effects_from:
        notes["effects_from"] = [str(Path(path).resolve()) for path in call.effects_from]

    result = write_fit(
        measured,
        trials,
        posterior,
        z_best,
        out,
        files=[str(path) for path in call.clips],
        method=call.method,
        seed=call.seed,
        timings=timings,
        notes=notes,
    )
    (out / CHECKPOINT).unlink(missing_ok=True)
    return result


def write_fit(
    measured: Sequence[Measurement],
    trials: "JointProblem",
    posterior: "Posterior",
    z_best: np.ndarray,
    out: Path,
    *,
    files: Sequence[str],
    method: str,
    seed: int,
    timings: Mapping[str, float],
    notes: dict[str, Any],
    with_pages: bool = True,
) -> dict[str, Any]:
    """Writes runs and reports of a finished fit, and returns result.json.

    Args:
      measured: the clips.
      trials: the model of them that was fitted.
      posterior: what is known of its parameters.
      z_best: the best z.
      out: the folder; of several clips each has a run of its own below it.
      files: the clips as they were named in the call.
      method: of the fit.
      seed: of everything random.
      timings: by stage, s.
      notes: what else the method has to say.
      with_pages: whether every run gets its report.
    """
    from galileo_jax.inference.result import make_result
    from galileo_jax.report import write_report
    from galileo_jax.results.run import Run, save_run
    from galileo_jax.results.stale_outputs import forget_prediction, forget_single_run

    def told(
        some: "JointProblem", draws: "Posterior", z: np.ndarray, names: list[str]
    ) -> dict[str, Any]:
        return make_result(
            some,
            draws,
            z,
            clips=names,
            method=method,
            seed=seed,
            timings_s={key: round(value, 3) for key, value in timings.items()},
            notes=notes | inferred(measured),
        )

    if doubts := [doubt for one in measured for doubt in one.doubts]:
        notes = notes | {"warnings": [*doubts, *notes.get("warnings", [])]}
    result = told(trials, posterior, z_best, list(files))
    if len(measured) == 1:
        clip, observation = measured[0].clip, measured[0].observation
        forget_prediction(out)
        save_run(out, clip, observation, posterior, result)
        if with_pages:
            write_report(Run(out, clip, trials.problems[0], posterior, result))
        return result
    forget_prediction(out)
    forget_single_run(out)
    for i, one in enumerate(measured):
        alone, columns = trials.alone(i), trials.columns_of(i)
        own = posterior.chosen(columns, alone.names)
        told_of = told(alone, own, z_best[columns], [files[i]])
        forget_prediction(out / one.name)
        save_run(out / one.name, one.clip, one.observation, own, told_of)
        if with_pages:
            write_report(Run(out / one.name, one.clip, trials.problems[i], own, told_of))
    posterior.to_netcdf(out / "posterior.nc")
    write_json(out / "result.json", result)
    return result


CHECKPOINT = "chains.checkpoint.npz"
Found = tuple["Posterior", np.ndarray, dict[str, Any]]  # draws, the best z, notes for result.json


def _search(
    trials: "JointProblem",
    measured: Sequence[Measurement],
    call: argparse.Namespace,
    out: Path,
    timings: dict[str, float],
) -> Found:
    """The gradient fit, and where asked for the sampler that starts from it."""
    from galileo_jax.inference.fits.gradient import Code, GradientFitter
    from galileo_jax.inference.laplace import laplace_posterior

    began = time.perf_counter()
    fitter = GradientFitter(trials)
    fitter.compile()
    timings["compile"] = time.perf_counter() - began
    began = time.perf_counter()
    with command.console().status("fitting") as status:
        fit, starts, begun = _begin(trials, fitter, call, status.update)
    if fit.code is Code.FAILED:
        raise InputError(f"{measured[0].clip.path}: {fit.code}")
    posterior = laplace_posterior(trials, fit, call.seed)
    notes: dict[str, Any] = {"engine": trials.problems[0].engine.name, "status": fit.code.value}
    notes |= begun
    if call.method == "mh":
        if call.preset == "thesis":
            posterior, extra = _thesis(trials, call)
        else:
            identity = identity_of(measured, trials, call)
            posterior, extra = _metropolis(trials, fit, starts, call, out, identity)
        notes |= extra
    timings["fit"] = time.perf_counter() - began
    return posterior, fit.z, notes


def _begin(trials: "JointProblem", fitter: "GradientFitter", call, on_stage: Callable[[str], None]):
    """The mode, where chains start in z (None: dispersed round it), and notes."""
    if call.init == "cnn":
        from galileo_jax.inference.metropolis import NUM_CHAINS
        from galileo_jax.neural.start import start_from_network

        start = start_from_network(trials, call.seed, NUM_CHAINS)
        return start.fit, start.z, start.notes
    return fitter.fit(call.seed, on_stage=on_stage), None, {}


def _network(trials: "JointProblem", call: argparse.Namespace, timings: dict[str, float]) -> Found:
    """The trained network's answer."""
    from galileo_jax.neural.estimate import cnn_posterior

    began = time.perf_counter()
    posterior, z_best, notes = cnn_posterior(trials, call.seed)
    timings["fit"] = time.perf_counter() - began
    return posterior, z_best, {"engine": trials.problems[0].engine.name} | notes


def _metropolis(
    trials: "JointProblem",
    fit: "GradientFit",
    starts: np.ndarray | None,
    call: argparse.Namespace,
    out: Path,
    identity: str,
) -> tuple["Posterior", dict[str, Any]]:
    """Samples with a progress bar; resumes what a Ctrl-C left in the run's folder."""
    from galileo_jax.inference.metropolis import metropolis_posterior
    from galileo_jax.inference.samplers.driver import Settings

    settings = Settings(warmup_steps=WARMUP_STEPS, block_steps=BLOCK_STEPS)
    if call.max_steps:
        settings = replace(settings, max_steps=call.max_steps)
    out.mkdir(parents=True, exist_ok=True)
    with command.progress() as bar:
        task = bar.add_task("sampling", total=settings.warmup_steps + settings.max_steps)
        posterior = metropolis_posterior(
            trials,
            fit,
            call.seed,
            sampler=call.sampler,
            settings=settings,
            starts=starts,
            checkpoint=out / CHECKPOINT,
            identity=identity,
            on_block=lambda state: bar.update(task, completed=state.num_steps),
        )
    return posterior, {
        "status": posterior.status.value,
        "sampler": call.sampler,
        "sampling": dict(posterior.stats),
    }


def _thesis(trials: "JointProblem", call):
    """The thesis's sampler on our rollouts: a point, and draws that are no posterior."""
    from galileo_jax.inference.thesis_preset import thesis_posterior

    chosen = {name: getattr(call, name) for name in ("similarity", "acceptance", "selection")}
    posterior, best = thesis_posterior(trials, call.seed, **chosen)
    return posterior, {
        "status": posterior.status.value,
        "preset": call.preset,
        **chosen,
        "best": best,
    }


def identity_of(
    measured: Sequence[Measurement], trials: "JointProblem", call: argparse.Namespace
) -> str:
    """What the chains sample: a checkpoint of anything else is refused.

    Raises:
      InputError: a file of `--effects-from` has gone since it was run.
    """
    from galileo_jax.inference.metropolis import NUM_CHAINS

    digest = hashlib.sha256()
    for one in measured:
        seen = one.observation
        for array in (seen.times_s, seen.position_m, seen.covariance_m2, seen.mask):
            digest.update(np.ascontiguousarray(array).tobytes())
        digest.update(one.clip.model_dump_json(exclude={"path", "video", "track"}).encode())
    for path in call.effects_from:
        try:
            source = Path(path).read_bytes()
        except OSError as error:
            raise InputError(f"effects from {path}: {error.strerror or error}") from error
        digest.update(hashlib.sha256(source).digest())
    # Laws and priors may change with the package, and with others that bring effects.
    model = [__version__, trials.problems[0].engine.name, repr(trials.parameters)]
    model += [trials.problems[0].model.motion]
    options = [call.sampler, call.seed, call.effects, call.init, NUM_CHAINS]
    digest.update(json.dumps(model + options).encode())
    return digest.hexdigest()


def read_truth(clip: Clip) -> dict[str, float]:
    """What NAME.truth.json beside a synthetic clip says of its parameters; {} without.

    It is shown beside the estimate, and nothing else is done with it.

    Raises:
      InputError: the file is there and is not what `galileo simulate` writes.
    """
    path = clip.path.with_suffix(".truth.json")
    if not path.is_file():
        return {}
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        if "parameters" in content:
            return {key: float(value) for key, value in content["parameters"].items()}
        count = content.get("objects", 2)
        names = [f"{key}{i + 1}" for i in range(count) for key in "mk"]
        known = {name: float(content[name]) for name in names}
    except (ValueError, KeyError, TypeError) as error:
        raise InputError(f"{path}: not a truth with m1, k1, m2 and k2 ({error})") from error
    return known | mass_ratios([known[f"m{i + 1}"] for i in range(count)])


def _table(result: dict[str, Any], truth: Mapping[str, float]) -> str:
    """What the user asked for, in a few lines; with a column for the truth if it is known."""
    from galileo_jax.inference.per_mass import SUFFIX

    lines = [f"{'':<18}{'truth' if truth else '':>10}{'mean':>10}{'sd':>10}   95 % interval"]
    for name, entry in (result["parameters"] | result["derived"]).items():
        unit = "" if entry["unit"] == "1" else f" {entry['unit']}"
        interval = f"[{entry['q025']:.4g}, {entry['q975']:.4g}]{unit}"
        known = "" if entry["identified"] else "   not determined by this clip"
        if f"{name}{SUFFIX}" in result["derived"]:
            known = "   not determined by this clip: only per mass, below"
        true = f"{truth[name]:.4g}" if name in truth else ""
        lines.append(
            f"{name:<18}{true:>10}{entry['mean']:>10.4g}{entry['sd']:>10.2g}   {interval}{known}"
        )
    error = result["error"]
    lines.append(
        f"chi2 per degree of freedom {error['chi2_per_dof']:.2f}, velocity error "
        f"{error['rmse']:.4f} m/s (tracking noise {error['noise']:.4f}); {result['status']}"
    )
    from galileo_jax.report.fit_text import CHI2_HIGH

    if not error["chi2_per_dof"] <= CHI2_HIGH:
        files = shlex.join(result["clips"])
        lines.append(
            "The model leaves more over than noise explains: do not trust its parameters. "
            f"See where it fails: galileo compare {files}"
        )
    return "\n".join(lines)


def _parser() -> command.Parser:
    parser = command.Parser(prog="galileo fit", description=__doc__)
    parser.add_argument("clips", nargs="+", metavar="CLIP", help="video, its yaml, or a csv track")
    parser.add_argument("--method", choices=METHODS, default="grad")
    parser.add_argument("--effects", default="", help="a,b: effects in the model")
    add_clip_options(parser, out="folder of the run (default runs/CLIP)")
    parser.add_argument(
        "--motion",
        choices=MOTIONS,
        default="planar",
        help="free: from the first hit on objects turn and tip (MuJoCo's C engine)",
    )
    group = parser.add_argument_group("--method mh")
    group.add_argument("--sampler", choices=SAMPLERS, default="mixture")
    group.add_argument(
        "--max-steps",
        type=command.whole_number(BLOCK_STEPS, BLOCK_STEPS),
        help="per chain, after the warm-up",
    )
    group.add_argument(
        "--init",
        choices=INITS,
        default="grad",
        help="what chains start from: a fit, or the network",
    )
    group.add_argument("--preset", choices=PRESETS, default="galileo")
    group.add_argument(
        "--similarity",
        choices=SIMILARITIES,
        default="thesis_gaussian",
        help="of --preset thesis",
    )
    group.add_argument("--acceptance", choices=("coin", "metropolis"), default="coin")
    group.add_argument("--selection", choices=("best", "least_variance"), default="best")
    return parser
