"""`load_run`: a fit that was saved."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np

from galileo_jax.api.fit_result import Fit
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.inference.posterior import Posterior
from galileo_jax.inference.problem import with_shared_parameters
from galileo_jax.measurement.measure import Measurement
from galileo_jax.results.run import BEST, CLIP, POSTERIOR, RESULT, Run
from galileo_jax.results.run import load_run as read_run
from galileo_jax.runtime.precision import in_float64


@in_float64
def load_run(folder: str | Path, *, engine: str = "auto") -> Fit:
    """Loads what `Fit.save` or `galileo fit` left in a folder.

    Args:
      folder: of the run; of several clips the folder above theirs.
      engine: that rolls out from now on.

    Raises:
      InputError: no such run, or a file of it is damaged; names the file.

    Examples:
      >>> import galileo_jax as gx
      >>> made = gx.simulate("slide.csv", scenario="incline", seed=1, track_only=True)
      >>> saved = gx.fit("slide.csv").save("runs/slide")
      >>> gx.load_run("runs/slide").parameters["k1"] == saved.parameters["k1"]
      True
    """
    folder = Path(folder)
    folders = [folder]
    is_joint = (folder / RESULT).is_file() and not (folder / CLIP).is_file()
    if is_joint:
        folders = sorted(path.parent for path in folder.glob(f"*/{CLIP}")) or [folder]
    runs = [read_run(each, engine) for each in folders]
    posterior, result = runs[0].posterior, runs[0].result
    if is_joint:
        posterior = Posterior.from_netcdf(folder / POSTERIOR)
        result = json.loads((folder / RESULT).read_text(encoding="utf-8"))
        order = {Path(source).stem: i for i, source in enumerate(result["clips"])}
        runs.sort(key=lambda run: order.get(run.problem.name, len(order)))
    named = [replace(run.problem, name=Path(run.result["clips"][0]).stem) for run in runs]
    problem = JointProblem(with_shared_parameters(named))
    measurements = tuple(_measured(run) for run in runs)
    best = posterior.provenance.get(BEST)
    z_best = None if best is None else np.array(best)
    return Fit(measurements, problem, posterior, result, z_best, folder=folder)


def _measured(run: Run) -> Measurement:
    source = run.result["clips"][0]
    # Known by the name of what was fitted, not by that of the run's own copy, clip.yaml.
    path = Path(source).with_suffix(".yaml")
    clip = run.clip.model_copy(update={"source": source, "path": path})
    return Measurement(clip, run.problem.observation, run.problem.observation)
