"""Builds diagnosis.json from a diagnosis.

The keys are listed in docs/reference/result_files.md.
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from galileo_jax.comparison.compare import comparison_document
from galileo_jax.diagnosis.could_not_see import unseen
from galileo_jax.diagnosis.diagnosis import Candidate, Diagnosis, MissingForce, Round
from galileo_jax.diagnosis.each_clip import kind_of
from galileo_jax.diagnosis.friction_along_way import SHOWN, Stretch
from galileo_jax.diagnosis.law_verdict import best_formula
from galileo_jax.diagnosis.verdict import explains
from galileo_jax.inference.fit_posterior import fit_posterior, laplace_posterior
from galileo_jax.inference.imperfections import imperfections
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.inference.per_mass import SUFFIX
from galileo_jax.inference.result import IDENTIFIED_SD_Z, per_mass_entries, undetermined_by_mass
from galileo_jax.inference.summarise import entry_of
from galileo_jax.search.hypothesis import Hypothesis

Entries = dict[str, dict[str, Any]]  # by parameter

NO_FORMULA = "no formula explains it"
CALLED = {"extra_m_s2": "extra_acceleration_m_s2"}  # otherwise in the file


def diagnosis_document(trials: JointProblem, diagnosis: Diagnosis, seed: int) -> dict[str, Any]:
    """The contract's dictionary."""
    named = trials.problems[0].observation.names
    rounds = [(one, _entries(trials, one.hypothesis, seed)) for one in diagnosis.rounds]
    added = {one.hypothesis.effects: entries for one, entries in rounds}
    document = comparison_document(diagnosis.base) | {
        "probability_none": diagnosis.probability_none,
        "candidates": [
            # What was added has the strength that its round has.
            _candidate(
                c, added.get(c.effects) or _entries(trials, c.hypothesis, seed, is_rough=True)
            )
            for c in diagnosis.candidates
        ],
        "verdict": {
            "status": diagnosis.verdict.status,
            "effects": list(diagnosis.verdict.effects),
            "form": diagnosis.verdict.form,
            "law": None if diagnosis.verdict.law is None else diagnosis.verdict.law.text,
            "advice": list(diagnosis.verdict.advice),
        },
        "reasons": [
            {"rule": why.rule, "sentence": why.sentence, **why.numbers}
            for why in diagnosis.verdict.reasons
        ],
        "could_not_see": _could_not_see(trials, diagnosis, seed),
        "history": [history_row(trials, one, seed, entries) for one, (entries, _) in rounds],
    }
    last = diagnosis.rounds[-1].hypothesis
    if last.fit.sizes is not None:
        whose = last.of(trials)
        posterior = laplace_posterior(whose, last.fit, seed)
        document["imperfections"] = imperfections(whose, last.fit.sizes, posterior)
    if diagnosis.missing is not None:
        document["missing_force"] = _missing_force(diagnosis, diagnosis.missing, named)
    if diagnosis.friction:
        clips = [problem.name for problem in trials.problems]
        document["friction_along_way"] = _friction(clips, diagnosis.friction)
    if diagnosis.left_one_out:
        document["left_one_out"] = [
            {"clip": clip, "rmse_before": before, "rmse_after": after}
            for clip, before, after in diagnosis.left_one_out
        ]
    if diagnosis.each_clip:
        rows = [
            {
                CALLED.get(key, key): value.tolist() if isinstance(value, np.ndarray) else value
                for key, value in asdict(one).items()
            }
            for one in diagnosis.each_clip
        ]
        document["each_clip"] = {"kind": kind_of(diagnosis.each_clip), "clips": rows}
    return document


def _could_not_see(trials: JointProblem, diagnosis: Diagnosis, seed: int) -> Mapping[str, Any]:
    """Beside the last model, where that describes the clips."""
    last = diagnosis.rounds[-1]
    if not last.comparison.is_adequate:
        return {}
    log_priors = {
        one.effects[0]: one.log_prior
        for one in diagnosis.candidates
        if len(one.effects) == 1 and one.law is None and not one.is_form
    }
    return unseen(trials, last.hypothesis, log_priors, seed).could_not_see


