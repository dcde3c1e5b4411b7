"""`galileo toss`: friction, restitution and size of a cube from tosses with measured poses."""

from collections.abc import Sequence
from pathlib import Path

import galileo_jax as gx
from galileo_jax.commands import command
from galileo_jax.commands.options import VerbParser
from galileo_jax.results.shown import unit_text


def main(argv: Sequence[str]) -> None:
    """Fits tosses together; prints a table and writes tosses.json."""
    asked = _parser().asked(argv)
    out = asked.pop("out", Path("runs/tosses"))
    with command.progress_display() as display:
        found = gx.fit_tosses(**asked, on_progress=display)
    found.save(out)
    print("\n".join(_lines(found)))
    command.say(f"{out}/tosses.json")


def _lines(found: "gx.TossFit") -> list[str]:
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


def _parser() -> VerbParser:
    example = "galileo toss tosses/*.csv --ahead"
    parser = VerbParser("toss", __doc__, example, function="fit_tosses")
    parser.add("clips", nargs="+", metavar="CLIP", help="csv of poses, or its yaml")
    parser.add("window", metavar="S")
    parser.add("ahead")
    parser.out("folder (default runs/tosses)")
    return parser
