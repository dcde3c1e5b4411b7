"""What cannot be told apart from gravity, where gravity is inferred.

In a fall the path shows g t^2 / 2: whatever scales lengths or times acts like another g. On a
slope it shows g (sin a - k cos a): one equation for gravity and friction, until a level table
(k g) or a slope of another angle adds a second one.
"""

import re
from collections.abc import Mapping, Sequence
from typing import Any

# Each of these multiplies all accelerations, as gravity does.
ALIKE = ("pixels_per_metre", "scale_error", "frame_rate", "rolling")
FRICTION = re.compile(r"k\d+")


def confounded_with_gravity(
    parameters: Mapping[str, Mapping[str, Any]], has_surface: bool
) -> tuple[set[str], str | None]:
    """Parameters that gravity keeps this motion from telling, and why in one sentence.

    Gravity itself is among them; none where it is determined, or not inferred. `parameters`:
    entries of result.json with `identified` by the width of each alone.
    """
    if "gravity" not in parameters:
        return set(), None
    alike = [name for name in ALIKE if name in parameters]
    unknown = [name for name in ("gravity", *alike) if not parameters[name]["identified"]]
    if not unknown:
        return set(), None
    # A prior may narrow one of them: the clip determines it no more than the others.
    names = {"gravity", *alike}
    frictions = [name for name in parameters if has_surface and FRICTION.fullmatch(name)]
    others = [*frictions, *(name for name in ("density_ratio",) if name in parameters)]
    return names | set(others), _reason(alike, frictions, others)


def _reason(alike: Sequence[str], frictions: Sequence[str], others: Sequence[str]) -> str:
    if "pixels_per_metre" in alike:
        return (
            "gravity and the scale of the picture cannot both be determined from one motion: give "
            "--pixels-per-metre, or leave gravity as declared"
        )
    if alike:
        return (
            f"gravity and {' and '.join(alike)} cannot be separated: each of them multiplies all "
            "accelerations; leave gravity as declared, or measure the others"
        )
    if frictions:
        return (
            "gravity and friction cannot both be determined from one slope: only "
            "g (sin a - k cos a) shows; let the object run out on a level table, or fit clips of "
            "several angles together"
        )
    if others:
        return (
            "gravity and density_ratio cannot both be determined: declare mass, size and "
            "liquid_density"
        )
    return "this motion does not depend enough on gravity to determine it"
