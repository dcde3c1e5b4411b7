"""`galileo compare`: is the model adequate for a clip, and where does it fail?"""

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from galileo_jax.commands import command
from galileo_jax.commands.clip_options import (
    add_clip_options,
    load_clips,
    out_folder,
    warn_of_tracks,
)
from galileo_jax.commands.options import adder
from galileo_jax.commands.progress_display import progress_display
from galileo_jax.runtime.atomic_write import check_folder
from galileo_jax.runtime.errors import InputError

if TYPE_CHECKING:
    from galileo_jax.api.compare import Comparison

NUM_CELLS = 6


def main(argv: Sequence[str]) -> int | None:
    """Compares a model with clips, or a run with its own; writes compare.json and a page."""
    asked = vars(_parser().parse_args(argv))
    sources, to = asked.pop("fit"), asked.pop("out")
    runs = [path for path in sources if Path(path).is_dir()]
    if runs and len(sources) > 1:
        raise InputError(f"{runs[0]}: a run is compared alone; clips are given as files")
    clips = [] if runs else load_clips(sources, asked["pixels_per_metre"])
    if runs:
        out = Path(to) if to else Path(runs[0]) / "compare"
        check_folder(out)
    else:
        out = out_folder(to, clips, "compare")
    from galileo_jax.api.compare import compare

    with progress_display() as display:
        compared = compare(runs[0] if runs else clips, **asked, on_progress=display)
        display("writing the page", 1.0)
        compared.save(out)
    warn_of_tracks(compared.fit.measurements)
    print("\n".join(_lines(compared)))
    command.say(f"{out}/compare.json, {out}/report.html")
    return None


def _lines(compared: "Comparison") -> list[str]:
    """The verdict, the worst cells and the nuisances outside their priors."""
    from galileo_jax.comparison.document import pulled
    from galileo_jax.report import diagnosis_text
    from galileo_jax.report.fit_text import pull_text

    names, found = compared.fit.names, compared.found
    several = len(names) > 1
    width = max(len(name) for name in names) + 2 if several else 0
    lines = [
        diagnosis_text.adequacy(found, compared.fit.problem.all_effects),
        "",
        f"{'clip' if several else '':<{width}}{'object':<10}{'axis':<6}{'phase':<11}"
        f"{'rmse':>8}{'noise':>8} m/s{'z':>7}",
    ]
    for place in found.where[:NUM_CELLS]:
        lines.append(
            f"{place.clip if several else '':<{width}}{place.object:<10}{place.axis:<6}"
            f"{place.phase:<11}{place.rmse:>8.4f}{place.noise:>8.4f}{place.z:>11.1f}"
        )
    return lines + [pull_text(asdict(pull)) for pull in pulled(found)]


def _parser() -> command.Parser:
    parser = command.Parser(prog="galileo compare", description=__doc__)
    parser.add_argument(
        "fit", nargs="+", metavar="CLIP|RUN", help="video, its yaml, a csv track, or a run"
    )
    adder(parser, "compare")("effects", metavar="A,B", help="effects in the model (default: none)")
    add_clip_options(parser, "compare", out="folder (default runs/CLIP/compare, RUN/compare)")
    parser.examples(
        "galileo compare clip.mp4                              the model without effects",
        "galileo compare runs/clip                             a finished fit",
    )
    return parser
