"""The objects of an earlier clip and what was hidden in it, for another trial with them."""

import json
import math
from pathlib import Path

from galileo_jax.clip.schema import ClipObject
from galileo_jax.model.effects.registry import make_effects
from galileo_jax.runtime.errors import InputError
from galileo_jax.simulation.truth import Truth

NONE = "none"


def truth_like(path: Path, ramp_angle_deg: float, scenario: str) -> Truth:
    """The truth of NAME.truth.json on a ramp declared to have another angle.

    Raises:
      InputError: it is no truth of a clip on a ramp that this program simulated.
    """
    try:
        record = json.loads(path.read_text(encoding="utf-8"))
        if record["scenario"] != scenario:
            raise InputError(f"--like: {path}: scenario {record['scenario']}; {scenario} expected")
        count = int(record["objects"])
        names = [] if record["effect"] == NONE else str(record["effect"]).split("+")
        values = {name: float(value) for name, value in record["effect_parameters"].items()}
        numbers = range(1, count + 1)
        return Truth(
            mass_kg=tuple(float(record[f"m{i}"]) for i in numbers),
            friction=tuple(float(record[f"k{i}"]) for i in numbers),
            ramp_angle_deg=ramp_angle_deg + math.degrees(values.get("ramp_angle", 0.0)),
            objects=tuple(
                ClipObject(name=f"object{i}", shape=shape, size_m=record[f"size{i}_m"], rolls=rolls)
                for i, shape, rolls in zip(numbers, record["shapes"], record["rolls"], strict=True)
            ),
            release_m=float(record["release_m"]),
            object2_x_m=float(record.get("object2_y_m", 0.0)),
            gravity=float(record["gravity"]),
            scenario=scenario,
            beyond_x_m=tuple(float(record[f"object{i}_y_m"]) for i in numbers if i > 2),
            effects=tuple(make_effects(names)),
            effect_values=values,
        )
    except OSError as error:
        raise InputError(f"--like: {path}: {error.strerror or error}") from error
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise InputError(
            f"--like: {path}: not the truth of a clip that this version simulated ({error})"
        ) from error
