"""`galileo FILE`: look, track, fit, test the model, find what is missing, and say it in words."""

import contextlib
import os
import shutil
import sys
import textwrap
import threading
import webbrowser
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import galileo_jax as gx
from galileo_jax.commands import command
from galileo_jax.commands.clip_options import fit_table, notes_on, out_folder, warn
from galileo_jax.commands.options import VerbParser
from galileo_jax.commands.stop import stoppable
from galileo_jax.results.truth import hidden_effect, true_parameters
from galileo_jax.runtime import progress
from galileo_jax.runtime.errors import InputError
from galileo_jax.runtime.progress import Cancelled

if TYPE_CHECKING:
    from galileo_jax.api.understand import Understood

WIDTH = 100  # of a paragraph, at most
OF_YAML = {"ramp_angle": "ramp_angle_deg", "point": "points"}  # what an answer is called there


def looks_like_a_file(word: str) -> bool:
    """Whether a first argument that is no verb is meant for a file or folder."""
    has_slash = os.sep in word or "/" in word
    is_name = not word.startswith("-") and bool(Path(word).suffix)
    return has_slash or is_name or Path(word).exists()


def main(argv: Sequence[str]) -> None:
    """Explains a film or table, or trials together; asks at a terminal for what is missing."""
    asked = _parser().asked(argv)
    files, to, is_bundled = asked.pop("clips"), asked.pop("out", None), asked.pop("bundle", False)
    how = {name: asked.pop(name) for name in {"engine", "seed"} & asked.keys()}
    if "point" in asked:
        asked["point"] = [tuple(one) for one in asked["point"]]
    said = {OF_YAML.get(key, key): value for key, value in asked.items()}
    if to is None and len(files) == 1 and Path(files[0]).is_dir():
        to = Path("runs") / Path(files[0]).resolve().name
    words = ("galileo", "explain", *argv)
    try:
        with stoppable(lambda: _kept(files)) as flag:
            clips = _clips(files, said, flag, to)
            out = out_folder(to, clips)
            warn(warning for clip in clips for warning in clip.warnings)
            truth = true_parameters(clips[0].path)
            hidden_effect(clips[0].path)  # what is no truth is said before the work
            with command.progress_display() as display:
                told = _told(display, out)
                found = gx.explain(clips, out=out, **how, on_progress=told, cancel=flag)
    except (KeyboardInterrupt, Cancelled):
        raise KeyboardInterrupt(_kept(files)) from None
    except Exception as error:
        if is_bundled:
            _bundle_failure(files, said, to, words, error)
        raise
    print(_filled(found.paragraph))
    print(f"\n{fit_table(found.fit, truth, is_asked=True)}")
    notes_on(found.fit, out)
    command.say(", ".join(map(str, found.files)))
    if is_bundled:
        from galileo_jax.api.bundle import NAME, bundle_of

        made = bundle_of(found, out / NAME, command=words, others=_not_said(files, to))
        command.say(made.line)


def _told(display: progress.OnProgress, out: Path) -> progress.OnProgress:
    """Progress, and in words what is known before it is asked what is missing: who stops has it.

    `out`: where that is written, too.
    """

    def on_progress(stage: str, share_done: float, partial: Any) -> None:
        display(stage, share_done, None)
        if isinstance(partial, gx.Explanation) and share_done < 1:
            command.say(f"{_filled(f'So far: {partial.paragraph}')}\nkept in {out}\n")

    return on_progress


def _filled(text: str) -> str:
    """Lines that are not longer than the terminal is wide."""
    return textwrap.fill(text, min(WIDTH, shutil.get_terminal_size().columns))


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
    said: Mapping[str, Any],
    to: Path | None,
    words: Sequence[str],
    error: Exception,
) -> None:
    """Writes the bundle of a call that failed; where that fails, too, says why in one line."""
    from galileo_jax.api.bundle import NAME, bundle_of_failure
    from galileo_jax.api.explain import sources_of

    try:
        given = sources_of(list(files))
    except InputError:
        given = [Path(one) for one in files]
    path = (to or Path("runs") / "+".join(Path(str(one)).stem for one in given)) / NAME
    hidden = _not_said(files, to)
    try:
        command.say(
            bundle_of_failure(given, error, path, command=words, answers=said, others=hidden).line
        )
    except InputError as why:
        command.say(f"warning: {why}")


def _not_said(files: Sequence[str], to: Path | None) -> dict[str, str]:
    """Folders that a call names, to what a bundle has in their place."""
    folders = {one.rstrip("/"): "clips" for one in files if Path(one).is_dir()}
    folders |= {str(Path(one).resolve()): "clips" for one in folders}
    return folders | ({str(to): "out", str(to.resolve()): "out"} if to else {})


