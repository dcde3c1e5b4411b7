"""`galileo FILE`: look, track, fit, test the model, find what is missing, and say it in words."""

import os
import shutil
import sys
import textwrap
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from threading import Event
from typing import TYPE_CHECKING, Any

from galileo_jax.commands import command
from galileo_jax.commands.clip_options import notes_on, out_folder, warn
from galileo_jax.commands.fit_table import table
from galileo_jax.commands.options import adder
from galileo_jax.commands.progress_display import progress_display
from galileo_jax.commands.show import show
from galileo_jax.commands.stop import stoppable
from galileo_jax.results.truth import true_parameters
from galileo_jax.rollout.engine_names import ENGINES
from galileo_jax.runtime import progress
from galileo_jax.runtime.errors import InputError
from galileo_jax.runtime.progress import Cancelled

if TYPE_CHECKING:
    from galileo_jax.api.explain import Explanation
    from galileo_jax.api.understand import Understood
    from galileo_jax.clip.schema import Clip

WIDTH = 100  # of a paragraph, at most
OF_YAML = {"ramp_angle": "ramp_angle_deg"}  # options that a yaml's key has another name for


def looks_like_a_file(word: str) -> bool:
    """Whether a first argument that is no verb is meant for a file or folder."""
    has_slash = os.sep in word or "/" in word
    is_name = not word.startswith("-") and bool(Path(word).suffix)
    return has_slash or is_name or Path(word).exists()


def main(argv: Sequence[str]) -> int | None:
    """Explains a film or table, or trials together; asks at a terminal for what is missing."""
    call = vars(_parser().parse_args(argv))
    files, to, is_bundled = call.pop("clips"), call.pop("out"), call.pop("bundle")
    engine, seed = call.pop("engine"), call.pop("seed")
    said = {OF_YAML.get(key, key): value for key, value in call.items() if value is not None}
    if (point := said.pop("point", None)) is not None:
        said["points"] = [tuple(one) for one in point]
    is_folder = len(files) == 1 and Path(files[0]).is_dir()
    to = to or (f"runs/{Path(files[0]).resolve().name}" if is_folder else None)
    try:
        with stoppable(lambda: _kept(files)) as flag:
            found, out = _explained(files, said, to, engine, seed, flag)
    except (KeyboardInterrupt, Cancelled):
        raise KeyboardInterrupt(_kept(files)) from None
    except Exception as error:
        if is_bundled:
            _bundle_failure(files, said, to, argv, error)
        raise
    print(textwrap.fill(found.paragraph, min(WIDTH, shutil.get_terminal_size().columns)))
    print(f"\n{table(found.fit, true_parameters(found.fit.measurements[0].clip))}")
    notes_on(found.fit, out)
    command.say(", ".join(map(str, found.files)))
    if is_bundled:
        from galileo_jax.api.bundle import NAME, bundle_of

        made = bundle_of(found, out / NAME, command=_words(argv), others=_not_said(files, to))
        command.say(made.line)
    return None


def _explained(
    files: Sequence[str], said: dict[str, Any], to: str | None, engine: str, seed: int, flag: Event
) -> "tuple[Explanation, Path]":
    """What the files show, and the folder in which it lies."""
    clips = _clips(files, said, flag, to)
    out = out_folder(to, clips)
    warn(warning for clip in clips for warning in clip.warnings)
    from galileo_jax.api.explain import explain

    with progress_display() as display:
        found = explain(clips, out=out, engine=engine, seed=seed, on_progress=display, cancel=flag)
    return found, out


def _kept(files: Sequence[str]) -> str:
    """What a call that was stopped leaves, and what the next one does with it."""
    # What was not imported has not begun; and importing it now would take seconds.
    module = sys.modules.get("galileo_jax.api.explain")
    found = module.kept(files) if module is not None and hasattr(module, "kept") else []
    if not found:
        return "stopped; nothing was written: the next run begins anew"
    return f"stopped; kept: {', '.join(found)}: the next run goes on from there"


def _bundle_failure(
    files: Sequence[str],
    said: dict[str, Any],
    to: str | None,
    argv: Sequence[str],
    error: Exception,
) -> None:
    """Writes the bundle of a call that failed; where that fails, too, says why in one line."""
    from galileo_jax.api.bundle import NAME, bundle_of_failure
    from galileo_jax.api.explain import sources_of

    try:
        given = sources_of(list(files))
    except InputError:
        given = [Path(one) for one in files]
    folder = Path(to) if to else Path("runs") / "+".join(Path(str(one)).stem for one in given)
    try:
        made = bundle_of_failure(
            given,
            error,
            folder / NAME,
            command=_words(argv),
            answers=said,
            others=_not_said(files, to),
        )
    except InputError as why:
        command.say(f"warning: {why}")
        return
    command.say(made.line)


def _words(argv: Sequence[str]) -> tuple[str, ...]:
    return ("galileo", "explain", *argv)


