"""Builds result.json from a fit.

The keys are listed in docs/reference/result_files.md.
"""

import math
import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from jaxtyping import Float

from galileo_jax import __version__
from galileo_jax.inference.confounded import confounded_with_gravity
from galileo_jax.inference.joint_problem import NOISE_SCALE_RANGE, JointProblem, noise_explains
from galileo_jax.inference.mass_ratios import mass_ratios
from galileo_jax.inference.per_mass import (
    SUFFIX,
    force_constants,
    is_any_weighed,
    is_mass_known,
    per_mass,
)
from galileo_jax.inference.posterior import Posterior
from galileo_jax.inference.problem import Problem
from galileo_jax.inference.summarise import entry_of
from galileo_jax.model.effects.effect import true_surroundings
from galileo_jax.model.parameters import inverse, prior_deviations
from galileo_jax.observation.observation import Observation

# In z every prior is a standard normal: above this less than half comes from the data.
IDENTIFIED_SD_Z = 0.5

SCALE_WARNING = (
    "friction and scale cannot both be determined from one clip: give --pixels-per-metre, or fit "
    "clips of several angles together"
)

FREE_SCALE_WARNING = (
    "nothing in this motion shows the scale: give --pixels-per-metre to get lengths in metres"
)

UNSHOWN = ("latent", "given")  # roles that have no entry of their own in result.json

PULLED_Z = 3.0  # of a nuisance's prior standard deviations; one in four hundred is by chance


def velocity_error(
    problems: Sequence[Problem], predicted_m: Sequence[np.ndarray]
) -> dict[str, float]:
    """How far predicted and measured velocity profiles are apart, m/s.

    rmse; noise (what the stated tracking errors alone would give); l1 (mean absolute) and l2 (root
    of the summed squares, per profile as in the thesis). `predicted_m`: of each clip `[object, 2,
    frame]`, the fitted centres.
    """
    residuals, noises = [np.zeros(0)], [np.zeros(0)]
    for problem, predicted in zip(problems, predicted_m, strict=True):
        seen = problem.observation
        residual, noise = velocity_residuals(seen, predicted)
        both = np.broadcast_to((seen.mask[:, 1:] & seen.mask[:, :-1])[:, None], residual.shape)
        axes = slice(2 if seen.is_turning else None)  # radians are no metres
        residuals.append(residual[:, axes][both[:, axes]])
        noises.append(noise[:, axes][both[:, axes]])
    values, noise = np.concatenate(residuals), np.concatenate(noises)
    if not values.size:
        return dict.fromkeys(("rmse", "noise", "l1", "l2"), float("nan"))
    return {
        "rmse": float(np.sqrt(np.mean(values**2))),
        "noise": float(np.sqrt(np.mean(noise))),
        "l1": float(np.mean(np.abs(values))),
        "l2": float(np.sqrt(np.sum(values**2))),
    }


def velocity_residuals(
    seen: Observation, predicted_m: Float[np.ndarray, "object axis frame"]
) -> tuple[Float[np.ndarray, "object axis step"], Float[np.ndarray, "object axis step"]]:
    """Measured less predicted velocities, m/s, and their variances by the stated errors alone."""
    dt, variance = np.diff(seen.times_s), seen.measured_variance_m2
    left = seen.measured_part(seen.position_m - predicted_m)
    return np.diff(left, axis=-1) / dt, (variance[..., 1:] + variance[..., :-1]) / dt**2


def distance_error(
    problems: Sequence[Problem], predicted_m: Sequence[np.ndarray]
) -> dict[str, float]:
    """How far the points that were followed are from where the fit has them.

    rms_mm: the root mean square of that distance, of all objects and frames; NaN where nobody knows
    how long a metre is. rms_percent_of_way: the same in per cent of the longest way between two
    places of an object; NaN where nothing moves. `predicted_m`: as of `velocity_error`.
    """
    squares, way_m = [np.zeros(0)], 0.0
    for problem, predicted in zip(problems, predicted_m, strict=True):
        seen = problem.observation
        axes = 2 if seen.is_turning else predicted.shape[1]
        fitted = predicted + seen.offset_m(predicted)[..., None]
        away = seen.measured_part(seen.position_m[:, : predicted.shape[1]] - fitted)
        for mask, left, own in zip(seen.mask, away[:, :axes], fitted[:, :axes], strict=True):
            if mask.any():
                own = own[:, mask]
                squares.append(np.sum(left[:, mask] ** 2, axis=0))
                way_m = max(way_m, float(np.linalg.norm(np.ptp(own, axis=1))))
    of_all = np.concatenate(squares)
    rms_m = float(np.sqrt(np.mean(of_all))) if of_all.size else math.nan
    is_known = all(p.model.scene.surroundings.is_scale_known for p in problems)
    return {
        "rms_mm": 1e3 * rms_m if is_known else math.nan,
        "rms_percent_of_way": 100 * rms_m / way_m if way_m > rms_m else math.nan,
    }


