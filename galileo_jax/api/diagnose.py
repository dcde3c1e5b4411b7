"""`diagnose`: which physical effect is missing? Add it, and watch the error fall."""

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from html import escape
from itertools import chain
from pathlib import Path
from typing import Any

from galileo_jax import __version__
from galileo_jax.api.fit_result import Fit, Found, make_fit, resolved
from galileo_jax.api.motion import Motion, motions_at
from galileo_jax.api.track import TrackLike, as_measurements
from galileo_jax.assembly.build_problem import make_joint_problem, with_library
from galileo_jax.clip.schema import Clip
from galileo_jax.comparison.path_residuals import PathResiduals, path_residuals
from galileo_jax.diagnosis.diagnose import diagnose as run_loop
from galileo_jax.diagnosis.diagnosis import Candidate, Round, Verdict
from galileo_jax.diagnosis.diagnosis import Diagnosis as Verdicts
from galileo_jax.diagnosis.document import diagnosis_document, history_row
from galileo_jax.diagnosis.law_verdict import proposed_formula
from galileo_jax.diagnosis.laws.grammar import proposed_file
from galileo_jax.diagnosis.restricted_fit import fit_among
from galileo_jax.experiment.choose import with_next
from galileo_jax.experiment.hypothesis_probabilities import FILE, beliefs_of, write_beliefs
from galileo_jax.inference.fit_posterior import fit_posterior
from galileo_jax.inference.fits.gradient import Code, GradientFit, GradientFitter
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.measurement.measure import Measurement, inferred
from galileo_jax.model.effects.registry import effect_names, load_file
from galileo_jax.observation.digest import digest
from galileo_jax.observation.observation import Observation
from galileo_jax.report import diagnosis_text
from galileo_jax.report.diagnosis_charts import diagnosis_chart
from galileo_jax.report.diagnosis_page import before_after_charts, write_diagnosis_page
from galileo_jax.report.draw import to_plotly, write_svgs
from galileo_jax.results.command_line import command_line
from galileo_jax.results.stale_outputs import TRACKS
from galileo_jax.results.truth import hidden_effect
from galileo_jax.runtime import progress
from galileo_jax.runtime.atomic_write import write_json, write_text
from galileo_jax.runtime.errors import InputError
from galileo_jax.runtime.known_names import check_known
from galileo_jax.runtime.lazy import go, pd
from galileo_jax.runtime.precision import in_float64
from galileo_jax.search.hypothesis import Hypothesis
from galileo_jax.search.imperfect import with_imperfections

