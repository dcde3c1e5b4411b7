"""`galileo simulate`: simulate a clip whose truth is known (video or track, yaml, truth)."""

import argparse
from collections.abc import Sequence
from pathlib import Path

from galileo_jax.api.simulate import simulate
from galileo_jax.commands import command
from galileo_jax.commands.options import VerbParser, refuse
from galileo_jax.runtime.errors import InputError
from galileo_jax.simulation.settings import Settings, option, options_without_part


def main(argv: Sequence[str]) -> None:
    """Writes NAME.mp4 (or NAME.csv), NAME.yaml and NAME.truth.json, for a series NAME_1 and on."""
    asked = _parser().asked(argv)
    for name in {"effects", "values"} & asked.keys():
        pairs = asked[name]
        asked[name] = dict(pairs)
        if name == "effects" and len(asked[name]) < len(pairs):
            raise InputError("--effect: an effect is named twice")
    settings = {name: value for name, value in asked.items() if name != "out"}
    # Written out with its default value an option is ignored no less; only here it shows.
    for fields, why in options_without_part(Settings(**settings)):
        refuse(asked, fields, why, option)
    with command.progress_display() as on_progress:
        made = simulate(**asked, on_progress=on_progress)
    print("\n".join(map(str, made.paths)))


def _parser() -> VerbParser:
    parser = VerbParser(
        "simulate",
        "Make a clip with known truth: NAME.mp4, NAME.yaml and NAME.truth.json.\n"
        "What is not given is drawn at random; the same seed makes the same clip.",
        "galileo simulate --seed 7 --out demo/clip.mp4",
        "galileo simulate --scenario flight --floor --effect air_drag --track-only --out ball.csv",
    )
    path = {"type": Path, "required": True, "metavar": "DIR/NAME.mp4"}
    parser.add("out", option="--out", help="NAME.csv for a track", **path)
    parser.add("scenario")
    parser.add("seed", type=int)
    parser.add("seconds", "fps")
    parser.add(
        "values",
        option=option("values"),
        type=_value,
        metavar="NAME=VALUE",
        help="a parameter of the scenario, such as k3=0.2 or floor_restitution=0.7 (default: "
        "drawn)",
        action="append",
    )
    parser.add("floor", "walls", "track_only", "track_noise")
    add = parser.group("on a ramp")
    add("shapes", type=_shapes, metavar="SHAPE,...", action=None)
    add("angle", "release", "m1", "k1", "m2", "k2")
    add("motion", "solver", choices=None, metavar="NAME")
    add("z2", "series")
    add("like", metavar="NAME.truth.json")
    add = parser.group("what is hidden", "in the truth, and not in the yaml")
    add(
        "effects",
        option=option("effects"),
        type=_effect,
        metavar="NAME[:PARAMETER=VALUE,...]",
        help="an effect, in SI units; what is left out is drawn (default: none)",
        action="append",
    )
    add("strength", "effects_from", "faults")
    add = parser.group("filming")
    width, height = Settings().size
    size = f"of the picture, px, even numbers (default {width}x{height})"
    add("size", type=_size, metavar="WIDTHxHEIGHT", help=size)
    add("direction", choices=None, metavar="SIDE")
    add("no_points", "hand")
    add("camera_fault", metavar="NAME")
    add("noise", "exposure", "defocus", "missed_frames")
    return parser


def _effect(text: str) -> tuple[str, dict[str, float | str]]:
    """`NAME[:PARAMETER=VALUE,...]`; what is no number is left as text, to be refused."""
    name, _, rest = text.partition(":")
    return name.strip(), dict(_value(part) for part in rest.split(",")) if rest else {}


def _value(text: str) -> tuple[str, float | str]:
    """`NAME=VALUE`."""
    name, is_given, value = text.partition("=")
    if not is_given:
        raise argparse.ArgumentTypeError(f"{text!r} is not NAME=NUMBER")
    try:
        return name.strip(), float(value)
    except ValueError:
        return name.strip(), value


def _shapes(text: str) -> tuple[str, ...] | None:
    return tuple(text.split(",")) if text else None


def _size(text: str) -> tuple[int, int] | str:
    width, _, height = text.partition("x")
    is_size = width.isdecimal() and height.isdecimal()
    return (int(width), int(height)) if is_size else text
