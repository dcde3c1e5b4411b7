"""`galileo compare`: is the model adequate for a clip, and where does it fail?"""

import argparse
import shlex
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from galileo_jax import __version__
from galileo_jax.api.precompile import work_ahead
from galileo_jax.commands import command
from galileo_jax.commands.clip_options import add_clip_options, load_clips
from galileo_jax.commands.fit import built, chosen_effects, fitter_of, out_folder
from galileo_jax.files.atomic_write import write_json
from galileo_jax.measurement.measure import measure
from galileo_jax.results.stale_outputs import TRACKS, digest
from galileo_jax.runtime.errors import InputError
from galileo_jax.runtime.jax_setup import set_up

if TYPE_CHECKING:
    from galileo_jax.clip.schema import Clip
    from galileo_jax.comparison.compare import Comparison
    from galileo_jax.inference.joint_problem import JointProblem

NUM_CELLS = 6


@dataclass(frozen=True)
class Compared:
    """What is compared: the clips with a model, how they were named, and where results go."""

    trials: "JointProblem"
    declared: tuple["Clip", ...]
    clips: list[str]
    out: Path


def main(argv: Sequence[str]) -> int | None:
    """Compares a model with clips, or a run with its own; writes compare.json and a page."""
    call = _parser().parse_args(argv)
    began = time.perf_counter()
    runs = [path for path in call.clips if Path(path).is_dir()]
    if runs and len(call.clips) > 1:
        raise InputError(f"{runs[0]}: a run is compared alone; clips are given as files")
    compared = _of_run(Path(runs[0]), call) if runs else _of_clips(call)
    trials = compared.trials
    from galileo_jax.comparison.compare import compare
    from galileo_jax.comparison.document import comparison_document
    from galileo_jax.comparison.path_residuals import path_residuals
    from galileo_jax.inference.fits.gradient import Code, GradientFitter
    from galileo_jax.report import comparison_page

    with command.console().status("fitting") as status:
        fit = GradientFitter(trials).fit(call.seed, on_stage=status.update)
        if fit.code is Code.FAILED:
            raise InputError(f"{compared.clips[0]}: {fit.code}")
        status.update("comparing with replicates of the fitted model")
        comparison = compare(trials, fit, call.seed)
        status.update("drawing")
        paths = path_residuals(trials, fit, comparison, call.seed)
        page, title = compared.out / "report.html", ", ".join(p.name for p in trials.problems)
        told = comparison_page.ComparisonReport(
            comparison,
            trials,
            trials.theta(fit.z, fit.free),
            compared.declared,
            trials.all_effects,
            paths,
            shlex.join(["galileo", "compare", *argv]),
            call.seed,
        )
        comparison_page.write_comparison_page(page, title, told)
    document: dict[str, Any] = {
        "clips": compared.clips,
        TRACKS: [digest(problem.observation) for problem in trials.problems],
        "effects": list(trials.all_effects),
        **comparison_document(comparison),
        "converged": fit.code is Code.CONVERGED,
        "engine": trials.problems[0].engine.name,
        "seconds": round(time.perf_counter() - began, 3),
        "version": __version__,
        "seed": call.seed,
    }
    write_json(compared.out / "compare.json", document)
    print("\n".join(_told(trials, comparison)))
    command.console().print(f"{compared.out}/compare.json, {page}", soft_wrap=True)
    return None


def _of_clips(call: argparse.Namespace) -> Compared:
    """Clips as they are, with the effects asked for."""
    clips = load_clips(call.clips, call.pixels_per_metre)
    out = out_folder(call, clips)
    if call.effects or call.effects_from:
        chosen_effects(call)  # a wrong name is told before anything is tracked
    ahead = work_ahead(clips, fitter_of(call))
    measured = [measure(clip) for clip in clips]
    ahead.join()
    clips = [one.clip for one in measured]
    set_up()
    trials = built(clips, [one.observation for one in measured], call)
    out = out if call.out else out / "compare"
    return Compared(trials, tuple(clips), list(call.clips), out)


def _of_run(folder: Path, call: argparse.Namespace) -> Compared:
    """A finished fit: its observations and its effects; of several clips the runs below it."""
    if call.effects or call.effects_from or call.pixels_per_metre:
        raise InputError(f"{folder}: a run has its own effects and scale; give its clip to change")
    set_up()
    from galileo_jax.inference.joint_problem import JointProblem
    from galileo_jax.results.run import CLIP, RESULT, load_run

    folders = [folder]
    if (folder / RESULT).is_file() and not (folder / CLIP).is_file():
        folders = sorted(path.parent for path in folder.glob(f"*/{CLIP}")) or [folder]
    runs = [load_run(each, call.engine) for each in folders]
    out = Path(call.out) if call.out else folder / "compare"
    clips = [clip for run in runs for clip in run.result["clips"]]
    trials = JointProblem(tuple(run.problem for run in runs))
    return Compared(trials, tuple(run.clip for run in runs), clips, out)


def _told(trials: "JointProblem", comparison: "Comparison") -> list[str]:
    """The verdict, the worst cells and the nuisances outside their priors."""
    from galileo_jax.comparison.document import pulled
    from galileo_jax.report import diagnosis_text

    several = len(trials.problems) > 1
    width = max(len(problem.name) for problem in trials.problems) + 2 if several else 0
    lines = [
        diagnosis_text.adequacy(comparison, trials.all_effects),
        "",
        f"{'clip' if several else '':<{width}}{'object':<10}{'axis':<6}{'phase':<11}"
        f"{'rmse':>8}{'noise':>8} m/s{'z':>7}",
    ]
    for place in comparison.where[:NUM_CELLS]:
        lines.append(
            f"{place.clip if several else '':<{width}}{place.object:<10}{place.axis:<6}"
            f"{place.phase:<11}{place.rmse:>8.4f}{place.noise:>8.4f}{place.z:>11.1f}"
        )
    return lines + [diagnosis_text.pull_text(pull) for pull in pulled(comparison)]


def _parser() -> command.Parser:
    parser = command.Parser(prog="galileo compare", description=__doc__)
    parser.add_argument(
        "clips", nargs="+", metavar="CLIP|RUN", help="video, its yaml, a csv track, or a run"
    )
    parser.add_argument("--effects", default="", help="a,b: effects in the model")
    add_clip_options(parser, out="folder (default runs/CLIP/compare, RUN/compare)")
    return parser