def error_of(
    trials: JointProblem,
    theta: np.ndarray,
    num_fitted: float,
    pull: float = 0.0,
    is_usual: bool = True,
) -> dict[str, float]:
    """Errors of places and velocities, and chi2 per degree of freedom, at `theta` `[parameter]`.

    The same in result.json, compare.json and diagnosis.json: what the model leaves over, in
    units of the noise that the tracker states, which is the same for every model of a track.

    `num_fitted`: how many numbers' worth the parameters were fitted with, nuisances left out.
    `pull`: of the nuisances, which are data, too: the sum of their squared `prior_deviations`.
    `is_usual`: see `Problem.followed`.
    """
    predictions, chi2, count = [], pull, 0.0
    for problem, predicted in zip(trials.problems, trials.simulate(theta), strict=True):
        chi2 += float(np.sum(problem.tracking_errors(predicted) ** 2))
        count += float(problem.data.degrees(1.0))
        predictions.append(problem.followed(predicted, is_usual))
    error = velocity_error(trials.problems, predictions)
    error |= distance_error(trials.problems, predictions)
    degrees = max(count - num_fitted, 1.0)
    error["chi2_per_dof"] = chi2 / degrees
    error["explained_by_noise"] = noise_explains(chi2, degrees, NOISE_SCALE_RANGE[1])
    return error


def per_mass_entries(trials: JointProblem, posterior: Posterior) -> dict[str, dict[str, Any]]:
    """Entries of the force constants over m1, by name; empty where the mass is known."""
    draws = posterior.flat()
    if not force_constants(trials) or is_mass_known(trials, draws):
        return {}
    return _told(posterior, per_mass(trials, draws), per_mass(trials, trials.prior_draws))


def _told(
    posterior: Posterior,
    after: Mapping[str, tuple[np.ndarray, str]],
    before: Mapping[str, tuple[np.ndarray, str]],
) -> dict[str, dict[str, Any]]:
    """Entries of derived quantities by their draws and units, after the data and before."""
    return {
        name: entry_of(posterior, values, unit, _is_told(values, before[name][0]))
        for name, (values, unit) in after.items()
    }


def undetermined_by_mass(trials: JointProblem, forces: Mapping[str, Any]) -> set[str]:
    """Masses that nothing determines, and the constants of `forces`, known per mass only.

    Several masses tied by their ratios share what the prior says, which looks like knowledge.
    """
    names = {name.removesuffix(SUFFIX) for name in forces}
    if not is_any_weighed(trials):
        names |= {name for name in trials.names if re.fullmatch(r"m\d+", name)}
    return names


def _is_told(after: np.ndarray, before: np.ndarray) -> bool:
    """Whether draws are much narrower than those of the priors; of what is positive, in ratio."""
    if before.min() > 0 and after.min() > 0:
        after, before = np.log(after), np.log(before)
    # Of the central two thirds of draws.
    width, of_prior = (np.diff(np.quantile(draws, [0.16, 0.84]))[0] for draws in (after, before))
    return bool(width < IDENTIFIED_SD_Z * of_prior)


def _derived_by_laws(trials: JointProblem, posterior: Posterior) -> dict[str, dict[str, Any]]:
    """What the models' laws derive from draws of one clip's parameters."""
    if len(trials.problems) != 1:
        return {}
    model = trials.problems[0].model
    effects = model.effects + model.nuisances

    def by_name(rows: np.ndarray) -> dict[str, tuple[np.ndarray, str]]:
        found: dict[str, tuple[np.ndarray, str]] = {}
        named = model.by_name(rows)
        scene = true_surroundings(effects, named, model.scene.surroundings)
        for effect in effects:
            for name, (values, unit) in effect.derived(named, scene).items():
                found[name] = np.asarray(values), unit
        return found

    return _told(posterior, by_name(posterior.flat()), by_name(trials.prior_draws))


