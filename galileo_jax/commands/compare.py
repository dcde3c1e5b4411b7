"""`galileo compare`: is the model adequate for a clip, and where does it fail?"""

from collections.abc import Sequence
from pathlib import Path

import galileo_jax as gx
from galileo_jax.commands import clip_options, command
from galileo_jax.commands.options import VerbParser
from galileo_jax.runtime.atomic_write import check_folder
from galileo_jax.runtime.errors import InputError

NUM_CELLS = 6


def main(argv: Sequence[str]) -> None:
    """Compares a model with clips, or a run with its own; writes compare.json and a page."""
    asked = _parser().asked(argv)
    sources, out = asked.pop("fit"), asked.pop("out", None)
    runs = [path for path in sources if Path(path).is_dir()]
    if runs and len(sources) > 1:
        raise InputError(f"{runs[0]}: a run is compared alone; clips are given as files")
    if runs:
        out = out or Path(runs[0]) / "compare"
        check_folder(out)
    else:
        sources = clip_options.load_clips(sources, asked.get("pixels_per_metre"))
        out = clip_options.out_folder(out, sources, "compare")
    with command.progress_display() as display:
        compared = gx.compare(runs[0] if runs else sources, **asked, on_progress=display)
        display("writing the page", 1.0)
        compared.save(out)
    clip_options.warn_of_tracks(compared.fit.measurements)
    print("\n".join(_lines(compared)))
    command.say(f"{out}/compare.json, {out}/report.html")


def _lines(compared: "gx.Comparison") -> list[str]:
    """The verdict, the worst cells and the nuisances outside their priors."""
    from galileo_jax.report.diagnosis_text import adequacy
    from galileo_jax.report.fit_text import pull_text
    from galileo_jax.report.paragraph import unseen_text

    names, record = compared.fit.names, compared.document
    several = len(names) > 1
    width = max(len(name) for name in names) + 2 if several else 0
    lines = [
        *filter(None, (adequacy(record), unseen_text(record))),
        "",
        f"{'clip' if several else '':<{width}}{'object':<10}{'axis':<6}{'phase':<11}"
        f"{'rmse':>8}{'noise':>8} m/s{'z':>7}",
    ]
    for place in record["where"][:NUM_CELLS]:
        clip = place["clip"] if several else ""
        lines.append(
            "{clip:<{width}}{object:<10}{axis:<6}{phase:<11}{rmse:>8.4f}{noise:>8.4f}"
            "{z:>11.1f}".format(**place | {"clip": clip, "width": width})
        )
    return [*lines, *map(pull_text, record["pulls"])]


def _parser() -> VerbParser:
    parser = VerbParser(
        "compare",
        __doc__,
        "galileo compare clip.mp4                              the model without effects",
        "galileo compare runs/clip                             a finished fit",
    )
    what = "video, its yaml, a csv track, or a run"
    parser.add("fit", nargs="+", metavar="CLIP|RUN", help=what)
    parser.add("effects")
    clip_options.add_clip_options(parser, out="folder (default runs/CLIP/compare, RUN/compare)")
    return parser
