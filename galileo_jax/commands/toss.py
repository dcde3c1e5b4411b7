"""`galileo toss`: friction, restitution and size of a cube from tosses with measured poses."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from galileo_jax.commands import command
from galileo_jax.commands.options import adder
from galileo_jax.commands.progress_display import progress_display
from galileo_jax.results.shown_digits import unit_text

if TYPE_CHECKING:
    from galileo_jax.api.fit_tosses import TossFit


def main(argv: Sequence[str]) -> int | None:
    """Fits tosses together; prints a table and writes tosses.json."""
    asked = vars(_parser().parse_args(argv))
    clips, out = asked.pop("clips"), Path(asked.pop("out") or "runs/tosses")
    from galileo_jax.api.fit_tosses import DOCUMENT, fit_tosses

    with progress_display() as display:
        found = fit_tosses(clips, **asked, on_progress=display)
    found.save(out)
    print("\n".join(_lines(found)))
    command.say(f"{out}/{DOCUMENT}")
    return None


def _lines(found: "TossFit") -> list[str]:
    """The parameters; how the second half was predicted; what did not fly."""
    lines = [f"{'':<14}{'mean':>10}{'sd':>10}   95 % interval"]
    for name, told in found.parameters.items():
        interval = f"[{told['q025']:.4g}, {told['q975']:.4g}]{unit_text(told)}"
        lines.append(f"{name:<14}{told['mean']:>10.4g}{told['sd']:>10.2g}   {interval}")
    left_out = len(found.document["clips"]) - len(found.solution.names)
    if left_out:
        lines.append(f"{left_out} without a flight before the first impact: left out")
    if not found.document["converged"]:
        lines.append("the search did not end; use a shorter --window")
    if (rest := found.document.get("second_half")) is not None:
        place = 100 * rest["median_place_over_edge"]
        lines.append(
            f"second half from the first: {place:.1f} % of the edge, "
            f"{rest['median_turn_deg']:.1f} degrees (medians over tosses of means over frames)"
        )
    return lines


def _parser() -> command.Parser:
    parser = command.Parser(prog="galileo toss", description=__doc__)
    parser.add_argument("clips", nargs="+", metavar="CLIP", help="csv of poses, or its yaml")
    add = adder(parser, "fit_tosses")
    add("window", metavar="S")
    add("ahead")
    parser.add_argument("--out", metavar="DIR", help="folder (default runs/tosses)")
    parser.examples("galileo toss tosses/*.csv --ahead")
    return parser