def _clips(
    files: Sequence[str],
    said: Mapping[str, Any],
    flag: threading.Event | None = None,
    out: Path | None = None,
) -> "list[gx.Clip]":
    """The checked clips; writes the yaml of those that have none, when all of them are right."""
    from galileo_jax.api.explain import answered_clips, sources_of, understood

    def look_at(clip: Any, said: Mapping[str, Any]) -> "gx.Clip | Understood":
        with command.progress_display() as display, progress.scope(display, flag):
            return understood(clip, said)

    def ask(known: "Understood") -> "Understood":
        is_terminal = sys.stdin.isatty() and sys.stdout.isatty()
        return asked(known, out) if is_terminal else known

    clips, to_write = answered_clips(sources_of(list(files)), said, ask, look_at)
    for known in to_write:
        _write(known)
    return clips


def asked(known: "Understood", out: Path | None = None) -> "Understood":
    """Asks at the terminal for all that is open; Enter takes what stands in brackets.

    Of a film a picture of what is asked about is written to where results go and, if there is a
    display, opened. Raises `InputError` where the input ended (Ctrl-D) before all was answered.
    """
    from galileo_jax.api.questions import Question, parsed, questions
    from galileo_jax.api.understand import sentence_of

    def still_open() -> Sequence[Question]:
        with command.progress_display() as display, progress.scope(display):
            return questions(known)  # of a film what moves may have to be followed

    if still_open():
        command.say(sentence_of(known))
        _show_marks(known, out or Path("runs") / known.source.stem)
    while open_ones := still_open():
        one = open_ones[0]
        default = f" [{one.default}]" if one.default is not None else ""
        choices = f" One of {', '.join(one.choices)}" if one.choices else ""
        command.say(f"{one.text}{choices}\n  ({one.why})")
        try:
            known = known.with_answers(parsed(one, input(f"  {one.key}{default}: "), known))
        except EOFError:
            raise InputError(f"{known.source}: {one.key}: no answer; nothing was written") from None
        except InputError as error:
            command.say(str(error))
    return known


def _show_marks(known: "Understood", folder: Path) -> None:
    """Writes the picture that goes with the questions; asking goes on where it cannot be."""
    if not known.is_film:
        return
    from galileo_jax.api.understand import PICTURE, write_marks

    try:
        with command.progress_display() as display, progress.scope(display):
            picture = write_marks(known, folder / PICTURE)
    except InputError as error:
        command.say(f"warning: {error}")
        return
    command.say(f"{picture}: the first picture, with what moves in it and a ruler")
    show(picture)


def show(picture: Path) -> None:
    """Opens a picture where there is a display; never waits for it, and never fails."""
    is_desktop = sys.platform in ("darwin", "win32")
    if not (is_desktop or os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        return

    def open_it() -> None:
        with contextlib.suppress(Exception):  # whatever a desktop does: the path has been said
            webbrowser.open(picture.resolve().as_uri())

    threading.Thread(target=open_it, daemon=True).start()


def _write(known: "Understood") -> None:
    """Writes a yaml that is not there; says what one that is there lacks."""
    from galileo_jax.api.proposed_clip import write_yaml
    from galileo_jax.api.questions import assumed

    try:
        written = write_yaml(known)
    except InputError as error:
        command.say(f"warning: {error}; the next call asks again")
        return
    if written is not None:
        command.say(f"{written}: written; the next call asks nothing")
        for key, one in assumed(known).items():
            command.say(f"warning: {written}: {key}: {one.default} is taken, as {one.why}")
        return
    told = (*known.declared, "points")
    if lacks := {key: v for key, v in known.answers.items() if key not in told}:
        lines = ", ".join(f"{key}: {'null' if v is None else v}" for key, v in lacks.items())
        command.say(f"{known.yaml_path}: left as it is; it lacks {lines}")


def _parser() -> VerbParser:
    parser = VerbParser(
        "explain",
        __doc__,
        "galileo explain slide.mp4                             or just: galileo slide.mp4",
        "galileo explain trials/ --out results                 a folder of trials together",
    )
    what = "film, table or yaml; several, or a folder with them: trials of the same objects"
    parser.add("clips", nargs="+", metavar="FILE", help=what)
    parser.out("folder of the results (default runs/FILE)")
    parser.add_argument(
        "--bundle",
        action="store_true",
        help="write bundle.zip there, too: what somebody needs who is to help, without the film "
        "and without names (default: off)",
    )
    parser.add("scenario", "ramp_angle", "pixels_per_metre", "track_units", "fps")
    parser.add("point", nargs=2, type=float, metavar=("X", "Y"))
    parser.add("engine", "seed")
    return parser
