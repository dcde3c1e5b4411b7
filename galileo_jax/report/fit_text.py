"""The results of a fit as sentences: its quality, and why a parameter is not determined."""

import math
import re
import shlex
from collections.abc import Mapping
from typing import Any

from galileo_jax.inference.confounded import confounded_with_gravity
from galileo_jax.inference.per_mass import SUFFIX
from galileo_jax.prediction.posterior_predictive import PosteriorPredictive
from galileo_jax.report.phrases import sentence, two_figures
from galileo_jax.results.command_line import command_line
from galileo_jax.results.run import CLIP, Run
from galileo_jax.results.shown import shown_parameters, unit_text

MEANINGS = {  # by name; of those with a number in them, by pattern
    r"m(\d+)": "mass of object {}",
    r"k(\d+)": "friction coefficient of object {}",
    r"mass_ratio_(\d+)_(\d+)": "m{} / m{}",
    "mass_ratio": "m1 / m2",
    "phi": "(m1 - m2) / (m1 + m2)",
    "pixels_per_metre": "scale of the picture",
    "gravity": "acceleration of free fall",
    "start_velocity_x": "velocity at the start, along the travel",
    "start_velocity_y": "velocity at the start, upward",
    "start_speed": "speed at the start",
    "start_angle": "angle at the start",
    "floor_restitution": "share of the speed left after a bounce",
    "floor_height": "height of the centre at a bounce",
    "floor_grip": "share of the speed along the floor that is lost in a bounce",
    "wall_restitution": "share of the speed against a wall left after a bounce",
    "wall_grip": "most of the impulse along a wall, over that against it",
    r"wall_offset_from(\d+)": "first end of wall {}, to the left of where it is declared",
    r"wall_offset_to(\d+)": "second end of wall {}, to the left of where it is declared",
    "period": "period of the swing without damping",
    "damping": "rate at which the swing dies away",
    "rest": "position of rest, from the first frame's, downward where it hangs",
    "stiffness": "stiffness of the spring",
    "stretch": "stretch of the spring by the weight alone where it hangs",
    "density_ratio": "density of the liquid over the object's",
    "liquid_drag": "drag constant c of c v|v|",
    "terminal_speed": "speed at which drag and weight balance",
    "declared_angle": "angle of the ramp or the vertical, minus the declared one",
    "declared_scale": "relative error of the scale: lengths are measured too long by this share",
    "foot_transition": "factor on the speed after the foot of the ramp",
    "impact_restitution": "share of the closing speed left after the impact",
    r"impact_momentum_object(\d+)": (
        "momentum that object {} gains in its hit, over what is lost to it"
    ),
    "contact_gap": "by how much further apart the objects are when they touch again",
    "release_instant": "time of the release after the first frame",
    r"start_offset_object(\d+)": "start of object {}, from where it was marked",
    "noise_scale": "tracking noise divided by the stated one",
}
OUTSIDE = {  # what nuisances mean that are far from what is usual
    "impact_restitution": "the objects bounce, with a restitution of {value:.2f}",
    "foot_transition": "the foot of the ramp multiplies the speed by {value:.3f}",
    r"release_instant(?:_\d+)?": "object 1 is released {size:.0f} ms {side} the first frame",
    r"start_offset_object(\d+)(?:_\d+)?": "object {} starts {size:.1f} mm from where it was marked",
}
FORCES = ("liquid_drag", "stiffness")  # known as far as the mass is
CHI2_GOOD = 0.7
TOLD_FACTOR = 10.0  # an interval that spans more tells no size
TOLD_SHARE = 0.1  # of what is left, root mean square
SMALL = 0.01  # of a metre or a second: smaller sizes are said in thousandths
# Residuals of the noise's size may still follow a pattern that noise does not have.
PATTERNS = "galileo compare tests whether it has a pattern"


def meaning(name: str) -> str | None:
    """What a parameter is, in a phrase; None where its name says it (effects)."""
    if name.endswith(SUFFIX):
        return f"{name.removesuffix(SUFFIX)} / m1"
    return _phrase(MEANINGS, name)


def _phrase(phrases: Mapping[str, str], name: str, **values: object) -> str | None:
    for pattern, phrase in phrases.items():
        if found := re.fullmatch(pattern, name):
            return phrase.format(*found.groups(), **values)
    return None


def undetermined(run: Run, fitted: PosteriorPredictive) -> dict[str, str]:
    """Why the clip does not determine a main parameter, by the name of each such parameter."""
    return {
        name: _reason(name, run, fitted)
        for name, entry in shown_parameters(run.result).items()
        if not entry["identified"] and name != "phi"
    }


