"""Pictures of a textured box with exactly known motion, for the tracking tests.

Drawn at four times the resolution and averaged down, as a sensor's pixels average: places are
right to a few thousandths of a pixel.
"""

from dataclasses import dataclass

import cv2
import numpy as np

FINE = 4


@dataclass(frozen=True)
class Box:
    """A box of `size_px` (width, height) with its own texture (by `seed`)."""

    size_px: tuple[int, int] = (32, 26)
    seed: int = 0

    def texture(self) -> np.ndarray:
        rng = np.random.default_rng(self.seed)
        width, height = (FINE * n for n in self.size_px)
        coarse = rng.integers(20, 236, (self.size_px[1] // 4, self.size_px[0] // 4))
        return cv2.resize(coarse.astype(np.float32), (width, height), interpolation=cv2.INTER_CUBIC)


@dataclass(frozen=True)
class Ringed(Box):
    """A box with a ring, off its middle, and a few letters beside it."""

    size_px: tuple[int, int] = (56, 38)
    ring_px: tuple[float, float] = (17.0, 17.0)  # the ring's middle, from the box's upper left
    letters: str = "TEE"

    def texture(self) -> np.ndarray:
        width, height = (FINE * n for n in self.size_px)
        drawn = np.full((height, width), 80, np.uint8)
        cv2.rectangle(drawn, (28, 28), (width - 29, height - 29), 205, -1)
        middle = tuple(round(FINE * n) for n in self.ring_px)
        cv2.circle(drawn, middle, 32, 90, -1, cv2.LINE_AA)
        cv2.circle(drawn, middle, 18, 180, -1, cv2.LINE_AA)
        place = (middle[0] + 40, middle[1] - 4)
        cv2.putText(drawn, self.letters, place, cv2.FONT_HERSHEY_SIMPLEX, 1.2, 30, 5)
        return drawn.astype(np.float32)


@dataclass(frozen=True)
class Labelled(Box):
    """A plain box with a label of 24 by 18 px, black and white, in its upper left corner."""

    size_px: tuple[int, int] = (60, 44)

    def texture(self) -> np.ndarray:
        width, height = (FINE * n for n in self.size_px)
        drawn = np.full((height, width), 105, np.float32)
        cells = np.random.default_rng(self.seed).permutation([0.0, 255.0] * 6).reshape(3, 4)
        label = np.kron(cells, np.ones((6 * FINE, 6 * FINE)))
        drawn[2 * FINE :, 2 * FINE :][: label.shape[0], : label.shape[1]] = label
        return drawn


@dataclass(frozen=True)
class Plain(Box):
    """A box of one grey."""

    size_px: tuple[int, int] = (38, 26)

    def texture(self) -> np.ndarray:
        return np.full((FINE * self.size_px[1], FINE * self.size_px[0]), 60, np.float32)


def scene(size_px: tuple[int, int], seed: int = 9) -> np.ndarray:
    """A quiet background, at the fine resolution, `[height, width]` float32."""
    rng = np.random.default_rng(seed)
    width, height = (FINE * n for n in size_px)
    spots = cv2.resize(rng.normal(size=(12, 20)).astype(np.float32), (width, height))
    return 130 + 12 * spots


def shoot(
    background: np.ndarray,
    boxes: list[tuple[Box, np.ndarray]],
    noise: float,
    rng: np.random.Generator,
) -> np.ndarray:
    """One uint8 BGR frame; each box comes with its poses `[sub-frame, 3]` in the exposure."""
    total = np.zeros_like(background)
    samples = len(boxes[0][1]) if boxes else 1
    for sample in range(samples):
        picture = background.copy()
        for box, poses in boxes:
            paste(picture, box, poses[sample])
        total += picture / samples
    grey = cv2.resize(total, None, fx=1 / FINE, fy=1 / FINE, interpolation=cv2.INTER_AREA)
    grey = np.clip(np.round(grey + rng.normal(0, noise, grey.shape)), 0, 255).astype(np.uint8)
    return cv2.cvtColor(grey, cv2.COLOR_GRAY2BGR)


def paste(picture: np.ndarray, box: Box, pose: np.ndarray) -> None:
    """Draws `box` into the fine `picture` at `(x, y, angle)`, pixels of the small picture."""
    texture = box.texture()
    height, width = texture.shape
    c, s = np.cos(pose[2]), np.sin(pose[2])
    turn = np.array([[c, -s], [s, c]])
    centre = FINE * (pose[:2] + 0.5) - 0.5
    shift = centre - turn @ ((width - 1) / 2, (height - 1) / 2)
    warp = np.column_stack([turn, shift])
    size = picture.shape[::-1]
    drawn = cv2.warpAffine(texture, warp, size, borderMode=cv2.BORDER_REPLICATE)
    mask = cv2.warpAffine(np.ones_like(texture), warp, size)
    picture[:] = mask * drawn + (1 - mask) * picture


def exposed(poses: np.ndarray, index: int, share: float, samples: int = 7) -> np.ndarray:
    """Poses `[samples, 3]` during the exposure centred on frame `index`, piecewise linear."""
    frames = np.arange(-1, len(poses) + 1)
    longer = np.concatenate([2 * poses[:1] - poses[1:2], poses, 2 * poses[-1:] - poses[-2:-1]])
    at = index + share * np.linspace(-0.5, 0.5, samples)
    return np.stack([np.interp(at, frames, longer[:, k]) for k in range(3)], axis=1)


def film(
    paths: list[tuple[Box, np.ndarray]],
    *,
    size_px: tuple[int, int] = (240, 120),
    noise: float = 3.0,
    share: float = 0.0,
    seed: int = 1,
) -> list[np.ndarray]:
    """The frames of boxes that follow their paths, each `[frame, 3]` of `(x, y, angle)`."""
    rng = np.random.default_rng(seed)
    background = scene(size_px)
    samples = 7 if share else 1
    return [
        shoot(
            background,
            [
                (box, exposed(path, index, share, samples) if share else path[index][None])
                for box, path in paths
            ],
            noise,
            rng,
        )
        for index in range(len(paths[0][1]))
    ]


def slide(frames: int = 40, turn_at: int = 24, turn_rad: float = -0.35) -> np.ndarray:
    """A box speeds up, turns within two frames (as at the foot of a ramp), slows down."""
    time = np.arange(frames, dtype=float)
    down = np.minimum(time, turn_at)
    flat = np.maximum(time - turn_at, 0)
    speed = 0.3 * turn_at
    along = 0.15 * down**2 + np.where(flat > 0, speed * flat - 0.14 * flat**2, 0)
    on_ramp = np.minimum(along, 0.15 * turn_at**2)
    after = along - on_ramp
    x = 40.3 + on_ramp * np.cos(turn_rad) + after
    y = 40.7 - on_ramp * np.sin(turn_rad)
    angle = turn_rad * np.clip((time - turn_at + 1) / 2, 0, 1)
    return np.stack([x, y, angle], axis=1)


RELEASE = 10
"""The frame of `throw` in which the hand lets go."""


def throw(size_px: tuple[int, int] = (320, 200)) -> tuple[list[np.ndarray], np.ndarray]:
    """Pictures of a hand that throws a ball, green and as bright as the wall behind; its path."""
    time = np.arange(36.0)
    held, since = np.minimum(time, RELEASE), np.maximum(time - RELEASE, 0)
    ball = np.stack([40 + 4 * held + 8 * since, 150 - 4 * held - 7 * since + 0.35 * since**2], 1)
    hand = np.stack([34 + 4 * held, 158 - 4 * held, 0 * time], axis=1)
    frames = film([(Box((28, 24), seed=7), hand)], size_px=size_px)
    for frame, (x, y) in zip(frames, ball, strict=True):
        cv2.circle(frame, (round(16 * x), round(16 * y)), 16 * 6, (40, 170, 80), -1, cv2.LINE_AA, 4)
    return frames, ball
