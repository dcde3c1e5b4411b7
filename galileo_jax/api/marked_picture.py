"""The first picture of a film with what moves in it marked, for a person who is asked about it."""

from collections.abc import Iterable, Sequence
from pathlib import Path

from galileo_jax.api.understand import Understood
from galileo_jax.report.marked_picture import Marked, write_marked_picture
from galileo_jax.runtime.errors import InputError

NAME = "what_moves.png"


def write_marks(known: Understood, path: str | Path) -> Path:
    """Writes the first picture, its things numbered in the order in which they set out.

    Of a film whose yaml names its objects these are marked.

    Args:
      known: of a film.
      path: of the picture; its suffix says which kind (png, jpg, svg).

    Raises:
      InputError: it is no film, or the picture cannot be written.
    """
    if not known.is_film:
        raise InputError(f"{known.source}: a table has no picture; look(...).plot draws its places")
    from galileo_jax.video import decode  # and OpenCV, which a table does not need

    frame = next(decode.frames(known.source))[..., ::-1]
    try:
        return write_marked_picture(Path(path), frame, [*_things(known)])
    except (OSError, ValueError) as error:  # Matplotlib knows no such suffix
        raise InputError(f"{path}: {getattr(error, 'strerror', None) or error}") from error


def _things(known: Understood) -> Iterable[Marked]:
    """What is listed in the question, or what is declared."""
    for number, (point, size) in enumerate(known.things.items(), 1):
        way = known.path(point)
        slope = way.likely.slope_deg if way.likely is not None else None
        yield Marked(str(number), point, size, way.way_px, slope)
    declared: Sequence[object] = known.declared.get("objects") or ()
    for item in declared if isinstance(declared, list) else ():
        point = item.get("point_px") if isinstance(item, dict) else None
        if isinstance(item, dict) and isinstance(point, list) and len(point) == 2:
            yield Marked(str(item.get("name", "")), (float(point[0]), float(point[1])))
