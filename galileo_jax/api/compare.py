"""`compare`: is the model adequate for the data, and where does it fail?"""

import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from galileo_jax import __version__
from galileo_jax.api.fit import EffectsLike
from galileo_jax.api.fit import fit as fit_tracks
from galileo_jax.api.fit_result import Fit, load_run
from galileo_jax.api.track import TrackLike
from galileo_jax.assembly.build_problem import with_library
from galileo_jax.comparison.compare import Comparison as Compared
from galileo_jax.comparison.compare import compare as compare_fit
from galileo_jax.comparison.compare import comparison_document
from galileo_jax.comparison.path_residuals import PathResiduals, path_residuals
from galileo_jax.diagnosis.could_not_see import unseen
from galileo_jax.diagnosis.restricted_fit import fit_among
from galileo_jax.diagnosis.stakes import VerdictStakes
from galileo_jax.diagnosis.thresholds import CONVINCING
from galileo_jax.inference.fits.gradient import SETTLED, Code, GradientFit, GradientFitter
from galileo_jax.observation.digest import digest
from galileo_jax.report.diagnosis_charts import comparison_chart
from galileo_jax.report.diagnosis_page import write_comparison_page
from galileo_jax.report.draw import to_plotly
from galileo_jax.results.command_line import command_line
from galileo_jax.results.stale_outputs import TRACKS
from galileo_jax.runtime import progress
from galileo_jax.runtime.atomic_write import write_json
from galileo_jax.runtime.errors import InputError
from galileo_jax.runtime.lazy import go, pd
from galileo_jax.runtime.precision import in_float64
from galileo_jax.search.fit import best_fit
from galileo_jax.search.hypothesis import Hypothesis

FITTED = 0.6  # share of the work, for progress


@dataclass(frozen=True, eq=False)
class Comparison:
    """A fitted model against the data.

    Attributes:
      fit: what was compared.
      gradient: the best fit.
      found: p-value, cells and residuals in full.
      document: compare.json.
      command: the command that does the same.
    """

    fit: Fit
    gradient: GradientFit
    found: Compared
    document: Mapping[str, Any]
    command: str

    @property
    def p_value(self) -> float:
        """How likely the model would be to miss the data as badly somewhere, if it were true."""
        return self.found.p_value

    @property
    def is_adequate(self) -> bool:
        """Whether the data do not contradict the model (p >= 0.01)."""
        return self.found.is_adequate

    @property
    def error(self) -> Mapping[str, float]:
        """`rmse, noise, l1, l2` of velocities, m/s, `chi2_per_dof`, `rms_mm` and its share."""
        return self.found.error

    @property
    def could_not_see(self) -> Mapping[str, Mapping[str, Any]]:
        """Of each effect that an adequate model lacks, the smallest strength that would have shown.

        `strength` (None: none that anybody expects would) and `unit`.
        """
        return self.document.get("could_not_see", {})

    @property
    def in_question(self) -> tuple[str, ...]:
        """Effects that may be missing although the model is adequate.

        From the slopes to them they would be worth what imperfections, whose sizes are free, take
        up in their place; `diagnose` fits them.
        """
        return tuple(self.document.get("in_question", ()))

    @property
    def rests_on_imperfections(self) -> bool:
        """Whether the model is adequate only where imperfections are allowed for.

        In an exact world it is e^7 times less probable: an effect may explain the motion better.
        """
        return self.document.get("rests_on_imperfections", False)

    @property
    def cells(self) -> "pd.DataFrame":
        """One row per place looked at, the worst first.

        `clip, object, axis, phase, rmse, noise` (m/s), `z` (standard deviations of what the model
        itself would give) and `whiteness` (correlation of neighbouring residuals).
        """
        return pd.DataFrame(self.document["where"])

    @in_float64
    def plot(self) -> "go.Figure":
        """Measured and fitted motion along the path, with the stretches where it fails shaded."""
        return to_plotly(comparison_chart(self.paths))

    @in_float64
    def report(self, path: str | Path) -> Path:
        """Writes the page (one HTML file, no network needed)."""
        return write_comparison_page(
            Path(path),
            ", ".join(self.fit.names),
            self.document,
            self.paths,
            [one.clip for one in self.fit.measurements],
            (self.fit.problem, self.fit.problem.theta(self.gradient.z, self.gradient.free)),
            is_adequate=self.is_adequate,
            command=self.command,
        )

    def save(self, folder: str | Path) -> Path:
        """Writes compare.json and report.html into a folder."""
        folder = Path(folder)
        self.report(folder / "report.html")
        write_json(folder / "compare.json", self.document)
        return folder

    @property
    @in_float64
    def paths(self) -> tuple[PathResiduals, ...]:
        """Of every object: motion along its path, residuals, and the stretch where it fails."""
        seed = int(self.document["seed"])
        return path_residuals(self.fit.problem, self.gradient, self.found, seed)

    def __repr__(self) -> str:
        said = "adequate" if self.is_adequate else "not adequate"
        return f"<Comparison {', '.join(self.fit.names)}: {said}, p = {self.p_value:.2g}>"

    def _repr_html_(self) -> str:
        return self.cells._repr_html_()  # pyright: ignore


