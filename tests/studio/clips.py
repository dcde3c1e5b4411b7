"""Small rendered clips for the studio's tests, made once."""

import shutil
from functools import cache
from pathlib import Path
from tempfile import mkdtemp

import galileo_jax as gx


@cache
def _made() -> Path:
    folder = Path(mkdtemp(prefix="studio_clips_"))
    gx.simulate(folder / "slide.mp4", seed=5, seconds=1.5, size=(320, 180))
    return folder


def clip_in(folder: Path, name: str = "slide", *, is_bare: bool = False) -> Path:
    """A copy of the clip in a folder, with or without its yaml; returns the video."""
    for suffix in (".mp4",) if is_bare else (".mp4", ".yaml"):
        text = folder / f"{name}{suffix}"
        shutil.copy(_made() / f"slide{suffix}", text)
    if not is_bare and name != "slide":
        yaml = folder / f"{name}.yaml"
        yaml.write_text(yaml.read_text().replace("slide.mp4", f"{name}.mp4"))
    return folder / f"{name}.mp4"
