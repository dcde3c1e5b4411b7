"""The provenance of a page: the command, versions, seed, inputs by their hashes."""

import hashlib
import platform
from collections.abc import Iterable, Mapping
from html import escape
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import yaml

from galileo_jax import __version__
from galileo_jax.clip.schema import Clip, ClipFile
from galileo_jax.files.package_data import scene_path
from galileo_jax.report.html_page import details

PACKAGES = ("jax", "jaxlib", "mujoco", "numpy", "scipy", "opencv-python-headless")


def provenance(command: str, clips: Iterable[Clip], facts: Mapping[str, str]) -> str:
    """The last section of a page.

    `facts`: more, plain text: engine, seed, timings, ...
    """
    clips = tuple(clips)
    entries = {
        "command": f"<code>{escape(command)}</code>",
        **{key: escape(value) for key, value in facts.items()},
        "versions": escape(", ".join(f"{name} {found}" for name, found in versions().items())),
    }
    for path in inputs(clips):
        entries[escape(path.name)] = f'<code title="SHA-256">{digest(path)}</code>'
    listed = "".join(f"<dt>{key}</dt><dd>{value}</dd>" for key, value in entries.items())
    declared = "\n---\n".join(
        yaml.safe_dump(
            clip.model_dump(mode="json", include=set(ClipFile.model_fields), exclude_none=True),
            sort_keys=False,
            default_flow_style=None,
        )
        for clip in clips
    )
    return (
        "<h2>Provenance</h2>\n<p>Inputs are identified by their SHA-256: the same hashes, versions "
        f"and seed give the same page.</p>\n<dl>{listed}</dl>\n"
        + details("The declaration of the clip", f"<pre>{escape(declared)}</pre>")
    )


def versions() -> dict[str, str]:
    """Of this package, Python and the packages that numbers depend on."""
    found = {"galileo_jax": __version__, "Python": platform.python_version()}
    for name in PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return found


def inputs(clips: Iterable[Clip]) -> list[Path]:
    """The files that a result depends on and that are still there."""
    files = [path for clip in clips for path in (clip.video, clip.track, clip.path) if path]
    files.append(scene_path("ramp.xml"))
    return [path for path in dict.fromkeys(files) if path.is_file()]


def digest(path: Path) -> str:
    """SHA-256 of a file, hexadecimal."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()
