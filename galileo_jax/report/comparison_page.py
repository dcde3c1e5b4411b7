"""The page of a comparison: is the model adequate, and where does it fail?"""

from collections.abc import Sequence
from html import escape
from pathlib import Path

from galileo_jax.comparison.compare import Comparison
from galileo_jax.comparison.document import pulled
from galileo_jax.files import write_text
from galileo_jax.report import findings
from galileo_jax.report.along import Along
from galileo_jax.report.failure import failure_figure
from galileo_jax.report.figure import to_inline, to_svg
from galileo_jax.report.shell import document, figure_section, items, table

NUM_CELLS = 12
PICTURES = (
    "Along the path, 0 at the foot: measured (dots) and predicted (line), place and speed; below, "
    "what is left, in units of the noise: filled along the path, hollow across it, 19 of 20 "
    "expected in the grey band. Yellow: where the model fails worst."
)


def write_comparison_page(
    path: Path,
    title: str,
    effects: Sequence[str],
    comparison: Comparison,
    shown: Sequence[Along],
) -> None:
    """Writes the page of a fitted model with these effects."""
    warn = "" if comparison.is_adequate else ' class="warn"'
    error = comparison.error
    sections = [
        f'<h1>{escape(title)}</h1>\n<p class="soft">compared with the model, '
        f"{escape(findings.effects_text(effects))}</p>",
        f"<p{warn}><strong>{escape(findings.adequacy(comparison, effects))}</strong></p>",
        f"<p>chi2 per degree of freedom {error['chi2_per_dof']:.2f}, velocity error "
        f"{error['rmse']:.4f} m/s.</p>",
        items(findings.pull_text(pull) for pull in pulled(comparison)),
        failures("Where it fails", shown),
        cells(comparison, several=len({one.clip for one in shown}) > 1),
    ]
    write_text(path, document(f"{title}: comparison", sections))


def failures(heading: str, shown: Sequence[Along]) -> str:
    """Pictures of all objects."""
    pictures = {}
    for one in shown:
        name = f"{one.clip}_{one.name}"
        pictures[name] = to_inline(to_svg(failure_figure(one), name), escape(name, quote=True))
    return figure_section(heading, PICTURES, pictures)


def cells(comparison: Comparison, several: bool) -> str:
    """The worst cells as a table; `several`: with the clip of each."""
    rows = []
    for place in comparison.where[:NUM_CELLS]:
        row = [place.object, place.axis, place.phase, f"{place.rmse:.4f}", f"{place.noise:.4f}",
               f"{place.z:.1f}", f"{place.whiteness:.2f}"]  # fmt: skip
        rows.append([escape(cell) for cell in ([place.clip, *row] if several else row)])
    head = ["object", "axis", "phase", "rmse, m/s", "noise, m/s", "z", "neighbours"]
    return (
        "<h2>Worst cells</h2>\n<p>z: the largest of a cell's statistics, in standard deviations "
        "of what refitted replicates of the model give. Neighbours: correlation of neighbouring "
        "residuals, about 0 if they are noise.</p>\n"
        + table(["clip", *head] if several else head, rows)
    )
