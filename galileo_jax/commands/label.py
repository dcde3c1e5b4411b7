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
from galileo_jax.commands.options import adder

LINE = ("X1", "Y1", "X2", "Y2")
_adder = partial(adder, function="label", without="unchanged")


def main(argv: Sequence[str]) -> int | None:
    """Creates or updates the yaml beside a clip; writes nothing unless the result is valid."""
    asked = vars(_parser().parse_args(argv))
    path: Path = asked.pop("clip")
    if not source_of(path) or has_yaml(path):
        command.refuse_ignored(argv, ["--level"], f"{path} is not in folders of Physics 101")
    for name in ("point", "size"):
        asked[name] = {thing: values for thing, *values in asked[name]}
    asked["shape"] = dict(asked["shape"])
    for key in ("first_frame", "last_frame"):
        asked[key] = {name: _frame(text) for name, text in asked[key]}
    asked["correct"] = corrections(asked["correct"])
    done = label(path, **asked)
    for note in done.notes:
        command.say(f"note: {note}")
    warn(done.clip.warnings)
    print(done.path)
    return None


def _parser() -> command.Parser:
    parser = command.Parser(
        prog="galileo label",
        description="Write what is known about a clip into the yaml beside it; everything else "
        "in it\nstays as it is. Pixels: x to the right, y down, as in any image viewer.",
    )
    parser.examples(
        "galileo label clip.mp4 --scenario ramp --ramp 60 114 150 146 --origin 160 150 \\\n"
        "      --scale 0 100 150 100 0.5 --point object1 73 109 --size object1 0.06 0.05 0.06",
        "galileo label clip.mp4 --fps 240",
    )
    parser.add_argument("clip", type=Path, metavar="CLIP", help="video, track file or yaml")
    add = _adder(parser)
    add("scenario", metavar="NAME", help=f"one of {', '.join(SCENARIOS)} (default: unchanged)")
    add("fps", metavar="HZ")
    add("gravity", metavar="G")
    add("direction", metavar="SIDE")
    add("level", metavar="FOLDER")
    title = "objects (repeat for each; a new NAME adds an object)"
    add = partial(_adder(parser.add_argument_group(title)), default=[])
    add("point", nargs=3, metavar=("NAME", "X", "Y"))
    add("size", nargs="+", metavar=("NAME", "METRES"))
    add("shape", nargs=2, action="append", metavar=("NAME", "SHAPE"))
    frame = "{}, counted from 0; null: {} (default: unchanged)"
    first = frame.format("the first frame in which it moves freely", "to be found")
    last = frame.format("the last frame that is used", "the clip's last")
    add("first_frame", nargs=2, action="append", metavar=("NAME", "FRAME"), help=first)
    add("last_frame", nargs=2, action="append", metavar=("NAME", "FRAME"), help=last)
    add("correct", nargs="+", metavar=("NAME", "FRAME"))
    add = _adder(parser.add_argument_group("scale and ramp"))
    numbers = {"action": "store", "type": float, "default": None}
    corners = [f"{axis}{corner}" for corner in range(1, 5) for axis in "XY"]
    add("pixels_per_metre", "pixels_per_metre_sd", metavar="PX")
    add("scale", nargs=5, metavar=(*LINE, "METRES"), **numbers)
    add("rectangle", nargs=10, metavar=(*corners, "WIDTH", "HEIGHT"), **numbers)
    add("lens", nargs="+", metavar=("K1", "SD"), **numbers)
    add("ramp_angle", "ramp_angle_sd", metavar="DEG")
    add("ramp", nargs=4, metavar=LINE, **numbers)
    add("origin", nargs=2, metavar=("X", "Y"), **numbers)
    add("origin_sd", metavar="PX")
    add = _adder(parser.add_argument_group("of a track file"))
    add("track_units", metavar="UNIT")
    add("track_y", metavar="WAY")
    add("track_origin", nargs=2, metavar=("X", "Y"), **numbers)
    return parser


def _frame(text: str) -> Any:
    """A frame number; what is none is left as text, to be refused."""
    return None if text == "null" else int(text) if text.isdecimal() else text
