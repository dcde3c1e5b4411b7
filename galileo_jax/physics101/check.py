"""A clip of Physics 101, checked: what its folders and the labels declare."""

from typing import Any

from galileo_jax.clip.load import check_clip
from galileo_jax.clip.schema import Clip
from galileo_jax.physics101.place import Labels, Place, content_of
from galileo_jax.runtime.errors import InputError


def check_place(place: Place, labels: Labels, given: dict[str, Any] | None = None) -> Clip:
    """Checks a clip of Physics 101, which its folders and its labels declare.

    Args:
      place: where it is.
      labels: of the data set.
      given: values that win over both.

    Raises:
      InputError: one line, which names the labels, for whatever is wrong.
    """
    content, warnings = content_of(place, labels)
    given = given or {}
    try:
        clip = check_clip(place.yaml, content | given, overridden=frozenset(given))
    except InputError as error:
        named = f"{place.labels}: clips: {place.levels[-1]}"
        raise InputError(str(error).replace(str(place.yaml), named)) from None
    noted = () if "pixels_per_metre" in given else warnings
    return clip.model_copy(update={"warnings": clip.warnings + noted})
