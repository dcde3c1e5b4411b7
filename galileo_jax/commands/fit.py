"""`galileo fit`: from a clip to masses and friction coefficients."""

import shlex
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from galileo_jax.commands import command
from galileo_jax.commands.clip_options import add_clip_options, load_clips, out_folder, warn
from galileo_jax.commands.progress_display import progress_display
from galileo_jax.results.stale_outputs import PREDICTION, stale_documents
from galileo_jax.results.truth import true_parameters
from galileo_jax.rollout.engine_names import MOTIONS
from galileo_jax.runtime.registry import entry_names

if TYPE_CHECKING:
    from galileo_jax.api.fit_result import Fit

METHODS = ("grad", "mh", "cnn")
PRESETS = ("galileo", "thesis")
INITS = ("grad", "cnn")
NOISES = ("camera", "bodies", "tracker")
OF_GALILEO, OF_THESIS = (
    ("--sampler", "--max-steps", "--init"),
    ("--similarity", "--acceptance", "--selection"),
)
SAMPLERS = entry_names("galileo_jax.inference.samplers.library")
FREE = "galileo_jax.model.effects.free"
SIMILARITIES = entry_names("galileo_jax.thesis.similarities")
BLOCK_STEPS = 25  # as api.fit has it, which imports JAX


def main(argv: Sequence[str]) -> int | None:
    """Fits a clip, or several trials together, and writes a run."""
    call = _parser().parse_args(argv)
    _refuse_ignored(call, argv)
    clips = load_clips(call.clips, call.pixels_per_metre)
    out = out_folder(call.out, clips)
    truth = true_parameters(clips[0])
    from galileo_jax.api.fit import fit
    from galileo_jax.results.run import CHECKPOINT

    with progress_display() as display:
        found = fit(
            clips,
            method=call.method,
            effects=call.effects,
            effects_from=call.effects_from,
            free=call.free,
            motion=call.motion,
            engine=call.engine,
            noise=call.noise,
            seed=call.seed,
            sampler=call.sampler,
            max_steps=call.max_steps,
            chains=call.chains,
            init=call.init,
            preset=call.preset,
            similarity=call.similarity,
            acceptance=call.acceptance,
            selection=call.selection,
            checkpoint=out / CHECKPOINT,
            on_progress=display,
        )
        display("writing the report", 1.0)
        had_prediction = (out / PREDICTION).is_file()
        found.save(out)
    measured = found.measurements
    warn(line for one in measured for line in (*one.remarks, *one.doubts))
    print(table(found, truth))
    if had_prediction and not (out / PREDICTION).is_file():
        command.say(
            f"{out}: the earlier fit's prediction is gone; make it again: galileo predict {out} "
            "--seconds S"
        )
    warn(stale_documents(out, [one.observation for one in measured]))
    doubts = {doubt for one in measured for doubt in one.doubts}
    warn(line for line in found.warnings if line not in doubts)
    for line in found.taken_as_exact:
        command.say(f"note: {line}")
    pages = [out] if len(measured) == 1 else [out / one.name for one in measured]
    command.say(", ".join([f"{out}/result.json", *(f"{page}/report.html" for page in pages)]))
    return None


def table(found: "Fit", truth: Mapping[str, float]) -> str:
    """What the user asked for, in a few lines; with a column for the truth if it is known."""
    from galileo_jax.inference.per_mass import SUFFIX
    from galileo_jax.results.shown_parameters import shown_parameters

    result: Mapping[str, Any] = found.result
    shown = shown_parameters(result)
    title = f"{'':<18}{'truth' if truth else '':>10}{'mean':>10}{'sd':>10}   95 % interval"
    lines = [title] if shown else []
    for name, entry in shown.items():
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
        lines.append(
            "The model misses the data by more than noise explains: do not trust its parameters. "
            f"See where it fails: galileo compare {shlex.join(result['clips'])}"
        )
    return "\n".join(lines)


def _refuse_ignored(call: Any, argv: Sequence[str]) -> None:
    """Options of a sampler that does not run, also where they are given with their default."""
    if call.method != "mh":
        where = f"of --method mh, not of {call.method}"
        command.refuse_ignored(argv, ("--preset", "--chains", *OF_GALILEO, *OF_THESIS), where)
    elif call.preset == "thesis":
        command.refuse_ignored(argv, OF_GALILEO, "not of --preset thesis")
    else:
        command.refuse_ignored(argv, OF_THESIS, "of --preset thesis only")


def _parser() -> command.Parser:
    parser = command.Parser(prog="galileo fit", description=__doc__)
    add = parser.add_argument
    add("clips", nargs="+", metavar="CLIP", help="video, its yaml, or a csv track")
    add(
        "--method",
        choices=METHODS,
        default="grad",
        help="grad: a gradient fit, seconds; mh: it is sampled, too; cnn: a network reads it off "
        "(default %(default)s)",
    )
    add("--effects", default="", metavar="A,B", help="effects in the model (default: none)")
    add(
        "--free",
        default="",
        metavar="A,B",
        help=f"declared quantities to infer: {', '.join(entry_names(FREE))} (default: none)",
    )
    add_clip_options(parser, out="folder of the run (default runs/CLIP)")
    add(
        "--motion",
        choices=MOTIONS,
        default="planar",
        help="free: from the first hit on objects turn and tip, in MuJoCo's C engine "
        "(default %(default)s)",
    )
    add(
        "--noise",
        choices=NOISES,
        help="which errors a track is taken to have (default: as the clip was measured)",
    )
    group = parser.add_argument_group("--method mh")
    add = group.add_argument
    add("--sampler", choices=SAMPLERS, default="mixture", help="proposals (default %(default)s)")
    add(
        "--max-steps",
        type=command.whole_number(BLOCK_STEPS, BLOCK_STEPS),
        default=4000,
        metavar="N",
        help="per chain, after the warm-up (default %(default)s)",
    )
    add(
        "--chains",
        type=command.whole_number(1),
        metavar="N",
        help="how many (default 8; --preset thesis: 16)",
    )
    add(
        "--init",
        choices=INITS,
        default="grad",
        help="what chains start from: a fit, or the network (default %(default)s)",
    )
    add(
        "--preset",
        choices=PRESETS,
        default="galileo",
        help="thesis: the sampler that this project began with (default %(default)s)",
    )
    add(
        "--similarity",
        choices=SIMILARITIES,
        default="thesis_gaussian",
        help="of velocity profiles, of --preset thesis (default %(default)s)",
    )
    add(
        "--acceptance",
        choices=("coin", "metropolis"),
        default="coin",
        help="of a worse proposal, of --preset thesis (default %(default)s)",
    )
    add(
        "--selection",
        choices=("best", "least_variance"),
        default="best",
        help="how the answer is taken from the chains, of --preset thesis (default %(default)s)",
    )
    parser.examples(
        "galileo fit clip.mp4                                  seconds",
        "galileo fit clip1.mp4 clip2.mp4 --method mh           trials of the same objects, sampled",
    )
    return parser