def history_row(
    trials: JointProblem, one: Round, seed: int, known: Entries | None = None
) -> dict[str, Any]:
    """One round: effects, errors, p and what is said of the friction coefficients with them."""
    entries = _entries(trials, one.hypothesis, seed)[0] if known is None else known
    error = one.comparison.error
    return {
        "effects": list(one.effects),
        "imperfect": one.hypothesis.fit.sizes is not None,
        "rmse": error["rmse"],
        "noise": error["noise"],
        "chi2_per_dof": error["chi2_per_dof"],
        "p_value": one.comparison.p_value,
        **{name: entry for name, entry in entries.items() if name in ("k1", "k2")},
    }


def _entries(
    trials: JointProblem, hypothesis: Hypothesis, seed: int, is_rough: bool = False
) -> tuple[Entries, Entries]:
    """As in result.json: of what is free, nuisances left out; and the force constants per mass.

    By the posterior, or roughly by its normal approximation: of many candidates it takes seconds.
    """
    trials, fit = hypothesis.of(trials), hypothesis.fit
    posterior = (laplace_posterior if is_rough else fit_posterior)(trials, fit, seed)
    spread = np.sqrt(np.diagonal(fit.covariance))
    free = [name for i, name in enumerate(trials.names) if fit.free[i]]
    forces = {
        name: entry
        for name, entry in per_mass_entries(trials, posterior).items()
        if name.removesuffix(SUFFIX) in free
    }
    unknown = undetermined_by_mass(trials, forces)
    entries = {
        parameter.name: entry_of(
            posterior,
            posterior[parameter.name].reshape(-1),
            parameter.unit,
            bool(spread[i] < IDENTIFIED_SD_Z) and parameter.name not in unknown,
        )
        for i, parameter in enumerate(trials.parameters)
        if fit.free[i] and parameter.role != "nuisance"
    }
    return entries, forces


def _candidate(candidate: Candidate, entries: tuple[Entries, Entries]) -> dict[str, Any]:
    parameters, derived = entries
    return {
        "effect": candidate.name,
        "law": None if candidate.law is None else candidate.law.text,
        "parameters": parameters,
        "derived": derived,
        "rmse": candidate.error["rmse"],
        "chi2_per_dof": candidate.error["chi2_per_dof"],
        "score": candidate.log_odds,
        "log_evidence": candidate.log_evidence,
        "log_prior": candidate.log_prior,
        "score_test_z": candidate.score_z,
        "probability": candidate.probability,
        "p_value": candidate.p_value,
        "confounded_with": list(candidate.confounded_with),
        "unusual": list(candidate.unusual),
    }


def _missing_force(
    diagnosis: Diagnosis, missing: MissingForce, names: Sequence[str]
) -> dict[str, Any]:
    best, formula, law = best_formula(diagnosis.candidates), None, NO_FORMULA
    if best is not None:
        formula = {
            "law": best.title,
            "explains": explains(best),
            "probability": best.probability,
            "p_value": best.p_value,
            "chi2_per_dof": best.error["chi2_per_dof"],
        }
        law = best.title if explains(best) else NO_FORMULA
    whole = {"formula": law, "share_explained": diagnosis.share_explained(best)}
    curves = ("acceleration_m_s2", "sd_m_s2", "path_m", "speed_m_s")
    return {
        "time_s": missing.time_s.tolist(),
        "best_formula": formula,
        "objects": {
            name: {key: getattr(missing, key)[i].tolist() for key in curves} | whole
            for i, name in enumerate(names)
        },
    }


def _friction(clips: Sequence[str], found: Sequence[Sequence[Stretch]]) -> list[dict[str, Any]]:
    """Of each clip and body that slides, the coefficient against the way."""
    rows = []
    for clip, stretches in zip(clips, found, strict=True):
        shown = [one for one in stretches if one.steps == SHOWN]
        for name in dict.fromkeys(one.name for one in shown):
            own = sorted((o for o in shown if o.name == name), key=lambda o: o.from_m + o.to_m)
            path_m = [(one.from_m + one.to_m) / 2 for one in own]
            entry = {"clip": clip, "object": name, "path_m": path_m}
            rows.append(entry | {key: [getattr(one, key) for one in own] for key in ("mean", "sd")})
    return rows
