"""`load`: a clip, checked."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from galileo_jax.clip.load import check_clip, load_clip, with_unused
from galileo_jax.clip.schema import Clip
from galileo_jax.runtime.errors import InputError


def load(clip: str | Path | Mapping[str, Any], *, pixels_per_metre: float | None = None) -> Clip:
    """Loads and checks a clip: a video or track with what its yaml declares.

    Args:
      clip: the video, a csv track (the yaml beside it), the yaml, or its keys as a mapping, with
        files named from the working folder.
      pixels_per_metre: overrides the clip's scale.

    Returns:
      The clip; its fields are the yaml's keys (lengths in m, angles in degrees, points in px),
      `Clip.warnings` has doubts, one line each.

    Raises:
      InputError: one line that names the file, the key, the value and what would be right.

    Examples:
      >>> import galileo_jax as gx
      >>> made = gx.simulate("incline.csv", scenario="incline", seed=1, track_only=True)
      >>> gx.load("incline.csv").scenario
      'incline'
      >>> clip = gx.load({"track": "incline.csv", "scenario": "incline", "ramp_angle_deg": 20.0,
      ...     "objects": [{"name": "object1", "shape": "box", "size_m": [0.06, 0.06, 0.06]}]})
      >>> clip.ramp_angle_deg
      20.0
    """
    if not isinstance(clip, Mapping):
        return load_clip(clip, pixels_per_metre=pixels_per_metre)
    given = {} if pixels_per_metre is None else {"pixels_per_metre": pixels_per_metre}
    name = clip.get("video") or clip.get("track") or "clip"
    path = Path(str(name)).with_suffix(".yaml")
    # Files are looked for beside the yaml that need not exist.
    content = {
        key: Path(str(value)).name if key in ("video", "track") and value is not None else value
        for key, value in clip.items()
    }
    checked = check_clip(path, content | given, overridden=frozenset(given))
    return with_unused(checked).model_copy(update={"source": str(name)})


ClipLike = Clip | str | Path | Mapping[str, Any]


def as_clip(clip: ClipLike, pixels_per_metre: float | None = None) -> Clip:
    """A clip that is loaded already, or loads it."""
    if not isinstance(clip, Clip):
        return load(clip, pixels_per_metre=pixels_per_metre)
    if pixels_per_metre is None:
        return clip
    key = f"{clip.path}: pixels_per_metre (given in the call)"
    if clip.rectangle is not None:
        raise InputError(f"{key}: its rectangle already gives the scale; leave one of them out")
    try:
        return Clip.model_validate({**dict(clip), "pixels_per_metre": pixels_per_metre})
    except ValidationError as error:
        raise InputError(f"{key}: {error.errors()[0]['msg']}") from None


def as_list(given: Any, none: str = "no clip given; at least one expected") -> list[Any]:
    """One clip or several, as a list; a path or a mapping is one. Refuses none, in these words."""
    found = list(given) if isinstance(given, Sequence) and not isinstance(given, str) else [given]
    if not found:
        raise InputError(none)
    return found
