"""`Fit`: the posterior, and tables, figures and files of it; `load_run` reads it again."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from galileo_jax.api.export import parameter_table
from galileo_jax.api.motion import Motion, motions_at, replaced
from galileo_jax.api.track_doubts import (
    as_if_rolling,
    as_in_slow_motion,
    taken_as_exact,
    with_other_angle,
    with_track_doubts,
)
from galileo_jax.inference.fits.gradient import GradientFit
from galileo_jax.inference.imperfections import imperfections
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.inference.posterior import Posterior
from galileo_jax.inference.problem import with_shared_parameters
from galileo_jax.inference.result import make_result
from galileo_jax.measurement.measure import Measurement, inferred
from galileo_jax.report.draw import to_plotly
from galileo_jax.report.fit_charts import fit_chart
from galileo_jax.report.fit_page import PAGE, write_report
from galileo_jax.results import run as runs_on_disk
from galileo_jax.results.run import (
    BEST,
    CHECKPOINT,
    CLIP,
    POSTERIOR,
    RESULT,
    Run,
    best_z,
    read_result,
    save_run,
)
from galileo_jax.results.stale_outputs import remove_single_clip_run, remove_stale_prediction
from galileo_jax.runtime.atomic_write import check_folder, write_json
from galileo_jax.runtime.errors import InputError
from galileo_jax.runtime.lazy import go, pd
from galileo_jax.runtime.precision import in_float64

if TYPE_CHECKING:
    from arviz import InferenceData


@dataclass(frozen=True, eq=False)
class Fit:
    """A finished fit of one clip, or of several trials of the same objects.

    Attributes:
      measurements: the clips and where their objects were.
      problem: the model of them.
      posterior: draws of all parameters, in their units.
      result: result.json: `parameters`, `derived`, `nuisances`, `error`, ...; the keys are in
        docs/reference/result_files.md.
      gradient: the gradient fit that the posterior came from; None where there was none.
      exact: the gradient fit in an exact world, whether or not that is what is told; None of a run
        that was read.
      folder: where the run lies; None until it is saved.
    """

    measurements: tuple[Measurement, ...]
    problem: JointProblem
    posterior: Posterior
    result: Mapping[str, Any]
    gradient: GradientFit | None = None
    exact: GradientFit | None = None
    folder: Path | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """Of the clips."""
        return tuple(one.name for one in self.measurements)

    @property
    def converged(self) -> bool:
        """Whether the search or the chains settled."""
        return bool(self.result["converged"])

    @property
    def effects(self) -> tuple[str, ...]:
        """Of the model."""
        return tuple(self.result["effects"])

    @property
    def parameters(self) -> Mapping[str, Mapping[str, Any]]:
        """By name: `mean, sd, q025, q975, unit, identified`; masses, frictions, effects."""
        return self.result["parameters"]

    @property
    def warnings(self) -> tuple[str, ...]:
        """What to know before the fit is trusted, one line each."""
        return tuple(self.result.get("warnings", ()))

    @property
    def taken_as_exact(self) -> tuple[str, ...]:
        """Of each video the marks without an uncertainty, and how much of k1 hangs on them."""
        return tuple(self.result.get("taken_as_exact", ()))

    def summary(self) -> "pd.DataFrame":
        """One row per parameter: `kind, mean, sd, q025, q975, unit, identified`.

        `identified` is False where the clip does not determine the parameter: the interval is
        then the prior's.
        """
        columns = ["kind", "mean", "sd", "q025", "q975", "unit", "identified"]
        return (
            parameter_table(self.result)
            .set_index("name")
            .rename_axis(None)
            .reindex(columns=columns)
        )

    @property
    @in_float64
    def inference_data(self) -> "InferenceData":
        """ArviZ's InferenceData, for `az.summary`, `az.plot_ppc`, `az.loo`.

        Groups posterior, prior, posterior_predictive, log_likelihood (of each measured coordinate
        given the others), observed_data and sample_stats, with units.
        """
        from galileo_jax.results.inference_data import inference_data

        return inference_data(self.problem, self.posterior, int(self.result["seed"]))

    @property
    @in_float64
    def residuals(self) -> "pd.DataFrame":
        """One row per clip, object and frame: measured minus the best fit.

        `clip, object, time_s`; `x_m, y_m` (m) without the constant distance of the followed point
        from the centre; `x_white, y_white`: the tracking errors that the fit leaves, in units of
        the stated noise (independent, standard normal if model and statement are right). NaN
        where an object was not seen.
        """
        parts = []
        for motion in self.motions():
            left = motion.measured_m - motion.predicted_m
            for k, name in enumerate(motion.objects):
                columns: dict[str, Any] = {"clip": motion.clip, "object": name}
                columns["time_s"] = motion.times_s
                columns |= {f"{axis}_m": left[k, i] for i, axis in enumerate("xy")}
                columns |= {f"{axis}_white": motion.residuals[k, i] for i, axis in enumerate("xy")}
                parts.append(pd.DataFrame(columns))
        return pd.concat(parts, ignore_index=True)

    @in_float64
    def motions(self, values: Mapping[str, float] | None = None) -> tuple[Motion, ...]:
        """Every clip's motion, measured and as the model has it; takes milliseconds.

        Args:
          values: parameters by name, in their units, that are to differ from the best fit.

        Raises:
          InputError: a name is no parameter of the model.
        """
        best = self.problem.theta(self.z_best)
        theta = replaced(self.problem, best, values)
        return motions_at(self.problem, [one.clip for one in self.measurements], theta, best)

    @property
    def z_best(self) -> np.ndarray:
        """`[parameter]`, the best fit, in the search space."""
        return best_z(self.posterior, self.folder)

    def runs(self, folder: Path) -> tuple[Run, ...]:
        """The fit of every clip, as `save` leaves it in `folder` and below."""
        if len(self.measurements) == 1:
            (one,) = self.measurements
            clip_problem = self.problem.problems[0]
            return (Run(folder, one.clip, clip_problem, self.posterior, dict(self.result)),)
        return tuple(self._alone(i, folder / one.name) for i, one in enumerate(self.measurements))

    @in_float64
    def _alone(self, index: int, folder: Path) -> Run:
        """One clip of a joint fit, with the joint posterior of its parameters."""
        one, alone = self.measurements[index], self.problem.alone(index)
        columns = self.problem.columns_of(index)
        z = self.z_best[columns]
        own = self.posterior.chosen(columns, alone.names)
        own = replace(own, provenance={**own.provenance, BEST: [float(value) for value in z]})
        result = make_result(
            alone,
            own,
            z,
            clips=[one.clip.source],
            method=str(self.result["method"]),
            seed=int(self.result["seed"]),
            timings_s=dict(self.result["timings_s"]),
            notes={key: v for key, v in self.result.items() if key not in OF_RESULT},
        )
        return Run(folder, one.clip, self.problem.problems[index], own, result)

    @in_float64
    def plot(self, clip: str | None = None) -> "go.Figure":
        """Measured and fitted velocities, with residuals in units of the noise below.

        Args:
          clip: which, by name; None: the first.

        Raises:
          InputError: no such clip.
        """
        from galileo_jax.prediction.posterior_predictive import posterior_predictive

        runs = {run.problem.name: run for run in self.runs(self.folder or Path("."))}
        if (clip := clip or self.names[0]) not in runs:
            raise InputError(f"no clip {clip!r} in this fit; known: {', '.join(runs)}")
        fitted = posterior_predictive(runs[clip], int(self.result["seed"]))
        return to_plotly(fit_chart(fitted))

    @in_float64
    def report(self, path: str | Path) -> tuple[Path, ...]:
        """Writes the page of the fit (one HTML file, no network needed).

        Args:
          path: the page; of several clips each has its own: NAME.html becomes NAME_CLIP.html.

        Returns:
          the pages.
        """
        path = Path(path)
        return write_pages(self.runs(self.folder or path.parent), path)

    @in_float64
    def save(self, folder: str | Path, *, report: bool = True) -> "Fit":
        """Writes the run: result.json, posterior.nc, observation.csv, clip.yaml, report.html.

        Of several clips each has a run of its own below `folder`, with the joint posterior. A
        prediction of an earlier fit there is removed: it is wrong now.

        Args:
          folder: made where it is not there.
          report: whether to write the pages, too.

        Returns:
          the fit, with its `folder`.
        """
        folder = Path(folder)
        check_folder(folder)
        remove_stale_prediction(folder)
        several = len(self.measurements) > 1
        if several:
            remove_single_clip_run(folder)
        for run, one in zip(self.runs(folder), self.measurements, strict=True):
            remove_stale_prediction(run.folder)
            save_run(run.folder, one.clip, one.observation, run.posterior, run.result)
            if report:
                write_report(run, run.folder / PAGE)
        if several:
            self.posterior.to_netcdf(folder / POSTERIOR)
            write_json(folder / RESULT, self.result)
        (folder / CHECKPOINT).unlink(missing_ok=True)
        return replace(self, folder=folder)

    def __repr__(self) -> str:
        shown = [
            f"{name} = {entry['mean']:.4g} +- {entry['sd']:.2g}"
            for name, entry in {**self.parameters, **self.result["derived"]}.items()
            if entry["identified"] and re.fullmatch(r"k\d+|mass_ratio", name)
        ]
        model = "+".join(self.effects) or "no effects"
        return f"<Fit {', '.join(self.names)} ({model}): {', '.join(shown)}>"

    def _repr_html_(self) -> str:
        return self.summary()._repr_html_()  # pyright: ignore


def write_pages(
    runs: Sequence[Run], path: Path, lead: str = "", beside: Mapping[str, str] | None = None
) -> tuple[Path, ...]:
    """Writes the page of each run; of several NAME.html becomes NAME_CLIP.html.

    `lead` and `beside`: as for `write_report`.
    """
    names = [path.stem if len(runs) == 1 else f"{path.stem}_{run.problem.name}" for run in runs]
    return tuple(
        write_report(run, path.with_name(f"{name}{path.suffix}"), lead, beside)
        for run, name in zip(runs, names, strict=True)
    )


def resolved(files: Sequence[str | Path]) -> list[str]:
    """The files by their whole paths, as results name them."""
    return [str(Path(path).resolve()) for path in files]


@dataclass(frozen=True)
class Found:
    """What a method found; `notes` is what else it has to say, for result.json.

    The rest as in `Fit`.
    """

    problem: JointProblem
    posterior: Posterior
    z_best: np.ndarray
    notes: Mapping[str, Any] = field(default_factory=dict)
    gradient: GradientFit | None = None
    exact: GradientFit | None = None


def make_fit(
    measurements: Sequence[Measurement],
    found: Found,
    *,
    method: str,
    seed: int,
    timings: Mapping[str, float],
    effects_from: Sequence[str] = (),
) -> Fit:
    """A `Fit` with its result.json; `effects_from`: files whose effects are in the model."""
    problem, z_best, gradient = found.problem, found.z_best, found.gradient
    stored = {**found.posterior.provenance, BEST: [float(value) for value in z_best]}
    posterior = replace(found.posterior, provenance=stored)
    notes = {"engine": problem.problems[0].engine.name, **found.notes}
    if effects_from:
        notes["effects_from"] = resolved(effects_from)
    if gradient is not None and gradient.sizes is not None:
        notes["imperfections"] = imperfections(problem, gradient.sizes, posterior)
    if doubts := [doubt for one in measurements for doubt in one.doubts]:
        notes["warnings"] = [*doubts, *notes.get("warnings", [])]
    if impossible := [one.impossible for one in measurements if one.impossible]:
        notes["impossible"] = impossible
    result = make_result(
        problem,
        posterior,
        z_best,
        clips=[one.clip.source for one in measurements],
        method=method,
        seed=seed,
        timings_s={key: round(value, 3) for key, value in timings.items()},
        notes={**notes, **inferred(measurements)},
        num_fitted=gradient.num_fitted if gradient is not None and method == "grad" else None,
    )
    result = with_track_doubts(measurements, result)
    if any(one.clip.is_scale_assumed for one in measurements):
        # Lengths are in units of something in the picture: only decelerations in these are known.
        for name, entry in result["parameters"].items():
            is_friction = re.fullmatch(r"k\d+", name) is not None
            entry["identified"] = entry["identified"] and not is_friction
    for key in ("frames_used", "frames"):
        result["error"][key] = sum(getattr(one, key) for one in measurements)
    if scarce := [one.no_verdict for one in measurements if one.no_verdict]:
        result["no_verdict"] = "; ".join(scarce)
    friction = result["parameters"].get("k1", {}).get("mean")
    at_declared = None if "ramp_angle" in result["parameters"] else friction
    asked = (with_other_angle, as_if_rolling, as_in_slow_motion)
    doubts = [doubt(one, at_declared) for doubt in asked for one in measurements]
    if others := [text for text in doubts if text is not None]:
        result["warnings"] = [*result.get("warnings", []), *others]
    if taken := [text for one in measurements if (text := taken_as_exact(one, friction))]:
        result["taken_as_exact"] = taken
    return Fit(tuple(measurements), problem, posterior, result, gradient, found.exact)


OF_RESULT = {  # what `make_result` writes by itself
    *("clips", "method", "converged", "effects", "parameters", "nuisances", "derived", "error"),
    *("timings_s", "version", "seed"),
}


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
    runs = [runs_on_disk.load_run(each, engine) for each in folders]
    posterior, result = runs[0].posterior, runs[0].result
    if is_joint:
        posterior = Posterior.from_netcdf(folder / POSTERIOR)
        result = read_result(folder)
        order = {Path(source).stem: i for i, source in enumerate(result["clips"])}
        runs.sort(key=lambda run: order.get(run.problem.name, len(order)))
    named = [replace(run.problem, name=Path(run.result["clips"][0]).stem) for run in runs]
    problem = JointProblem(with_shared_parameters(named))
    measurements = []
    for run in runs:
        source, seen = run.result["clips"][0], run.problem.observation
        # Known by the name of what was fitted, not by that of the run's own copy, clip.yaml.
        named_so = {"source": source, "path": Path(source).with_suffix(".yaml")}
        measurements.append(Measurement(run.clip.model_copy(update=named_so), seen, seen))
    return Fit(tuple(measurements), problem, posterior, result, folder=folder)
