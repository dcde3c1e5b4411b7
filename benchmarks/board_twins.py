"""Synthetic twins of the board's clips: how much of a misfit does the tracker make?

    python benchmarks/board_twins.py FOLDER [--codec VP80|mp4v]

FOLDER has slide_r1 and slide_r2 (.mp4 and .yaml). A twin has the clip's own frames after the block
has left, in their order, so that wall, board, light, grain and the first coder's errors are real;
the block's own picture (the median of its patches) slides over them along a straight line with
constant acceleration, smeared by an exposure of half a frame, with grain of its own; and it is
coded once more (VP80 at 2 Mbit/s, or mp4v at 0.4 Mbit/s, half of the clips' own rate). Printed
for each: the tracker's error along the way once a parabola in time is taken out, its change of the
acceleration, and the clip's own misfit of a parabola by the same measure.
"""

import argparse
import tempfile
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

import galileo_jax as gx

CLIPS = ("slide_r1", "slide_r2")
SUFFIX = {"VP80": ".webm", "mp4v": ".mp4"}
FPS, EXPOSURE, INSTANTS = 240.0, 0.5, 5
RADIUS_PX, BLOCK_PX = 14, 12.0  # of the patch, and of the block
CLEAR_PX = 20.0  # from the start on: the hand is off
GRAIN = 2.5  # grey levels
SEED = 0


@dataclass(frozen=True)
class Slide:
    """A path along a straight line, px and s: `[frame]` along it, with where it begins."""

    start_px: np.ndarray
    way: np.ndarray
    parabola: np.ndarray  # coefficients of the distance in time
    frames: int

    def place(self, time_s: float) -> np.ndarray:
        """The block's centre; at rest until the parabola's vertex."""
        half, slope, _ = self.parabola
        return self.start_px + half * max(time_s + slope / (2 * half), 0.0) ** 2 * self.way


def parabola_misfit(times_s: np.ndarray, along_px: np.ndarray) -> tuple[np.ndarray, float]:
    """Coefficients of the parabola and the rms of what it leaves, px."""
    found = np.polyfit(times_s, along_px, 2)
    return found, float(np.std(along_px - np.polyval(found, times_s)))


def slide_of(track: gx.Track) -> tuple[Slide, float]:
    """A clip's twin motion, and its own misfit of a parabola, px."""
    pixels = track.pixels
    assert pixels is not None
    places, seen = pixels.position_px[0], np.flatnonzero(track.observation.mask[0])
    line = np.polyfit(places[seen, 0], places[seen, 1], 1)
    way = np.array([-1.0, -line[0]]) / np.hypot(1.0, line[0])
    start = np.median(places[:40], axis=0)
    along = (places - start) @ way
    used = seen[along[seen] > CLEAR_PX]
    parabola, misfit = parabola_misfit(pixels.times_s[used], along[used])
    return Slide(start, way, parabola, int(seen[-1]) - 4), misfit


def block_of(frames: list[np.ndarray], empty: np.ndarray, track: gx.Track) -> tuple:
    """The block's picture and its opacity, `[row, column(, 3)]`, from where the hand is off."""
    assert track.pixels is not None
    seen = np.flatnonzero(track.observation.mask[0])
    size = (2 * RADIUS_PX + 1,) * 2
    patches = []
    for frame in seen[len(seen) // 3 :: 3]:
        x, y = map(float, track.pixels.position_px[0, frame])
        patches.append([cv2.getRectSubPix(one, size, (x, y)) for one in (frames[frame], empty)])
    with_block, without = np.moveaxis(np.array(patches), 1, 0)
    contrast = np.abs(np.median(with_block - without, axis=0)).max(axis=-1)
    rows, columns = np.indices(size) - RADIUS_PX
    opacity = np.clip((contrast - 12.0) / 25.0, 0.0, 1.0) * (np.hypot(rows, columns) < BLOCK_PX)
    opacity = cv2.GaussianBlur(opacity.astype(np.float32), (0, 0), 0.5)
    return np.median(with_block, axis=0).astype(np.float32), opacity


def film(path: Path, codec: str, slide: Slide, block: tuple, free: list[np.ndarray]) -> np.ndarray:
    """Writes a twin; returns its true places `[frame, 2]`, px."""
    picture, opacity = block
    size = free[0].shape[1::-1]
    rng = np.random.default_rng(SEED)
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*codec), 29.97, size)
    for i in range(slide.frames):
        colour, cover = np.zeros_like(free[0]), np.zeros(size[::-1], np.float32)
        for k in range(INSTANTS):
            time_s = (i + ((k + 0.5) / INSTANTS - 0.5) * EXPOSURE) / FPS
            x, y = slide.place(time_s) - RADIUS_PX
            move = np.array([[1.0, 0.0, x], [0.0, 1.0, y]])
            laid = (picture * opacity[..., None], opacity)
            shifted = [cv2.warpAffine(one, move, size, flags=cv2.INTER_CUBIC) for one in laid]
            colour, cover = colour + shifted[0] / INSTANTS, cover + shifted[1] / INSTANTS
        grain = GRAIN * rng.standard_normal(colour.shape) * cover[..., None]
        frame = free[i % len(free)] * (1 - cover[..., None]) + colour + grain
        writer.write(np.clip(np.rint(frame), 0, 255).astype(np.uint8))
    writer.release()
    return np.array([slide.place(i / FPS) for i in range(slide.frames)])


def twin(folder: Path, name: str, codec: str, out: Path) -> str:
    """Makes and tracks one twin; a line of the table."""
    track = gx.track(folder / f"{name}.yaml")
    slide, misfit = slide_of(track)
    frames = [one.astype(np.float32) for one in gx_frames(folder / f"{name}.mp4")]
    free = frames[slide.frames + 20 :]
    block = block_of(frames, np.median(np.stack(free[::2]), axis=0), track)
    video = out / f"{name}_twin{SUFFIX[codec]}"
    true = film(video, codec, slide, block, free)
    text = (folder / f"{name}.yaml").read_text().replace(f"{name}.mp4", video.name)
    at = f"point_px: [{slide.start_px[0]:.2f}, {slide.start_px[1]:.2f}] #"
    video.with_suffix(".yaml").write_text(text.replace("point_px:", at))
    pixels = gx.track(video.with_suffix(".yaml")).pixels
    assert pixels is not None
    seen = np.flatnonzero(pixels.is_visible[0][: len(true)])
    seen = seen[(true[seen] - slide.start_px) @ slide.way > CLEAR_PX]
    errors = (pixels.position_px[0, seen] - true[seen]) @ slide.way
    parabola, left = parabola_misfit(seen / FPS, errors)
    change = parabola[0] / slide.parabola[0]
    return f"{name:10} {codec:6} {left:12.3f} {100 * change:16.2f} {misfit:14.3f}"


def gx_frames(path: Path) -> list[np.ndarray]:
    """All frames of a video."""
    from galileo_jax.video import decode

    return list(decode.frames(path))


def main() -> None:
    """Prints the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--codec", choices=SUFFIX, nargs="+", default=list(SUFFIX))
    asked = parser.parse_args()
    print("clip       codec  tracker's px  acceleration, %  clip's own, px")
    with tempfile.TemporaryDirectory() as out:
        for name in CLIPS:
            if not (asked.folder / f"{name}.yaml").is_file():
                print(f"{name}: not in {asked.folder}; skipped")
                continue
            for codec in asked.codec:
                print(twin(asked.folder, name, codec, Path(out)), flush=True)


if __name__ == "__main__":
    main()
