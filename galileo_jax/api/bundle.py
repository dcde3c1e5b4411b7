"""A bundle: one zip of a run, or of one that failed, that can be given to somebody who helps.

It has the tracks as csv and what was declared, which together are fitted again to the same numbers,
the results, the versions and the command. It has no film, no picture and nothing personal
(`results/impersonal.py`).
"""

import contextlib
import json
import platform
import shlex
import tempfile
import traceback
import zipfile
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import yaml

from galileo_jax.api.clips import ClipLike
from galileo_jax.api.look import look
from galileo_jax.clip.file_kinds import YAML_SUFFIXES
from galileo_jax.clip.load import load_clip, yaml_of
from galileo_jax.clip.scenarios import SCENARIOS
from galileo_jax.clip.schema import Clip, ClipFile
from galileo_jax.clip.track_csv import write_observation_csv
from galileo_jax.clip.yaml_file import read_mapping
from galileo_jax.measurement.measure import Measurement, measure
from galileo_jax.measurement.shared_errors import beside, write_errors
from galileo_jax.measurement.track_cache import is_tracked
from galileo_jax.report.provenance import versions
from galileo_jax.results.impersonal import Impersonal, impersonal
from galileo_jax.runtime.atomic_write import finite, replacing
from galileo_jax.runtime.errors import InputError, one_line_of

if TYPE_CHECKING:
    from galileo_jax.api.explain import Explanation

NAME = "bundle.zip"
MADE = (1980, 1, 1, 0, 0, 0)  # the earliest that a zip can say; when it was made is nobody's matter
OF_PICTURE = {"video", "rectangle", "lens", "origin_px", "origin_sd_px", "direction"}
OF_TABLE = {"track", "trial", "track_units", "track_y", "track_origin", "track_up"}
OF_OBJECTS = {"point_px", "corrections", "track_name", "track_file"}
"""Keys of a yaml that mean nothing beside a track in metres."""

READ_ME = """What galileo FILE --bundle wrote, for somebody who is to find out what went wrong.

{again}
There is no film and no picture in it, and no name of a file, folder, user or computer.
{files}
"""
AGAIN = "To do the same again, unpack it and call:  galileo {tracks}\n"
WHAT = {
    "command.txt": "the call",
    "versions.json": "of the program, Python, its packages and the operating system",
    "look.txt": "what is seen in each file before anything is fitted",
    "paragraph.txt": "what was said",
    "error.txt": "why it stopped",
    ".errors.npz": "errors that many frames of a film's track share",
    ".csv": "where the objects were, in metres",
    "_declared.yaml": "what was declared of the file",
    ".yaml": "what is declared of the track",
    "result.json": "the fit",
    "compare.json": "the test of the model",
    "diagnosis.json": "what is missing",
}


@dataclass(frozen=True)
class Bundle:
    """A bundle that was written."""

    path: Path
    names: tuple[str, ...]

    @property
    def line(self) -> str:
        """What is in it and what is not, in one line."""
        return (
            f"{self.path}: {', '.join(self.names)}; no film, no picture, and no names of files, "
            "folders or people: attach it to an issue"
        )


def bundle_of(
    found: "Explanation",
    path: str | Path,
    *,
    command: Sequence[str] = (),
    others: Mapping[str, str] = {},
) -> Bundle:
    """Writes the bundle of what was explained.

    `command`: the words of the call; none: those that do the same. `others`: words that are not
    to be in it, to what is said instead. Raises `InputError` where it cannot be written.
    """
    measured = found.fit.measurements
    names = [item.name for item in measured[0].clip.objects]
    hidden = impersonal([_files_of(one.clip) for one in measured], names, others)
    documents = {"result.json": found.fit.result, "compare.json": found.check_document}
    if found.diagnosis is not None:
        documents["diagnosis.json"] = found.diagnosis.document
    texts = {
        "command.txt": _command(command or shlex.split(found.command), hidden),
        "look.txt": "\n\n".join(one.summary() for one in found.looks),
        "paragraph.txt": found.paragraph,
    }
    declared = [{} if one.clip.video is None else _declared(one.clip) for one in measured]
    return _written(Path(path), hidden, texts, declared, measured, documents)


def bundle_of_failure(
    files: Sequence[ClipLike],
    error: BaseException,
    path: str | Path,
    *,
    command: Sequence[str] = (),
    answers: Mapping[str, Any] | None = None,
    others: Mapping[str, str] = {},
) -> Bundle:
    """Writes the bundle of a call that failed: what was understood, and why it stopped.

    An `error` that a person can mend is one line, any other all of it. `answers`: what the call
    said, by keys of the yaml; the rest as for `bundle_of`.
    """
    sources = [Path(one) for one in files if isinstance(one, str | Path)]
    clips = [clip for one in sources if (clip := _clip(one, answers or {})) is not None]
    objects = [item.name for item in clips[0].objects] if clips else []
    hidden = impersonal([_named_files(source) for source in sources], objects, others)
    texts = {
        "command.txt": _command(command, hidden),
        "error.txt": str(error) if isinstance(error, InputError) else _traced(error),
        "look.txt": "\n\n".join(_seen(source) for source in sources),
    }
    measured = [one for clip in clips if (one := _measured(clip)) is not None]
    tracks = measured if len(measured) == len(sources) else []
    declared = [_declared_beside(source) for source in sources]
    return _written(Path(path), hidden, texts, declared, tracks)