DOCUMENT = "diagnosis.json"
PLOTS = "plots"
TRACKED, ADVISED = 0.2, 0.97  # share of the work, for progress
STAGES = {  # how a stage begins, and how much is done by then
    "fitting the model": 0.02,
    "comparing it": 0.1,
    "fitting": 0.2,
    "comparing the best": 0.6,
    "fitting pairs": 0.65,
    "looking at pairs": 0.65,
    "looking at what": 0.82,
    "inferring": 0.83,
    "looking for": 0.86,
    "predicting": 0.92,
    "looking at each": 0.95,
}


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """What is missing in the model of a clip.

    Attributes:
      measurements: the clips and where their objects were.
      problem: the joint problem with every effect that has a place there.
      found: hypotheses, comparisons and the missing force in full.
      document: diagnosis.json.
      command: the command that does the same.
      effects_from: files whose effects were candidates.
    """

    measurements: tuple[Measurement, ...]
    problem: JointProblem
    found: Verdicts
    document: Mapping[str, Any]
    command: str
    effects_from: tuple[str, ...] = ()

    @property
    def verdict(self) -> Verdict:
        """`status` (none, named, ambiguous, law, unknown), `effects`, `law`, `reasons`, ..."""
        return self.found.verdict

    @property
    def sentence(self) -> str:
        """The verdict in one sentence."""
        return str(self.document["sentence"])

    @property
    def candidates(self) -> "pd.DataFrame":
        """One row per candidate, the best first.

        `effect, probability, score` (log odds over no effect, nats: `log_evidence` of the data
        and `log_prior`), `p_value`, `rmse` (m/s), `chi2_per_dof`, `score_test_z`,
        `confounded_with`.
        """
        columns = ["effect", "probability", "score", "log_evidence", "log_prior", "p_value"]
        columns += ["rmse", "chi2_per_dof", "score_test_z", "confounded_with"]
        return pd.DataFrame(self.document["candidates"], columns=columns)

    @property
    def rounds(self) -> "pd.DataFrame":
        """One row per round of the loop: how the error falls and the frictions move.

        `effects, rmse, noise` (m/s), `chi2_per_dof, p_value`, `k1, k1_sd, k2, k2_sd`.
        """
        rows = []
        for row in self.document["history"]:
            frictions = {name: row[name] for name in ("k1", "k2") if name in row}
            flat = {key: value for key, value in row.items() if key not in frictions}
            flat["effects"] = ", ".join(row["effects"]) or "none"
            for name, entry in frictions.items():
                flat |= {name: entry["mean"], f"{name}_sd": entry["sd"]}
            rows.append(flat)
        return pd.DataFrame(rows)

    @property
    def missing_force(self) -> "pd.DataFrame | None":
        """Where the verdict is unknown or a law: the missing acceleration itself, else None.

        `object, time_s, path_m, speed_m_s, acceleration_m_s2, sd_m_s2, formula` (the most
        probable one that explains the data, or that none does).
        """
        record = self.document.get("missing_force")
        if record is None:
            return None
        columns = ["object", "time_s", "path_m", "speed_m_s", "acceleration_m_s2", "sd_m_s2"]
        columns.append("formula")
        parts = [
            pd.DataFrame({"object": name, "time_s": record["time_s"], **entry}, columns=columns)
            for name, entry in record["objects"].items()
        ]
        return pd.concat(parts, ignore_index=True)

    @in_float64
    def motions(self, effect: str) -> tuple[Motion, ...]:
        """Every clip's motion as one of the candidates has it, beside the measured.

        Args:
          effect: as in `candidates`; a pair is joined by +.

        Raises:
          InputError: there is no such candidate.
        """
        hypotheses = {one.name: one.hypothesis for one in self.found.candidates}
        check_known("candidate", "candidate", effect, tuple(hypotheses))
        clips = [one.clip for one in self.measurements]
        return _motions_of(hypotheses[effect], self.problem, clips)

    @cached_property
    @in_float64
    def best(self) -> Fit:
        """The fit of the last round's model, as `fit` with its effects gives it.

        Where the verdict is unknown: with imperfections, as `fit` with `discrepancy="rough"` gives
        it, of the effects that take nearly all of the error away, or else without effects.
        """
        is_unknown, seed = self.verdict.status == "unknown", int(self.document["seed"])
        nearly, chosen = self.found.nearly, self.found.rounds[-1].hypothesis
        if is_unknown and (nearly is None or nearly.effects != chosen.effects):
            chosen = self.found.rounds[0].hypothesis
        whole = chosen.of(self.problem)
        effects = whole.problems[0].model.effects
        part = make_joint_problem(
            [one.clip for one in self.measurements],
            [one.observation for one in self.measurements],
            self.problem.problems[0].engine.name,
            tuple(effect for effect in effects if effect.name in chosen.effects),
        )
        part = part.with_sizes(whole.sizes)
        gradient = fit_among(chosen.fit, whole, part)
        if is_unknown and gradient.sizes is None:
            rough = with_imperfections(part, gradient)
            part, gradient = rough.trials, rough.fit
        posterior = fit_posterior(part, gradient, seed)
        notes = {"status": gradient.code.value}
        return make_fit(
            self.measurements,
            Found(part, posterior, gradient.z, notes, gradient),
            method="grad",
            seed=seed,
            timings=self.document["timings_s"],
            effects_from=self.effects_from,
        )

    @cached_property
    @in_float64
    def paths(self) -> tuple[tuple[PathResiduals, ...], ...]:
        """Of every round and object: motion along its path, and residuals."""
        seed = int(self.document["seed"])
        return tuple(
            path_residuals(*both, one.comparison, seed)
            for both, one in zip(self._fits, self.found.rounds, strict=True)
        )

    @property
    def _fits(self) -> list[tuple[JointProblem, GradientFit]]:
        """Of every round."""
        hypotheses = [one.hypothesis for one in self.found.rounds]
        return [(one.of(self.problem), one.fit) for one in hypotheses]

    def next_command(self, folder: str | Path = ".") -> str:
        """The command that comes next; `folder`: where the diagnosis is saved."""
        clips = list(self.document["clips"])
        return diagnosis_text.next_command(self.found, clips, self.effects_from, Path(folder))

    @in_float64
    def plot(self) -> "go.Figure":
        """The error over the rounds, and the candidates' probabilities."""
        return to_plotly(diagnosis_chart(self.document))

    @in_float64
    def report(self, path: str | Path) -> Path:
        """Writes the page (one HTML file, no network needed)."""
        clips = [one.clip for one in self.measurements]
        return write_diagnosis_page(
            Path(path),
            ", ".join(one.name for one in self.measurements),
            self.document,
            self.paths,
            clips,
            [(trials, trials.theta(fit.z, fit.free)) for trials, fit in self._fits],
            truth=hidden_effect(clips[0].path),
            command=self.command,
            next_command=self.next_command(Path(path).parent),
        )

    @in_float64
    def save(self, folder: str | Path, *, svg: bool = False) -> Path:
        """Writes diagnosis.json, report.html and, below model/, the run of the last model.

        And hypotheses.npz, of which `next_experiment` is made; where a formula explains the data
        (law, ambiguous with one, or unknown because it is not certain), its effect, too:
        proposed_effect.py, for `--effects-from`.

        Args:
          folder: made where it is not there.
          svg: also writes the residuals before and after each effect as SVG, below plots/.
        """
        folder, best = Path(folder), self.best
        proposed = folder / diagnosis_text.PROPOSED
        proposed.unlink(missing_ok=True)
        formula = proposed_formula(self.verdict, self.found.candidates)
        if formula is not None and formula.law is not None:
            clips = [Path(clip).name for clip in self.document["clips"]]
            write_text(proposed, proposed_file(formula.law, clips))
            if self.verdict.status == "law":  # the last model has it
                files = [*best.result.get("effects_from", []), str(proposed.resolve())]
                best = replace(best, result={**best.result, "effects_from": files})
        write_json(folder / DOCUMENT, self.document)
        write_beliefs(folder / FILE, self.problem, beliefs_of(self.found))
        self.report(folder / "report.html")
        if svg:
            charts = before_after_charts(self.document, self.paths).values()
            write_svgs(folder / PLOTS, chain.from_iterable(charts))
        best.save(folder / "model", report=False)
        return folder

    def __repr__(self) -> str:
        names = ", ".join(one.name for one in self.measurements)
        return f"<Diagnosis {names}: {self.sentence}>"

    def _repr_html_(self) -> str:
        table = self.rounds._repr_html_()  # pyright: ignore
        return f"<p>{escape(self.sentence)}</p>{table}"


