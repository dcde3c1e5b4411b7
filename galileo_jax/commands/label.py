"""`galileo label`: write what is known about a clip into the yaml beside it."""

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

from galileo_jax.api.label import label
from galileo_jax.clip.load import has_yaml
from galileo_jax.clip.scenarios import SCENARIOS
from galileo_jax.clip.sources import source_of
from galileo_jax.commands import command
from galileo_jax.commands.clip_options import corrections, warn
from galileo_jax.commands.options import VerbParser, refuse

LINE = ("X1", "Y1", "X2", "Y2")


def main(argv: Sequence[str]) -> None:
    """Creates or updates the yaml beside a clip; writes nothing unless the result is valid."""
    asked = _parser().asked(argv)
    path: Path = asked["clip"]
    if not source_of(path) or has_yaml(path):
        refuse(asked, ["level"], f"{path} is not in folders of Physics 101")
    for name in {"point", "size"} & asked.keys():
        asked[name] = {thing: values for thing, *values in asked[name]}
    if "shape" in asked:
        asked["shape"] = dict(asked["shape"])
    for key in {"first_frame", "last_frame"} & asked.keys():
        asked[key] = {name: _frame(text) for name, text in asked[key]}
    asked["correct"] = corrections(asked.get("correct", ()))
    done = label(**asked)
    for note in done.notes:
        command.say(f"note: {note}")
    warn(done.clip.warnings)
    print(done.path)


def _parser() -> VerbParser:
    parser = VerbParser(
        "label",
        "Write what is known about a clip into the yaml beside it; everything else "
        "in it\nstays as it is. Pixels: x to the right, y down, as in any image viewer.",
        "galileo label clip.mp4 --scenario ramp --ramp 60 114 150 146 --origin 160 150 \\\n"
        "      --scale 0 100 150 100 0.5 --point object1 73 109 --size object1 0.06 0.05 0.06",
        "galileo label clip.mp4 --fps 240",
        without="unchanged",
    )
    parser.add("clip", metavar="CLIP", help="video, track file or yaml")
    scenarios = f"one of {', '.join(SCENARIOS)} (default: unchanged)"
    parser.add("scenario", metavar="NAME", help=scenarios)
    parser.add("fps")
    parser.add("gravity", metavar="G")
    parser.add("direction", metavar="SIDE")
    parser.add("level", metavar="FOLDER")
    add = parser.group("objects (repeat for each; a new NAME adds an object)")
    add("point", nargs=3, metavar=("NAME", "X", "Y"))
    add("size", nargs="+", metavar=("NAME", "METRES"))
    add("shape", nargs=2, action="append", metavar=("NAME", "SHAPE"))
    frame = partial(add, nargs=2, action="append", metavar=("NAME", "FRAME"))
    text = "{}, counted from 0; null: {} (default: unchanged)"
    frame(
        "first_frame", help=text.format("the first frame in which it moves freely", "to be found")
    )
    frame("last_frame", help=text.format("the last frame that is used", "the clip's last"))
    add("correct", nargs="+", metavar=("NAME", "FRAME"))
    add = parser.group("scale and ramp")
    numbers = {"action": "store", "type": float}
    corners = [f"{axis}{corner}" for corner in range(1, 5) for axis in "XY"]
    add("pixels_per_metre", "pixels_per_metre_sd", metavar="PX")
    add("scale", nargs=5, metavar=(*LINE, "METRES"), **numbers)
    add("rectangle", nargs=10, metavar=(*corners, "WIDTH", "HEIGHT"), **numbers)
    add("lens", nargs="+", metavar=("K1", "SD"), **numbers)
    add("ramp_angle", "ramp_angle_sd", metavar="DEG")
    add("ramp", nargs=4, metavar=LINE, **numbers)
    add("origin", nargs=2, metavar=("X", "Y"), **numbers)
    add("origin_sd", metavar="PX")
    add = parser.group("of a track file")
    add("track_units")
    add("track_y", metavar="WAY")
    add("track_origin", nargs=2, metavar=("X", "Y"), **numbers)
    return parser


def _frame(text: str) -> Any:
    """A frame number; what is none is left as text, to be refused."""
    return None if text == "null" else int(text) if text.isdecimal() else text