def _not_said(files: Sequence[str], to: str | None) -> dict[str, str]:
    """Folders that a call names, to what a bundle has in their place."""
    folders = {one.rstrip("/"): "clips" for one in files if Path(one).is_dir()}
    folders |= {str(Path(one).resolve()): "clips" for one in folders}
    return folders | ({to: "out", str(Path(to).resolve()): "out"} if to else {})


def _clips(
    files: Sequence[str], said: dict[str, Any], flag: Event | None = None, out: str | None = None
) -> "list[Clip]":
    """The checked clips; writes the yaml of those that have none, when all of them are right."""
    from galileo_jax.api.explain import answered_clips, sources_of, understood
    from galileo_jax.api.proposed_clip import write_yaml

    def look_at(clip: Any, said: Mapping[str, Any]) -> "Clip | Understood":
        with progress_display() as display, progress.scope(display, flag):
            return understood(clip, said)

    is_terminal = sys.stdin.isatty() and sys.stdout.isatty()
    ask = (lambda known, answers: asked(known, answers, out)) if is_terminal else _as_said
    clips, to_write = answered_clips(sources_of(list(files)), said, ask, look_at)
    for known, answers in to_write:
        _write(known, answers, write_yaml)
    return clips


def _as_said(known: "Understood", answers: dict[str, Any]) -> dict[str, Any]:
    return answers


def asked(known: "Understood", answers: dict[str, Any], out: str | None = None) -> dict[str, Any]:
    """Asks at the terminal for all that is open; Enter takes what stands in brackets.

    Of a film a picture of what is asked about is written and, if there is a display, opened.

    Args:
      known: what the file shows.
      answers: that the call gave.
      out: where results go; None: where they go by default.

    Raises:
      InputError: the input ended (Ctrl-D) before all was answered.
    """
    from galileo_jax.api.questions import Question, parsed, questions
    from galileo_jax.api.seen_sentence import sentence_of

    is_first = True

    def still_open() -> Sequence[Question]:
        with progress_display() as display, progress.scope(display):
            return questions(known, answers)  # of a film what moves may have to be followed

    while open_ones := still_open():
        if is_first:
            command.say(sentence_of(known, answers))
            _show_marks(known, Path(out) if out else Path("runs") / known.source.stem)
            is_first = False
        one = open_ones[0]
        default = f" [{one.default}]" if one.default is not None else ""
        choices = f" One of {', '.join(one.choices)}" if one.choices else ""
        command.say(f"{one.text}{choices}\n  ({one.why})")
        try:
            answers = answers | parsed(one, input(f"  {one.key}{default}: "), known, answers)
        except EOFError:
            raise InputError(f"{known.source}: {one.key}: no answer; nothing was written") from None
        except InputError as error:
            command.say(str(error))
    return answers


def _show_marks(known: "Understood", folder: Path) -> None:
    """Writes the picture that goes with the questions; asking goes on where it cannot be."""
    if not known.is_film:
        return
    from galileo_jax.api.marked_picture import NAME, write_marks

    try:
        with progress_display() as display, progress.scope(display):
            picture = write_marks(known, folder / NAME)
    except InputError as error:
        command.say(f"warning: {error}")
        return
    command.say(f"{picture}: the first picture, with what moves in it and a ruler")
    show(picture)


def _write(known: "Understood", answers: dict[str, Any], write: Callable[..., Path | None]) -> None:
    """Writes a yaml that is not there; says what one that is there lacks."""
    try:
        written = write(known, answers)
    except InputError as error:
        command.say(f"warning: {error}; the next call asks again")
        return
    if written is not None:
        command.say(f"{written}: written; the next call asks nothing")
        return
    lacks = {key: v for key, v in answers.items() if key not in (*known.declared, "points")}
    if lacks:
        lines = ", ".join(f"{key}: {'null' if v is None else v}" for key, v in lacks.items())
        command.say(f"{known.yaml_path}: left as it is; it lacks {lines}")


def _parser() -> command.Parser:
    parser = command.Parser(prog="galileo explain", description=__doc__)
    parser.add_argument(
        "clips",
        nargs="+",
        metavar="FILE",
        help="film, table or yaml; several, or a folder with them: trials of the same objects",
    )
    add = adder(parser, "explain")
    parser.add_argument("--out", metavar="DIR", help="folder of the results (default runs/FILE)")
    parser.add_argument(
        "--bundle",
        action="store_true",
        help="write bundle.zip there, too: what somebody needs who is to help, without the film "
        "and without names (default: off)",
    )
    add("scenario", metavar="NAME")
    add("ramp_angle", metavar="DEG")
    add("pixels_per_metre", metavar="SCALE")
    add("track_units", metavar="UNIT")
    add("fps", metavar="HZ")
    add("point", nargs=2, type=float, action="append", default=None, metavar=("X", "Y"))
    add("engine", choices=ENGINES, metavar=None)
    add("seed", type=command.whole_number(0))
    parser.examples(
        "galileo explain slide.mp4                             or just: galileo slide.mp4",
        "galileo explain trials/ --out results                 a folder of trials together",
    )
    return parser