def make_result(
    trials: JointProblem,
    posterior: Posterior,
    z_best: np.ndarray,
    *,
    clips: list[str],
    method: str,
    seed: int,
    timings_s: dict[str, float],
    notes: dict[str, Any],
    num_fitted: float | None = None,
) -> dict[str, Any]:
    """The contract's dictionary.

    `z_best`: `[parameter]`, the mode in z, noise scale last; errors are stated at it. `method`:
    "grad", "mh" or "cnn". `notes`: what else the method has to say ("engine", "status", warnings).
    `num_fitted`: as of `error_of`; None: as the draws have it.
    """
    spread = inverse(trials.parameters, np.asarray(posterior.flat())).std(axis=0)
    table = _entries(trials, posterior, spread)
    forces = per_mass_entries(trials, posterior)
    untold, reason = _untold(table["parameters"], trials)
    for name in undetermined_by_mass(trials, forces) | untold:
        if name in table["parameters"]:
            table["parameters"][name]["identified"] = False
    if reason is not None:
        said = [*notes.get("warnings", []), reason]
        notes = notes | {"warnings": list(dict.fromkeys(said))}
    # Every parameter takes from the residuals what the data say of it.
    is_fitted = np.array([p.role not in ("nuisance", "given") for p in trials.model_parameters])
    share_from_data = 1 - np.clip(spread[: len(is_fitted)] ** 2, 0, 1)
    away = prior_deviations(trials.model_parameters, z_best[: len(is_fitted)])
    theta = trials.theta(z_best)
    if num_fitted is None:
        num_fitted = float(np.sum(share_from_data[is_fitted]))
    pull = float(np.sum(away**2))
    # Nuisances that are far from what is expected, the farthest first.
    pulls = [
        {"parameter": p.name, "value": float(theta[i]), "unit": p.unit, "z": float(away[i])}
        for i, p in enumerate(trials.model_parameters)
        if abs(away[i]) > PULLED_Z
    ]
    return {
        "clips": clips,
        "method": method,
        "converged": posterior.is_converged,
        **notes,
        "effects": list(trials.all_effects),
        **table,
        "derived": _ratios(trials, posterior) | _derived_by_laws(trials, posterior) | forces,
        "pulls": sorted(pulls, key=lambda pull: -abs(pull["z"])),
        "error": error_of(trials, theta, num_fitted, pull),
        "timings_s": timings_s,
        "version": __version__,
        "seed": seed,
    }


def _entries(
    trials: JointProblem, posterior: Posterior, spread: np.ndarray
) -> dict[str, dict[str, dict[str, Any]]]:
    """Of parameters and nuisances; `spread`: `[parameter]`, sds of the draws in z."""
    table: dict[str, dict[str, dict[str, Any]]] = {"parameters": {}, "nuisances": {}}
    for parameter, draws, sd in zip(trials.parameters, posterior.flat().T, spread, strict=True):
        if parameter.role not in UNSHOWN:
            room = "nuisances" if parameter.role == "nuisance" else "parameters"
            entry = entry_of(posterior, draws, parameter.unit, bool(sd < IDENTIFIED_SD_Z))
            table[room][parameter.name] = entry
    return table


def _ratios(trials: JointProblem, posterior: Posterior) -> dict[str, dict[str, Any]]:
    """Entries of the masses' ratios."""
    masses = [name for name in posterior.names if re.fullmatch(r"m\d+", name)]
    ratios = mass_ratios([posterior[name].reshape(-1) for name in masses])
    derived = {}
    for name, values in ratios.items():
        # Of two masses that nothing determines but what is declared of them.
        pair = re.findall(r"\d+", name) or ["1", "2"]
        priors = [trials.parameters[trials.names.index(f"m{number}")].prior for number in pair]
        prior_sd = float(np.hypot(*(prior.sd for prior in priors)))  # pyright: ignore
        logs = np.log(ratios["mass_ratio"] if name == "phi" else values)
        is_identified = bool(logs.std() < IDENTIFIED_SD_Z * prior_sd)
        derived[name] = entry_of(posterior, values, "1", is_identified)
    return derived


def _untold(
    parameters: dict[str, dict[str, Any]], trials: JointProblem
) -> tuple[set[str], str | None]:
    """Parameters that others make up for, and why: a line for the user, or None."""
    has_surface = trials.problems[0].model.scene.surroundings.has_surface
    confounded, reason = confounded_with_gravity(parameters, has_surface)
    is_scaled = parameters.get("pixels_per_metre", {}).get("identified", True)
    if reason is not None or is_scaled:
        return confounded, reason
    # Lengths in pixels tell the scale times (sin a - k cos a), and neither alone.
    frictions = {name for name in parameters if re.fullmatch(r"k\d+", name)}
    return confounded | frictions, SCALE_WARNING if has_surface else FREE_SCALE_WARNING
