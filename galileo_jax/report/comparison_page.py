"""The page of a comparison: is the model adequate, and where does it fail?"""

from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from galileo_jax.clip.schema import Clip
from galileo_jax.comparison.path_residuals import PathResiduals
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.report import diagnosis_text
from galileo_jax.report import html_page as html
from galileo_jax.report.animation import animation
from galileo_jax.report.diagnosis_charts import failure_chart
from galileo_jax.report.fit_text import error_text, pull_text
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
    record: Mapping[str, Any],
    paths: Sequence[PathResiduals],
    clips: Sequence[Clip],
    model: tuple[JointProblem, np.ndarray],
    *,
    is_adequate: bool,
    command: str,
) -> Path:
    """Writes the page and returns its path.

    `record`: compare.json. `paths`: the objects' along their paths. `model`: with its parameters,
    as for `motion`. `command` makes the page again.
    """
    left = f"{error_text(record['error'])}."
    pulls = html.items(map(pull_text, record["pulls"]))
    effects = html.prose(f"The model: {diagnosis_text.effects_text(record['effects'])}.", "soft")
    sections = [
        failures(is_adequate, paths),
        motion(clips, {"fitted": model}),
        cells(record["where"], several=len(clips) > 1),
        provenance(command, clips, engine_and_seed(record)),
    ]
    more = f"{html.prose(left)}\n{pulls}\n{effects}"
    lead = diagnosis_text.adequacy(record)
    return html.write_page(path, "comparison", title, lead, sections, more, is_adequate)


def engine_and_seed(record: Mapping[str, Any]) -> dict[str, str]:
    """What a page's provenance says of how it was computed."""
    return {key: str(record[key]) for key in ("engine", "seed")}


def motion(clips: Sequence[Clip], models: Mapping[str, tuple[JointProblem, np.ndarray]]) -> str:
    """Every clip with the motion of each model with its parameters `[parameter]`, by its name."""
    found = []
    for i, clip in enumerate(clips):
        predicted = {
            name: trials.problems[i].simulate(trials.of_clip(theta, i))
            for name, (trials, theta) in models.items()
        }
        problem = next(iter(models.values()))[0].problems[i]
        if len(clips) > 1:
            found.append(f"<h3>{escape(problem.name)}</h3>")
        found.append(animation(clip, problem, predicted))
    return html.section("Motion", *found)


def failures(is_adequate: bool, paths: Sequence[PathResiduals], model: str = "") -> str:
    """The charts of all objects; `model`: with its colon before it, for the heading."""
    heading = "Residuals" if is_adequate else "Where the model fails"
    return html.chart_section(f"{heading}{model}", FAILURES, map(failure_chart, paths))


def cells(where: Sequence[Mapping[str, Any]], several: bool) -> str:
    """The worst cells as a table; `several`: with the clip of each."""
    words = ["clip"] * several + ["object", "axis", "phase"]
    numbers = {"rmse": ".4f", "noise": ".4f", "z": ".1f", "whiteness": ".2f"}
    rows = [
        [*(place[key] for key in words), *(f"{place[key]:{how}}" for key, how in numbers.items())]
        for place in where[:NUM_CELLS]
    ]
    head = [*words, "rmse, m/s", "noise, m/s", "z", "autocorrelation"]
    return html.section("Worst cells", html.prose(CELLS), html.table(head, rows))
