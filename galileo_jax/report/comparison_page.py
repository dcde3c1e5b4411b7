"""The page of a comparison: is the model adequate, and where does it fail?"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from html import escape
from pathlib import Path
from types import MappingProxyType

import numpy as np

from galileo_jax.clip.schema import Clip
from galileo_jax.comparison.compare import Comparison, pulled
from galileo_jax.comparison.path_residuals import PathResiduals, path_residuals
from galileo_jax.inference.fits.gradient import GradientFit
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.report import diagnosis_text
from galileo_jax.report import html_page as html
from galileo_jax.report.animation import animation
from galileo_jax.report.diagnosis_charts import failure_chart
from galileo_jax.report.fit_text import pull_text
from galileo_jax.report.provenance import provenance

NUM_CELLS = 12
FAILURES = (
    "Position and speed along the path, 0 at the foot: measured (dots) and fitted (line). Below, "
    "the residuals in units of the stated noise: filled along the path, hollow across it; 95 % of "
    "noise is inside the grey band. Grey: transitions between phases. Yellow, where the model "
    "fails: the worst interval."
)
CELLS = (
    "A cell is one object, axis and phase of the motion. z: the largest of its test statistics, in "
    "standard deviations over data simulated with the fitted model. Autocorrelation: of "
    "neighbouring residuals, about 0 for noise."
)


def write_comparison_page(
    path: Path,
    title: str,
    comparison: Comparison,
    trials: JointProblem,
    fit: GradientFit,
    clips: Sequence[Clip],
    effects: Sequence[str],
    *,
    command: str,
    seed: int,
) -> None:
    """Writes the page of a fitted model with these effects; `command` makes it again."""
    error = comparison.error
    paths = path_residuals(trials, fit, comparison, seed)
    left = (
        f"chi2 per degree of freedom {error['chi2_per_dof']:.2f}, velocity error "
        f"{error['rmse']:.4f} m/s (tracking noise {error['noise']:.4f})."
    )
    pulls = html.items(pull_text(asdict(pull)) for pull in pulled(comparison))
    model = html.prose(f"The model: {diagnosis_text.effects_text(effects)}.", "soft")
    sections = [
        failures(comparison, paths),
        motion(clips, trials, {"fitted": trials.theta(fit.z, fit.free)}),
        cells(comparison, several=len(clips) > 1),
        provenance(command, clips, engine_and_seed(trials, seed)),
    ]
    more = f"{html.prose(left)}\n{pulls}\n{model}"
    lead = diagnosis_text.adequacy(comparison, effects)
    html.write_page(path, "comparison", title, lead, sections, more, comparison.is_adequate)


def engine_and_seed(trials: JointProblem, seed: int) -> dict[str, str]:
    """What a page's provenance says of how it was computed."""
    return {"engine": trials.problems[0].engine.name, "seed": str(seed)}


def motion(
    clips: Sequence[Clip],
    trials: JointProblem,
    theta: Mapping[str, np.ndarray],
    others: Mapping[str, JointProblem] = MappingProxyType({}),
) -> str:
    """Every clip with the motion of each of `theta` `[parameter]`, by its name.

    `others`: the trials of those that have another model.
    """
    found = []
    for i, (clip, problem) in enumerate(zip(clips, trials.problems, strict=True)):
        predicted = {}
        for name, one in theta.items():
            own = others.get(name, trials)
            predicted[name] = own.problems[i].simulate(own.of_clip(one, i))
        if len(clips) > 1:
            found.append(f"<h3>{escape(problem.name)}</h3>")
        found.append(animation(clip, problem, predicted))
    return html.section("Motion", *found)


def failures(comparison: Comparison, paths: Sequence[PathResiduals], model: str = "") -> str:
    """The charts of all objects; `model`: with its colon before it, for the heading."""
    heading = "Residuals" if comparison.is_adequate else "Where the model fails"
    return html.chart_section(f"{heading}{model}", FAILURES, map(failure_chart, paths))


def cells(comparison: Comparison, several: bool) -> str:
    """The worst cells as a table; `several`: with the clip of each."""
    rows = []
    for place in comparison.where[:NUM_CELLS]:
        row = [place.object, place.axis, place.phase, f"{place.rmse:.4f}", f"{place.noise:.4f}",
               f"{place.z:.1f}", f"{place.whiteness:.2f}"]  # fmt: skip
        rows.append([place.clip, *row] if several else row)
    head = ["object", "axis", "phase", "rmse, m/s", "noise, m/s", "z", "autocorrelation"]
    found = html.table(["clip", *head] if several else head, rows)
    return html.section("Worst cells", html.prose(CELLS), found)