def _reason(name: str, run: Run, fitted: PosteriorPredictive) -> str:
    surroundings = run.problem.model.scene.surroundings
    derived, count = run.result.get("derived", {}), len(surroundings.names)
    ratios = [entry for key, entry in derived.items() if key.startswith("mass_ratio")]
    if not fitted.moves.any():
        limit = math.tan(surroundings.angle_rad)
        if name == "k1":
            return f"nothing moves, so k1 is at least tan(angle) = {limit:.3f}; no more is known"
        return "nothing moves"
    confounded, reason = confounded_with_gravity(run.result["parameters"], surroundings.has_surface)
    if reason is not None and name in confounded:
        return reason
    if re.fullmatch(r"m\d+", name):
        if run.clip.objects[int(name[1:]) - 1].mass_kg is not None:
            return "its declared mass; the motion does not depend on it"
        if count < 2:
            return "the motion of a single object does not depend on its mass"
        if any(ratio["identified"] for ratio in ratios):
            every, more = ("ratio", "both") if count == 2 else ("ratios", "all")
            return (
                f"only the {every} of the masses can be determined from such a clip; "
                f"doubling {more} leaves the motion the same"
            )
        return "only a collision depends on masses, and only on their ratio"
    if f"{name}{SUFFIX}" in derived:
        return f"only its ratio to the mass is determined ({name}{SUFFIX}); declare mass_kg"
    if name in FORCES and run.clip.objects[0].mass_kg is None:
        return "only its ratio to the mass is determined; declare mass_kg"
    if name == "pixels_per_metre":
        if not surroundings.has_surface:
            return "this motion is the same at any scale"
        return (
            "a single slope determines only scale * (sin a - k1 cos a); "
            "declare pixels_per_metre to get the friction"
        )
    if name == "k1" and not surroundings.is_scale_known:
        return "a single slope cannot determine both friction and scale; declare pixels_per_metre"
    if struck := _struck(name):
        if fitted.hits_s[struck - 2] is None:
            return f"object {struck - 1} never hits object {struck}"
        return f"object {struck} is hit too weakly or too late in the clip"
    return "its posterior standard deviation is more than half of the prior's"


def _struck(name: str) -> int | None:
    """The object, counted from 1, that has to be hit for a parameter to be determined."""
    if name == "mass_ratio":
        return 2
    found = re.fullmatch(r"k(\d+)|mass_ratio_\d+_(\d+)", name)
    struck = int(found[1] or found[2]) if found else 1
    return struck if struck > 1 else None


def nearness(error: Mapping[str, Any]) -> list[str]:
    """How near the fit comes to what was seen: in mm, and as a share of the way, where known."""
    units = {"rms_mm": "mm", "rms_percent_of_way": "% of the way"}
    known = {unit: error.get(key) for key, unit in units.items()}  # None in a file, NaN before
    return [f"{two_figures(size)} {unit}" for unit, size in known.items() if size and size == size]


def distance_text(error: Mapping[str, Any]) -> str:
    """How near the fit comes to what was seen, and in how many frames; empty where unknown."""
    sizes = " or ".join(nearness(error))
    frames = f"{error['frames_used']} of {error['frames']} frames" if error.get("frames") else ""
    if not sizes:
        return f"The fit uses {frames}." if frames else ""
    said = f"The fit is {sizes} off (root mean square)"
    return f"{said}, in {frames}." if frames else f"{said}."


def fit_quality(result: Mapping[str, Any], is_asked: bool = False) -> list[str]:
    """How near the fit comes, what it leaves, and what to do where that is too much: sentences.

    `is_asked`: whether what is missing has been asked already.
    """
    near = distance_text(result["error"])
    said = [near] if near else []
    if "imperfections" in result:
        said += imperfection_text(result["imperfections"], result["error"])
    elif not result.get("no_verdict"):
        said.append(_of_chi2(result["error"]))
    said += map(pull_text, result.get("pulls", []))
    if result.get("no_verdict"):
        return [*said, f"{result['no_verdict']}."]
    if fits(result) or is_asked:
        return said
    words = shlex.join(result["clips"])
    return [
        *said,
        f"See where it fails: galileo compare {words}; find what is missing: galileo diagnose "
        f"{words}",
    ]


