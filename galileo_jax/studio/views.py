"""Results as plain data for the page: lists of numbers, words, and nothing else."""

import math
import re
from collections.abc import Mapping, Sized
from typing import Any

import numpy as np

import galileo_jax as gx
from galileo_jax.report.diagnosis_text import adequacy

MOST_POINTS = 400  # of a curve on the page
CANDIDATE_POINTS, MOST_CURVES = 90, 8  # of the best candidates
SIGMAS, SHARE = 8.0, 0.6  # how far a slider reaches to either side
STEPS = 100  # at least, on either side
WHERE = {  # phases of the motion
    "whole": "over the whole motion",
    "held": "while it is held",
    "ramp": "on the ramp",
    "foot": "at the foot",
    "table": "on the table",
    "collision": "at the hit",
    "after": "after the hit",
    "fall": "as it falls",
    "flight": "as it flies",
    "swing": "as it swings",
    "liquid": "in the liquid",
}


def motion_view(motion: gx.Motion) -> dict[str, Any]:
    """One clip's motion."""
    plain = {
        f"{key}{axis}": numbers(values[:, i], digits)
        for key, values, digits in (("", motion.measured_m, 5), ("sd_", motion.sd_m, 6))
        for i, axis in enumerate("xy")
    }
    return {
        "clip": motion.clip,
        "objects": list(motion.objects),
        "times": numbers(motion.times_s, 5),
        **plain,
        "white": numbers(motion.residuals, 3),
        "seen_px": numbers(motion.measured_px, 2),
        "outlines": [numbers(corners, 2) for corners in motion.outlines_px],
        **model_view(motion),
    }


def model_view(motion: gx.Motion) -> dict[str, Any]:
    """What changes in it with the model's parameters."""
    return {
        "model_x": numbers(motion.predicted_m[:, 0], 5),
        "model_y": numbers(motion.predicted_m[:, 1], 5),
        "model_px": numbers(motion.predicted_px, 2),
        "turned": numbers(np.degrees(motion.turned_rad), 2),
        "misfit": numbers(motion.misfit, 4),
    }


def fit_view(fit: gx.Fit) -> dict[str, Any]:
    """A fit with its motions."""
    return {
        "effects": list(fit.effects),
        "parameters": [
            {"name": name, "kind": kind, **entry, **_reach(entry)}
            for kind in ("parameters", "derived")
            for name, entry in fit.result[kind].items()
        ],
        "error": dict(fit.result["error"]),
        "status": fit.result.get("status", ""),
        "warnings": list(fit.warnings),
        "exact": list(fit.taken_as_exact),
        "motions": [motion_view(motion) for motion in fit.motions()],
    }


def track_view(track: gx.Track) -> dict[str, Any]:
    """A track in pixels."""
    pixels = track.pixels
    assert pixels is not None  # of a video
    variance = np.stack([pixels.covariance_px2[..., i, i] for i in (0, 1)], axis=-1)
    seen = np.where(pixels.is_visible[..., None], pixels.position_px, np.nan)
    return {
        "clip": track.name,
        "objects": list(pixels.names),
        "times": numbers(pixels.times_s, 5),
        "seen_px": numbers(seen, 2),
        "sd_px": numbers(np.sqrt(variance), 3),
        "warnings": [in_words(line) for line in track.warnings],
    }


def in_words(line: str) -> str:
    """A remark without the names of files and keys, which the page does not show."""
    text = line.split(": ", 1)[-1]
    size = re.fullmatch(r"(.+): size_m: null; \[(.+)\] is used, (.+)", text)
    if size:
        name, sides, source = size.groups()
        return f"{name}: no size given; {sides.replace(', ', ' x ')} m is used, {source}."
    return text


def explanation_view(found: gx.Explanation) -> dict[str, Any]:
    """The result in words, what is to be known of it, and what the parts show of it."""
    measured = found.fit.measurements
    remarks = [line for one in measured for line in (*one.remarks, *one.doubts)]
    notes = dict.fromkeys([*remarks, *found.fit.warnings, *found.fit.taken_as_exact])
    return {
        "explained": {
            "paragraph": found.paragraph,
            "notes": [in_words(line) for line in notes],
            "fit": fit_view(found.fit),
            "compare": comparison_view(found.check),
            "diagnosis": None if found.diagnosis is None else diagnosis_view(found.diagnosis),
        }
    }


def comparison_view(check: gx.Comparison) -> dict[str, Any]:
    """Where a model fails, in words."""
    stretches = []
    for one in check.paths:
        if one.failing_s is None or one.worst is None:
            continue
        (start, end), worst = one.failing_s, one.worst
        sentence = (
            f"{one.title}: the model fails most from {start:.2f} to {end:.2f} s, in {worst.axis} "
            f"{WHERE.get(worst.phase, worst.phase)}, by {worst.z:.0f} standard deviations."
        )
        place = {"clip": one.clip, "object": one.index, "start": start, "end": end}
        stretches.append({**place, "sentence": sentence})
    return {
        "p_value": check.p_value,
        "is_adequate": check.is_adequate,
        "sentence": adequacy(check.document),
        "stretches": stretches,
    }


def diagnosis_view(found: gx.Diagnosis) -> dict[str, Any]:
    """What diagnosis.json does not hold: the curves of the best candidates."""
    names = found.candidates["effect"][:MOST_CURVES]
    return {"curves": {name: [thin(one) for one in found.motions(name)] for name in names}}


def prediction_view(ahead: gx.Prediction) -> dict[str, Any]:
    """Where a clip's objects go."""
    step = thinned(ahead.motions.times_s)
    keys = ("time_s", "x_m", "x_q025_m", "x_q975_m", "y_m")
    objects = {
        str(name): {key: numbers(part[key].to_numpy()[step], 4) for key in keys}
        for name, part in ahead.to_dataframe().groupby("object", sort=False)
    }
    end = ahead.document["clip_end_s"]
    return {"sentences": list(ahead.sentences), "objects": objects, "clip_end": end}


def thin(motion: gx.Motion) -> dict[str, Any]:
    """A candidate's curve and the residuals that it leaves."""
    step = thinned(motion.times_s, CANDIDATE_POINTS)
    return {
        "clip": motion.clip,
        "times": numbers(motion.times_s[step], 4),
        "model_x": numbers(motion.predicted_m[:, 0, step], 4),
        "white": numbers(motion.residuals[:, 0, step], 2),
    }


def _reach(entry: Mapping[str, Any]) -> dict[str, float]:
    """The ends of a parameter's slider, and its steps, which are round numbers."""
    mean, sd = entry["mean"], entry["sd"]
    reach = max(SIGMAS * sd, SHARE * abs(mean), 1e-6)
    step = 10.0 ** math.floor(math.log10(reach / STEPS))
    low = math.floor((mean - reach) / step) * step
    if entry["q025"] >= 0:
        low = max(low, 0.0)
    return {"low": low, "high": math.ceil((mean + reach) / step) * step, "step": step}


def numbers(values: Any, digits: int) -> Any:
    """An array as nested lists; None for what is not finite, and for no array."""
    if values is None:
        return None
    array = np.round(np.asarray(values, float), digits)
    return np.where(np.isfinite(array), array.astype(object), np.array(None)).tolist()


def thinned(values: Sized, most: int = MOST_POINTS) -> slice:
    """So that a curve has no more points than a page can show."""
    return slice(None, None, max(1, -(-len(values) // most)))
