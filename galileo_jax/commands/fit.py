"""`galileo fit`: from a clip to masses and friction coefficients."""

from collections.abc import Sequence
from typing import get_args

from galileo_jax.api.options import Discrepancy, ignored_options
from galileo_jax.commands import command
from galileo_jax.commands.clip_options import add_clip_options, load_clips, notes_on, out_folder
from galileo_jax.commands.fit_table import table
from galileo_jax.commands.options import adder
from galileo_jax.commands.progress_display import progress_display
from galileo_jax.results.truth import true_parameters
from galileo_jax.runtime.registry import entry_names

SAMPLERS = entry_names("galileo_jax.inference.samplers.library")
FREE = ", ".join(entry_names("galileo_jax.model.effects.free"))
SIMILARITIES = entry_names("galileo_jax.thesis.similarities")


def main(argv: Sequence[str]) -> int | None:
    """Fits a clip, or several trials together, and writes a run."""
    asked = vars(_parser().parse_args(argv))
    ignored, why = ignored_options(asked["method"], asked["preset"])
    # Also where they are given with their default.
    command.refuse_ignored(argv, [f"--{name.replace('_', '-')}" for name in ignored], why)
    clips = load_clips(asked.pop("tracks"), asked.pop("pixels_per_metre"))
    out = out_folder(asked.pop("out"), clips)
    truth = true_parameters(clips[0])
    from galileo_jax.api.fit import fit
    from galileo_jax.results.run import CHECKPOINT
    from galileo_jax.results.stale_outputs import PREDICTION

    with progress_display() as display:
        found = fit(clips, **asked, checkpoint=out / CHECKPOINT, on_progress=display)
        display("writing the report", 1.0)
        had_prediction = (out / PREDICTION).is_file()
        found.save(out)
    print(table(found, truth))
    if had_prediction and not (out / PREDICTION).is_file():
        command.say(
            f"{out}: the prediction of the earlier fit was removed; make it again: galileo "
            f"predict {out} --seconds S"
        )
    notes_on(found, out)
    pages = [out] if len(found.names) == 1 else [out / name for name in found.names]
    command.say(", ".join([f"{out}/result.json", *(f"{page}/report.html" for page in pages)]))
    return None


def _parser() -> command.Parser:
    parser = command.Parser(prog="galileo fit", description=__doc__)
    parser.add_argument("tracks", nargs="+", metavar="CLIP", help="video, its yaml, or a csv track")
    add = adder(parser, "fit")
    add("method")
    add("effects", metavar="A,B", help="effects in the model (default: none)")
    add("free", metavar="A,B", help=f"declared quantities to infer: {FREE} (default: none)")
    add_clip_options(parser, "fit", out="folder of the run (default runs/CLIP)")
    add("discrepancy", choices=get_args(Discrepancy), metavar=None)
    add("motion")
    add("noise", choices=("camera", "bodies", "tracker"), metavar=None)
    add = adder(parser.add_argument_group("--method mh"), "fit")
    add("sampler", choices=SAMPLERS, metavar=None)
    add("max_steps")
    add("chains", type=command.whole_number(1))
    add("init", "preset")
    add("similarity", choices=SIMILARITIES, metavar=None)
    add("acceptance", "selection")
    parser.examples(
        "galileo fit clip.mp4                                  seconds",
        "galileo fit clip1.mp4 clip2.mp4 --method mh           trials of the same objects, sampled",
    )
    return parser