def imperfection_text(found: Mapping[str, Any], error: Mapping[str, Any]) -> list[str]:
    """What of imperfections shows, and whether it is usual: a sentence for each.

    `error`: of result.json. An error of the marks that is far less than what is left says nothing.
    """
    said, least_m = [], TOLD_SHARE * 1e-3 * (error.get("rms_mm") or 0.0)
    for entry in found.values():
        shows = entry["q975"] < TOLD_FACTOR * entry["q025"]
        shows &= entry["unit"] != "m" or entry["mean"] > least_m
        if shows or not entry["ordinary"]:
            size = _size_text(entry["mean"], unit_text(entry))
            usual = "as is usual" if entry["ordinary"] else "which is more than usual"
            said.append(sentence(f"{entry['meaning'].format(size=size)}, {usual}"))
    return said


def _size_text(size: float, unit: str) -> str:
    """A size with its unit; of a metre or a second, where it is small, in thousandths."""
    is_small = unit in (" m", " s") and size < SMALL
    return f"{1e3 * size:.2g} m{unit[1:]}" if is_small else f"{size:.2g}{unit}"


def chi2_text(error: Mapping[str, Any]) -> str:
    """What the fit leaves over what noise of the stated size would, as a number."""
    chi2 = error["chi2_per_dof"]
    return f"chi2 per degree of freedom {chi2:.2f}" if _is_known(chi2) else "chi2 not known"


def _is_known(value: float | None) -> bool:
    return value is not None and math.isfinite(value)


def error_text(error: Mapping[str, Any]) -> str:
    """What the fit leaves, as numbers: chi2, and the velocity error beside that of noise.

    No two frames that follow each other may be seen; then there is no velocity.
    """
    if not _is_known(error["rmse"]):
        return chi2_text(error)
    return (
        f"{chi2_text(error)}, velocity error {error['rmse']:.4f} m/s (tracking noise "
        f"{error['noise']:.4f})"
    )


def _of_chi2(error: Mapping[str, Any]) -> str:
    """The same in a sentence."""
    chi2 = error["chi2_per_dof"]
    if not _is_known(chi2):
        return "chi2 per degree of freedom cannot be computed."
    size = f"{math.sqrt(chi2):.2g} times the stated noise"
    if not error.get("explained_by_noise", True):
        return f"What it leaves is {size}, more than noise and usual imperfections explain."
    if chi2 < CHI2_GOOD:
        return f"What it leaves is smaller than noise, {size}; {PATTERNS}."
    return f"What it leaves has the size of noise, {size}; {PATTERNS}."


def pull_text(pull: Mapping[str, Any]) -> str:
    """What a nuisance outside its prior says of the clip, in a sentence."""
    name, value = str(pull["parameter"]), float(pull["value"])
    said = {"value": value, "size": 1e3 * abs(value), "side": "before" if value < 0 else "after"}
    plain = f"{meaning(name) or name} is {value:.3g}{unit_text(pull)}"
    return (
        f"{sentence(_phrase(OUTSIDE, name, **said) or plain)[:-1]}, {abs(pull['z']):.0f} standard "
        "deviations from the expected value; galileo diagnose looks for the cause."
    )


def fits(result: Mapping[str, Any]) -> bool:
    """Whether noise and imperfections of usual sizes explain what is left of enough frames."""
    if result.get("no_verdict"):
        return False
    if "imperfections" in result:
        return all(entry["ordinary"] for entry in result["imperfections"].values())
    error = result["error"]
    return bool(error.get("explained_by_noise", error["chi2_per_dof"] is not None))


def convergence(run: Run) -> str:
    """Whether the inference converged, in one sentence."""
    status = run.result.get("status")
    text = status if isinstance(status, str) else run.posterior.status.value
    if run.result["converged"] and "converged" in text:
        return sentence(text)
    word = "Converged" if run.result["converged"] else "Not converged"
    return f"{word}: {text}."


def cautions(result: Mapping[str, Any]) -> list[str]:
    """What the fit warns of; first, where its intervals are not credible ones, why."""
    found = list(result.get("warnings", []))
    if result.get("preset") != "thesis":
        return found
    best = ", ".join(f"{name} = {value:.4g}" for name, value in result.get("best", {}).items())
    return [
        f"Made with the sampler of the thesis; its estimate is {best or 'its best sample'}. "
        "Its draws are not a posterior: means and intervals here only describe the chains.",
        *found,
    ]


def fit_command(run: Run) -> str:
    """The command that makes this run again, from the clip as it was fitted."""
    result, motion = run.result, run.problem.model.motion
    return command_line(
        "fit",
        [run.folder / CLIP],
        method=result["method"],
        effects=",".join(result["effects"]),
        free=",".join(result.get("free", ())),
        preset=result.get("preset"),
        sampler=result.get("sampler"),
        discrepancy=result.get("discrepancy_asked"),
        motion=None if motion == "planar" else motion,
        engine=run.problem.engine.name,
        seed=result["seed"],
    )