@in_float64
def diagnose(
    tracks: TrackLike | Sequence[TrackLike],
    *,
    add: str = "auto",
    effects_from: Sequence[str | Path] = (),
    engine: str = "auto",
    seed: int = 0,
    pixels_per_metre: float | None = None,
    on_progress: progress.OnProgress | None = None,
    cancel: progress.CancelFlag | None = None,
) -> Diagnosis:
    """Asks which effect is missing, adds it, and shows how the error falls.

    Every effect of the library is fitted together with masses, frictions and nuisances; evidence
    ranks them and charges for every parameter (docs/explanation/diagnosis.md).

    Args:
      tracks: a track or several (trials of the same objects); a clip or a file is tracked first.
      add: what is added to the model: "auto": what the verdict names; "none": nothing; or the name
        of an effect.
      effects_from: Python files that register more candidates.
      engine: what simulates the motion: "auto" (rigid), "rigid", "c" or "mjx".
      seed: of all random numbers; the same seed gives the same result.
      pixels_per_metre: overrides the clips' scale; None: the yaml's.
      on_progress: called with the stage, the share done (0 to 1) and what there is of the result:
        `{"round": row}` for the base model and for what is added, as in diagnosis.json's history,
        and `{"candidate": row, "motions": function}` for each candidate as soon as it is fitted,
        and once more in the end: until then its fit may get better, and probabilities change. The
        function gives every clip's `Motion` with it, as `Diagnosis.motions` does in the end.
      cancel: a flag with `is_set`, such as `threading.Event`.

    Raises:
      InputError: a clip, an effect or an option is wrong.
      Cancelled: `cancel` was set; work stops between two batches.

    Examples:
      >>> import galileo_jax as gx
      >>> made = gx.simulate("drag.csv", seed=3, effects={"air_drag": {}}, strength=1,
      ...     track_only=True)
      >>> found = gx.diagnose("drag.csv")
      >>> found.verdict.status, found.verdict.effects
      ('named', ('air_drag',))
    """
    files = tuple(map(str, effects_from))
    for path in files:
        load_file(path)
    check_known("--add", "effect", add, ("auto", "none", *effect_names()))

    def compile_for(clips: Sequence[Clip], likely: Sequence[Observation]) -> None:
        GradientFitter(with_library(clips, likely, engine)).compile(with_races=True)

    with progress.scope(on_progress, cancel):
        with progress.part(0.0, TRACKED):
            measured, track_s = as_measurements(tracks, pixels_per_metre, compile_for)
        if scarce := [one.no_verdict for one in measured if one.no_verdict]:
            raise InputError(scarce[0])
        command = command_line(
            "diagnose",
            [one.clip.source for one in measured],
            effects_from=files,
            add=add,
            engine=engine,
            seed=seed or None,
            pixels_per_metre=pixels_per_metre,
        )
        with progress.part(TRACKED, 1.0):
            return _diagnosed(
                measured, command, engine, seed, add=add, effects_from=files, track_s=track_s
            )


