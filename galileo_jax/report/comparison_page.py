"""The page of a comparison: is the model adequate, and where does it fail?"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path

import numpy as np

from galileo_jax.clip.schema import Clip
from galileo_jax.comparison.compare import Comparison
from galileo_jax.comparison.document import pulled
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.report import findings
from galileo_jax.report.along import Along
from galileo_jax.report.animation import animation
from galileo_jax.report.failure import failure_chart
from galileo_jax.report.plotly_chart import chart_element
from galileo_jax.report.provenance import provenance
from galileo_jax.report.shell import document, figure_section, header, items, table
from galileo_jax.runtime.atomic_write import write_text

NUM_CELLS = 12
PICTURES = (
    "Along the path, 0 at the foot: measured (dots) and fitted (line), place and speed; below, "
    "what is left, in units of the noise: filled along the path, hollow across it, 19 of 20 "
    "expected in the grey band. Shaded: passages between phases. Yellow: where the model fails "
    "worst."
)


@dataclass(frozen=True)
class Compared:
    """A comparison and what was compared.

    Attributes:
      comparison: what was found.
      trials: the model of the clips.
      theta: the fit, `[parameter]`.
      clips: what was fitted.
      effects: of the model.
      shown: every object along its path.
      command: that makes the page again.
      seed: of everything random.
    """

    comparison: Comparison
    trials: JointProblem
    theta: np.ndarray
    clips: tuple[Clip, ...]
    effects: tuple[str, ...]
    shown: tuple[Along, ...]
    command: str
    seed: int


def write_comparison_page(path: Path, title: str, told: Compared) -> None:
    """Writes the page of a fitted model with these effects."""
    comparison, error = told.comparison, told.comparison.error
    more = (
        f"<p>chi2 per degree of freedom {error['chi2_per_dof']:.2f}, velocity error "
        f"{error['rmse']:.4f} m/s (tracking noise {error['noise']:.4f}).</p>\n"
        f"{items(findings.pull_text(pull) for pull in pulled(comparison))}\n"
        f'<p class="soft">The model: {escape(findings.effects_text(told.effects))}.</p>'
    )
    lead = findings.adequacy(comparison, told.effects)
    sections = [
        header("comparison", title, lead, more, comparison.is_adequate),
        failures("Where it fails", told.shown),
        motion(told.clips, told.trials, {"fitted": told.theta}),
        cells(comparison, several=len(told.clips) > 1),
        provenance(
            told.command,
            told.clips,
            {"engine": told.trials.problems[0].engine.name, "seed": str(told.seed)},
        ),
    ]
    write_text(path, document(f"{title}: comparison", sections))


def motion(clips: Sequence[Clip], trials: JointProblem, theta: Mapping[str, np.ndarray]) -> str:
    """Every clip with the motion of each of `theta` `[parameter]`, by its name."""
    found = []
    for i, (clip, problem) in enumerate(zip(clips, trials.problems, strict=True)):
        predicted = {name: problem.simulate(trials.of_clip(one, i)) for name, one in theta.items()}
        if len(clips) > 1:
            found.append(f"<h3>{escape(problem.name)}</h3>")
        found.append(animation(clip, problem, predicted))
    return "<h2>Motion</h2>\n" + "\n".join(found)


def failures(heading: str, shown: Sequence[Along]) -> str:
    """Pictures of all objects."""
    charts = [failure_chart(one) for one in shown]
    pictures = {chart.name: chart_element(chart) for chart in charts}
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