def _traced(error: BaseException) -> str:
    """The traceback without the lines of source, which may be those of a user."""
    lines = "".join(traceback.format_exception(error)).splitlines()
    return "\n".join(line for line in lines if not line.startswith("    "))


def _written(
    path: Path,
    hidden: Impersonal,
    texts: Mapping[str, str],
    declared: Sequence[Mapping[str, Any]],
    tracks: Sequence[Measurement],
    documents: Mapping[str, Any] = {},
) -> Bundle:
    """The bundle; all that it is given still has all names."""
    files: dict[str, bytes] = {}
    for number, one in enumerate(tracks, 1):
        files |= _track_files(one, f"clip{number}", hidden)
    for number, content in enumerate(declared, 1):
        if content:
            files[f"clip{number}_declared.yaml"] = _yaml(hidden.value(content))
    files |= {name: _json(hidden.value(finite(one))) for name, one in documents.items()}
    files |= {name: f"{hidden.text(text)}\n".encode() for name, text in texts.items() if text}
    machine = f"{platform.system()} {platform.machine()}"
    files["versions.json"] = _json({**versions(), "operating system": machine})
    files = {"README.txt": _read_me(files), **files}
    with (
        one_line_of(f"{path}: the bundle"),
        replacing(path) as temporary,
        zipfile.ZipFile(temporary, "w") as archive,
    ):
        for name, data in files.items():
            archive.writestr(zipfile.ZipInfo(name, MADE), data, zipfile.ZIP_DEFLATED)
    return Bundle(path, tuple(files))


def _track_files(measured: Measurement, name: str, hidden: Impersonal) -> dict[str, bytes]:
    """A track and its yaml, which are fitted again as the clip was."""
    whole = measured.whole
    whole = replace(whole, names=tuple(hidden.text(one) for one in whole.names))
    files: dict[str, bytes] = {}
    with tempfile.TemporaryDirectory() as folder:
        track = Path(folder) / f"{name}.csv"
        write_observation_csv(track, whole)
        write_errors(beside(track), whole)
        for path in (track, beside(track)):
            if path.is_file():
                files[path.name] = path.read_bytes()
    given = _declared(measured.clip)
    content: dict[str, Any] = {"track": f"{name}.csv"}
    content |= {key: v for key, v in given.items() if key not in OF_PICTURE | OF_TABLE}
    content["objects"] = [
        {key: v for key, v in item.items() if key not in OF_OBJECTS}
        | {"name": hidden.text(item["name"])}
        for item in given["objects"]
    ]
    return {**files, f"{name}.yaml": _yaml(content)}


def _declared(clip: Clip) -> dict[str, Any]:
    """The keys of its yaml, with what was inferred filled in."""
    content = clip.model_dump(
        mode="json", include=set(ClipFile.model_fields), exclude_defaults=True
    )
    if clip.ramp_angle_deg is None or SCENARIOS[clip.scenario].angle_deg is not None:
        content.pop("ramp_angle_deg", None)
    return content


def _declared_beside(source: Path) -> dict[str, Any]:
    """What the yaml of a file says; empty where there is none, or it is none."""
    path = yaml_of(source)
    with contextlib.suppress(InputError):
        return dict(read_mapping(path)) if path.is_file() else {}
    return {}


def _json(content: Any) -> bytes:
    return (json.dumps(finite(content), indent=2) + "\n").encode()


def _yaml(content: Mapping[str, Any]) -> bytes:
    return yaml.safe_dump(dict(content), sort_keys=False, allow_unicode=True).encode()


def _command(words: Sequence[str], hidden: Impersonal) -> str:
    return shlex.join(hidden.text(word) for word in words)


def _files_of(clip: Clip) -> Iterable[Path]:
    others = (clip.path.parent / one.track_file for one in clip.objects if one.track_file)
    given = (clip.video, clip.track, clip.path, *others)
    return [Path(one) for one in (clip.source, *given) if one]


def _named_files(source: Path) -> list[Path]:
    declared = _declared_beside(source)
    more = [source.parent / str(declared[key]) for key in ("video", "track") if declared.get(key)]
    return [source, *more, *(source.with_suffix(suffix) for suffix in YAML_SUFFIXES)]


def _seen(source: Path) -> str:
    """What is seen in a file; why nothing is."""
    try:
        declared = _declared_beside(source) if source == yaml_of(source) else {}
        named = declared.get("video") or declared.get("track")
        return look(source.parent / str(named) if named else source).summary()
    except Exception as error:  # whatever it is, that is what is to be told
        return str(error)


def _clip(source: Path, answers: Mapping[str, Any]) -> Clip | None:
    """The checked clip; None where that is what failed."""
    with contextlib.suppress(Exception):
        return load_clip(source, **{key: v for key, v in answers.items() if key != "points"})
    return None


def _measured(clip: Clip) -> Measurement | None:
    """Where its objects were, where that is known; a film is not tracked anew for it."""
    with contextlib.suppress(Exception):
        return measure(clip) if clip.video is None or is_tracked(clip) else None
    return None


def _read_me(names: Iterable[str]) -> bytes:
    tracks = [name for name in names if name.endswith(".csv")]
    listed = [
        f"  {name:<22}{next((what for end, what in WHAT.items() if name.endswith(end)), '')}"
        for name in names
    ]
    again = AGAIN.format(tracks=" ".join(tracks)) if tracks else ""
    return READ_ME.format(again=again, files="\n".join(("", *listed))).encode()