def diagnose_fitted(fit: Fit, *, engine: str = "auto", seed: int = 0) -> Diagnosis:
    """As `diagnose` of a fit's tracks; the model without effects is not searched for again.

    `fit`: of that model, with the options that `fit` has where nothing is said, and this seed.
    """
    sources = [one.clip.source for one in fit.measurements]
    command = command_line("diagnose", sources, engine=engine, seed=seed or None)
    return _diagnosed(fit.measurements, command, engine, seed, before=fit)


def _diagnosed(
    measured: Sequence[Measurement],
    command: str,
    engine: str,
    seed: int,
    *,
    add: str = "auto",
    effects_from: tuple[str, ...] = (),
    track_s: float = 0.0,
    before: Fit | None = None,
) -> Diagnosis:
    """The diagnosis of tracks; `before`: a fit of them without effects, if there is one."""
    clips, observations = [one.clip for one in measured], [one.observation for one in measured]
    began = time.perf_counter()
    problem = with_library(clips, observations, engine)
    if add not in ("auto", "none", *problem.all_effects):
        raise InputError(f"--add: {add} has no place in {clips[0].path}")

    told = _Told(problem, clips, seed)
    base = None
    if before is not None and before.exact is not None:
        base = fit_among(before.exact, before.problem, problem)
    found = run_loop(
        problem,
        seed=seed,
        add=add,
        base=base,
        on_stage=told.stage,
        on_round=told.round,
        on_candidate=told.candidate,
    )
    with progress.part(max(told.share, ADVISED), 1.0):
        found = with_next(found, clips[0], problem, seed)
    document = {
        "clips": [clip.source for clip in clips],
        TRACKS: [digest(seen) for seen in observations],
        "sentence": diagnosis_text.verdict(found),
        **diagnosis_document(problem, found, seed),
        **inferred(measured),
        **({"effects_from": resolved(effects_from)} if effects_from else {}),
        "left_out": [name for name in effect_names() if name not in problem.all_effects],
        "engine": problem.problems[0].engine.name,
        "timings_s": {
            "track": round(track_s, 3),
            "diagnose": round(time.perf_counter() - began, 3),
        },
        "version": __version__,
        "seed": seed,
    }
    made = Diagnosis(tuple(measured), problem, found, document, command, effects_from)
    progress.report("diagnosed", 1.0, made)
    return made


class _Told:
    """What the caller is told while the loop runs; `share` of the work is done."""

    def __init__(self, problem: JointProblem, clips: Sequence[Clip], seed: int):
        self._problem, self._clips, self._seed = problem, clips, seed
        self._stage, self.share = "", 0.0

    def stage(self, begun: str) -> None:
        known = (done for begin, done in STAGES.items() if begun.startswith(begin))
        self._stage, self.share = begun, max([self.share, *known])
        progress.report(begun, self.share)

    def round(self, one: Round) -> None:
        if one.hypothesis.fit.code is Code.FAILED:
            raise InputError(f"{self._clips[0].path}: {one.hypothesis.fit.code}")
        row = history_row(self._problem, one, self._seed)
        progress.report("compared", self.share, {"round": row})

    def candidate(self, one: Candidate) -> None:
        row = {
            "effect": one.name,
            "score": one.log_odds,
            "probability": one.probability,
            **{key: one.error[key] for key in ("rmse", "chi2_per_dof")},
        }
        motions = partial(_motions_of, one.hypothesis, self._problem, self._clips)
        progress.report(self._stage, self.share, {"candidate": row, "motions": motions})


def _motions_of(
    hypothesis: Hypothesis, problem: JointProblem, clips: Sequence[Clip]
) -> tuple[Motion, ...]:
    """Every clip's motion as a hypothesis has it."""
    trials, fit = hypothesis.of(problem), hypothesis.fit
    return motions_at(trials, clips, trials.theta(fit.z, fit.free))