@in_float64
def compare(
    fit: Fit | TrackLike | Sequence[TrackLike],
    *,
    effects: EffectsLike = (),
    effects_from: Sequence[str | Path] = (),
    engine: str = "auto",
    seed: int | None = None,
    pixels_per_metre: float | None = None,
    on_progress: progress.OnProgress | None = None,
    cancel: progress.CancelFlag | None = None,
) -> Comparison:
    """Tests a fitted model against its data, everywhere at once, with one p-value.

    Residuals are compared with those of replicates: data drawn from the fitted model and fitted
    again (parametric bootstrap), so that p is corrected for having looked in many places.

    Args:
      fit: a fit or the folder of a saved one; or tracks, clips or files, which are fitted first.
      effects: in the model of that fit, names ("a,b" or a sequence); a finished fit has its own.
      effects_from: Python files that register more effects.
      engine: what simulates the motion: "auto" (rigid), "rigid", "c" or "mjx".
      pixels_per_metre: overrides the clips' scale; None: the yaml's.
      seed: of starts and replicates; None: the fit's own, or 0.
      on_progress: called with the stage, the share done (0 to 1) and what there is of the result.
      cancel: a flag with `is_set`, such as `threading.Event`.

    Raises:
      InputError: a clip or an effect is wrong, or a `Fit` is given with another model.
      Cancelled: `cancel` was set.

    Examples:
      >>> import galileo_jax as gx
      >>> made = gx.simulate("ramp.csv", seed=1, track_only=True)
      >>> check = gx.compare(gx.fit("ramp.csv"))
      >>> check.is_adequate
      True
    """
    began = time.perf_counter()
    with progress.scope(on_progress, cancel):
        is_folder = isinstance(fit, str | Path) and Path(fit).is_dir()
        if (is_folder or isinstance(fit, Fit)) and (effects or effects_from or pixels_per_metre):
            where = fit if is_folder else ", ".join(fit.names)  # pyright: ignore
            raise InputError(
                f"{where}: a run has its own effects and scale; give its clip instead to change"
            )
        if is_folder:
            fit = load_run(fit, engine=engine)  # pyright: ignore
        if not isinstance(fit, Fit):
            with progress.part(0.0, FITTED):
                fit = fit_tracks(
                    fit,
                    effects=effects,
                    effects_from=effects_from,
                    engine=engine,
                    seed=seed or 0,
                    pixels_per_metre=pixels_per_metre,
                )
        chosen = int(fit.result["seed"]) if seed is None else seed
        model: dict[str, Any] = {}
        if not fit.folder:
            files = effects_from or fit.result.get("effects_from", ())
            model = {"effects": ",".join(fit.effects), "effects_from": tuple(files)}
        command = command_line(
            "compare",
            [fit.folder] if fit.folder else list(fit.result["clips"]),
            **model,
            engine=engine,
            seed=chosen or None,
            pixels_per_metre=pixels_per_metre,
        )
        with progress.part(FITTED, 1.0):
            return _compared(fit, chosen, command, began)


def _compared(fit: Fit, seed: int, command: str, began: float) -> Comparison:
    sizes = fit.result.get("imperfections", {})
    if fit.problem.sizes is not None and not all(one["ordinary"] for one in sizes.values()):
        # With imperfections so large the model fails nowhere; without them it is seen where.
        fit = replace(fit, problem=fit.problem.with_sizes(None), gradient=fit.exact)
    gradient = fit.gradient
    if gradient is None or seed != int(fit.result["seed"]):
        progress.report("fitting", 0.0)
        gradient = best_fit(GradientFitter(fit.problem), seed)
        if gradient.code is Code.FAILED:
            raise InputError(f"{fit.result['clips'][0]}: {gradient.code}")
    progress.report("comparing with replicates of the fitted model", 0.3)
    found = compare_fit(fit.problem, gradient, seed)
    found = replace(found, no_verdict=fit.result.get("no_verdict"))
    document: dict[str, Any] = {
        "clips": list(fit.result["clips"]),
        TRACKS: [digest(problem.observation) for problem in fit.problem.problems],
        "effects": list(fit.problem.all_effects),
        **comparison_document(found),
        **_unseen(fit, gradient, found, seed),
        "converged": gradient.code in SETTLED,
        "engine": fit.problem.problems[0].engine.name,
        "seconds": round(time.perf_counter() - began, 3),
        "version": __version__,
        "seed": seed,
    }
    made = Comparison(fit, gradient, found, document, command)
    progress.report("compared", 1.0, made)
    return made


def _unseen(fit: Fit, gradient: GradientFit, found: Compared, seed: int) -> dict[str, Any]:
    """What is left open of the library's effects, for compare.json.

    Only of a model that describes the clips, and has nothing that the library has not.
    """
    if not found.is_adequate or found.no_verdict is not None:
        return {}
    progress.report("what could not have been seen", 0.8)
    clips, seen = zip(*((one.clip, one.observation) for one in fit.measurements), strict=True)
    whole = with_library(clips, seen, fit.problem.problems[0].engine.name)
    if not set(fit.problem.names) <= set(whole.names):
        return {}
    exact, sized = whole, whole.with_sizes(fit.problem.sizes)
    last = Hypothesis(fit.effects, fit_among(gradient, fit.problem, sized))
    alone = None
    if fit.exact is not None and fit.exact.code is not Code.FAILED:
        alone = Hypothesis(fit.effects, fit_among(fit.exact, fit.problem, exact), exact)
    log_priors = VerdictStakes(sized, is_adequate=True).log_priors_beside(last)
    left = unseen(sized, last, log_priors, seed, alone)
    told = {key: value for key, value in asdict(left).items() if value}
    behind = 0.0 if alone is None else gradient.log_evidence - alone.fit.log_evidence
    return told | ({"rests_on_imperfections": True} if behind >= CONVINCING else {})
