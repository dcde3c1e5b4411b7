"""Small rendered clips for the studio's tests, made once."""

import shutil
from functools import cache
from pathlib import Path
from tempfile import mkdtemp

import cv2
import numpy as np

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


def still_film(path: Path) -> Path:
    """A film in which nothing moves."""
    picture = np.random.default_rng(1).integers(0, 255, (120, 160, 3), np.uint8)
    code = cv2.VideoWriter.fourcc(*"mp4v")
    film = cv2.VideoWriter(str(path), code, 30.0, (160, 120))
    for _ in range(20):
        film.write(cv2.GaussianBlur(picture, (9, 9), 0))
    film.release()
    return path
