"""`galileo fit`: from a clip to masses and friction coefficients."""

from collections.abc import Sequence

import galileo_jax as gx
from galileo_jax.api.options import ignored_options
from galileo_jax.commands import clip_options, command
from galileo_jax.commands.options import VerbParser, refuse, whole_number
from galileo_jax.results.truth import true_parameters
from galileo_jax.runtime.registry import entry_names

SAMPLERS = entry_names("galileo_jax.inference.samplers.library")


def main(argv: Sequence[str]) -> None:
    """Fits a clip, or several trials together, and writes a run."""
    asked = _parser().asked(argv)
    ignored, why = ignored_options(asked.get("method", "grad"), asked.get("preset", "galileo"))
    refuse(asked, ignored, why)
    clips = clip_options.load_clips(asked.pop("tracks"), asked.pop("pixels_per_metre", None))
    out = clip_options.out_folder(asked.pop("out", None), clips)
    truth = true_parameters(clips[0].path)
    with command.progress_display() as display:
        from galileo_jax.results.run import CHECKPOINT
        from galileo_jax.results.stale_outputs import PREDICTION

        found = gx.fit(clips, **asked, checkpoint=out / CHECKPOINT, on_progress=display)
        display("writing the report", 1.0)
        had_prediction = (out / PREDICTION).is_file()
        found.save(out)
    print(clip_options.fit_table(found, truth))
    if had_prediction and not (out / PREDICTION).is_file():
        command.say(
            f"{out}: the prediction of the earlier fit was removed; make it again: galileo "
            f"predict {out} --seconds S"
        )
    clip_options.notes_on(found, out)
    pages = [out] if len(found.names) == 1 else [out / name for name in found.names]
    command.say(", ".join([f"{out}/result.json", *(f"{page}/report.html" for page in pages)]))


def _parser() -> VerbParser:
    parser = VerbParser(
        "fit",
        __doc__,
        "galileo fit clip.mp4                                  seconds",
        "galileo fit clip1.mp4 clip2.mp4 --method mh           trials of the same objects, sampled",
    )
    parser.add("tracks", "method", "effects")
    free = "declared quantities to infer: gravity (default: none)"
    parser.add("free", metavar="A,B", help=free)
    clip_options.add_clip_options(parser, out="folder of the run (default runs/CLIP)")
    parser.add("discrepancy", "motion", "noise")
    add = parser.group("--method mh")
    add("sampler", choices=SAMPLERS, metavar=None)
    add("max_steps")
    add("chains", type=whole_number(1))
    add("init", "preset")
    add("similarity", "acceptance", "selection")
    return parser
