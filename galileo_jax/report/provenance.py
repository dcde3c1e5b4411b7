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
from galileo_jax.report import html_page as html

PACKAGES = ("jax", "jaxlib", "mujoco", "numpy", "scipy", "opencv-python-headless")


def provenance(command: str, clips: Iterable[Clip], facts: Mapping[str, str]) -> str:
    """The last section of a page.

    `facts`: more, plain text: engine, seed, timings, ...
    """
    clips = tuple(clips)
    kept, options = set(ClipFile.model_fields), {"sort_keys": False, "default_flow_style": None}
    declared = "\n---\n".join(
        yaml.safe_dump(clip.model_dump(mode="json", include=kept, exclude_none=True), **options)
        for clip in clips
    )
    hashes = {
        path.name: html.Html(f'<code title="SHA-256">{digest(path)}</code>')
        for path in inputs(clips)
    }
    return html.section(
        "Provenance",
        html.prose(
            "Inputs are identified by their SHA-256: the same hashes, versions and seed give the "
            "same page."
        ),
        html.listing(
            {"command": html.code(command), **facts, "versions": versions_text(), **hashes}
        ),
        html.details("The declaration of the clip", f"<pre>{escape(declared)}</pre>"),
    )


def versions_text() -> str:
    """All versions in one line."""
    return ", ".join(f"{name} {found}" for name, found in versions().items())


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
