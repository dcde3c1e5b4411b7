"""The residuals before and after each effect as SVG files: `galileo diagnose --svg`.

Not without being asked: importing Matplotlib and drawing two figures takes a second.
"""

from pathlib import Path

from galileo_jax.diagnosis.diagnosis import Diagnosis
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.report.diagnosis_page import before_after_charts
from galileo_jax.report.draw import to_svg
from galileo_jax.runtime.atomic_write import write_text


def write_diagnosis_plots(
    folder: Path, trials: JointProblem, diagnosis: Diagnosis, seed: int
) -> list[Path]:
    """Writes one file for each object and effect that was added; returns the files.

    Args:
      folder: made where it is not there.
      trials: of the diagnosis.
      diagnosis: the result.
      seed: of the draws in charts.
    """
    written = []
    for chart in before_after_charts(trials, diagnosis, seed):
        written.append(folder / f"{chart.name}.svg")
        write_text(written[-1], to_svg(chart))
    return written
