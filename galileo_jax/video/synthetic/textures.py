"""Seeded textures: what objects, wood, wall and skin look like. Colours are BGR, 0 to 255."""

import colorsys
from dataclasses import dataclass

import cv2
import numpy as np


@dataclass(frozen=True)
class Body:
    """An object as the camera sees it, from the side."""

    outline_m: tuple[float, float]  # length along the travel and height of what is seen
    # whether its ends are half circles, as of a ball, or of a ring that lies; else they are square
    is_round: bool = False


def body_texture(body: Body, texels_per_metre: float, rng: np.random.Generator) -> np.ndarray:
    """Returns `[height, width, 4]` float32, premultiplied, transparent around the object.

    A light or dark ground with patches of many sizes and hues: enough corners to follow.
    """
    width, height = (max(8, round(side * texels_per_metre)) for side in body.outline_m)
    ground = _colour(rng, saturation=(0.1, 0.5), value=(0.55, 0.95))
    picture = np.full((height, width, 3), ground, np.float32)
    short_side = min(width, height)
    for size in np.geomspace(0.50, 0.10, 40) * short_side:
        centre = rng.uniform((0, 0), (width, height))
        colour = _colour(rng, saturation=(0.2, 0.9), value=(0.1, 1.0))
        turn = rng.uniform(0, 2 * np.pi)
        corners = rng.integers(3, 7)
        spokes = turn + np.linspace(0, 2 * np.pi, corners, endpoint=False)
        radii = size * rng.uniform(0.4, 0.8, corners)
        outline = centre + radii[:, None] * np.stack([np.cos(spokes), np.sin(spokes)], axis=-1)
        cv2.fillPoly(picture, [_fixed_point(outline)], colour, cv2.LINE_AA, _SHIFT)
    picture *= 1 + 0.08 * _smooth_noise((height, width), short_side / 4, rng)[..., None]
    alpha = _silhouette(body, width, height)
    edge = cv2.erode(alpha, np.ones((3, 3)), iterations=max(1, short_side // 60))
    picture *= 0.35 + 0.65 * edge[..., None]
    return _premultiplied(picture, alpha)


def hand_texture(
    length_m: float, texels_per_metre: float, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Returns a sleeved arm with fingers, along +x, and where the finger tips are in it.

    Returns:
      `[height, width, 4]` float32, premultiplied, and the texel (x, y) of the tips.
    """
    unit = texels_per_metre / 1000  # one millimetre
    width, height = round(length_m * texels_per_metre), round(110 * unit)
    middle = height / 2
    alpha = np.zeros((height, width), np.float32)
    skin = np.array(_colour(rng, hue=(0.02, 0.08), saturation=(0.3, 0.6), value=(0.45, 0.9)))
    sleeve = np.array(_colour(rng, saturation=(0.1, 0.8), value=(0.15, 0.8)))
    picture = np.full((height, width, 3), skin, np.float32)
    for finger in range(4):
        y = middle + (finger - 1.5) * 13 * unit
        knuckle = np.array([55 * unit, middle + (finger - 1.5) * 15 * unit])
        tip = np.array([(7 + 4 * abs(finger - 1.2)) * unit, y])
        thickness = round(11 * unit)
        ends = [_fixed_point(end)[0].tolist() for end in (knuckle, tip)]
        cv2.line(alpha, ends[0], ends[1], 1.0, thickness, cv2.LINE_AA, _SHIFT)
        shade = (skin * 0.85).tolist()
        cv2.line(picture, ends[0], ends[1], shade, thickness, cv2.LINE_AA, _SHIFT)
    palm = np.array([[45, -34], [90, -38], [130, -27], [130, 27], [90, 36], [45, 32]]) * unit
    cv2.fillPoly(alpha, [_fixed_point(palm + np.array([0, middle]))], 1.0, cv2.LINE_AA, _SHIFT)
    arm = slice(round(middle - 30 * unit), round(middle + 30 * unit))
    alpha[arm, round(125 * unit) :] = 1.0
    picture[:, round(190 * unit) :] = sleeve
    picture *= 1 + 0.10 * _smooth_noise((height, width), 12 * unit, rng)[..., None]
    return _premultiplied(picture, alpha), np.array([3 * unit, middle])


def wood(size_px: tuple[int, int], rng: np.random.Generator) -> np.ndarray:
    """Returns `[height, width, 3]` float32 wood with its grain along x."""
    width, height = size_px
    grain = _smooth_noise((height, width), (width / 25, 1.6), rng)
    broad = _smooth_noise((height, width), (width / 8, height / 20), rng)
    shade = 1 + 0.09 * grain + 0.06 * broad
    colour = _colour(rng, hue=(0.02, 0.13), saturation=(0.3, 0.55), value=(0.4, 0.7))
    return shade[..., None] * np.array(colour, np.float32)


def wall(size_px: tuple[int, int], rng: np.random.Generator) -> np.ndarray:
    """Returns `[height, width, 3]` float32: a plastered wall with a few pictures on it."""
    width, height = size_px
    plaster = _colour(rng, saturation=(0.05, 0.3), value=(0.5, 0.85))
    picture = np.full((height, width, 3), plaster, np.float32)
    for _ in range(rng.integers(3, 7)):
        centre = rng.uniform((0, 0), (width, 0.75 * height))
        half = rng.uniform(0.04, 0.12, 2) * width
        tilt = rng.normal(0, 3.0)
        corners = cv2.boxPoints((centre.tolist(), (2 * half).tolist(), tilt))
        colour = _colour(rng, saturation=(0.1, 0.6), value=(0.3, 0.9))
        cv2.fillPoly(picture, [_fixed_point(corners)], colour, cv2.LINE_AA, _SHIFT)
    picture *= 1 + 0.05 * _smooth_noise((height, width), width / 15, rng)[..., None]
    picture *= 1 + 0.025 * _smooth_noise((height, width), 2.5, rng)[..., None]
    return picture


_SHIFT = 6  # OpenCV draws at 1/64 texel


def _fixed_point(points: np.ndarray) -> np.ndarray:
    return np.round(np.atleast_2d(points) * 2**_SHIFT).astype(np.int32)


def _silhouette(body: Body, width: int, height: int) -> np.ndarray:
    """A rectangle, or a bar with half-circles at its ends (a ball has no bar between)."""
    if not body.is_round:
        return np.ones((height, width), np.float32)
    y, x = np.mgrid[:height, :width].astype(np.float32)
    past_bar = np.maximum(np.abs(x - (width - 1) / 2) - (width - height) / 2, 0)
    return np.clip(height / 2 - np.hypot(past_bar, y - (height - 1) / 2), 0, 1)


def _premultiplied(picture: np.ndarray, alpha: np.ndarray) -> np.ndarray:
    """Adds alpha and a transparent rim, so that interpolation fades out at the edge."""
    colour = np.clip(picture, 0, 255) * alpha[..., None]
    return np.pad(np.dstack([colour, alpha]).astype(np.float32), ((1, 1), (1, 1), (0, 0)))


def _smooth_noise(
    shape: tuple[int, int], scale: float | tuple[float, float], rng: np.random.Generator
) -> np.ndarray:
    """Returns noise of unit spread, smooth over `scale` texels (or along x and y)."""
    scale_x, scale_y = scale if isinstance(scale, tuple) else (scale, scale)
    # Smoothed on a grid as coarse as the scale allows: a wide blur is slow on the fine one.
    step_x, step_y = (max(1.0, scale / 2) for scale in (scale_x, scale_y))
    coarse = int(np.ceil(shape[0] / step_y)) + 1, int(np.ceil(shape[1] / step_x)) + 1
    noise = rng.standard_normal(coarse, np.float32)
    noise = cv2.GaussianBlur(noise, (0, 0), sigmaX=scale_x / step_x, sigmaY=scale_y / step_y)
    noise = cv2.resize(noise, shape[::-1], interpolation=cv2.INTER_CUBIC)
    return noise / max(float(noise.std()), 1e-9)


def _colour(
    rng: np.random.Generator,
    *,
    hue: tuple[float, float] = (0.0, 1.0),
    saturation: tuple[float, float],
    value: tuple[float, float],
) -> tuple[float, float, float]:
    red, green, blue = colorsys.hsv_to_rgb(
        rng.uniform(*hue), rng.uniform(*saturation), rng.uniform(*value)
    )
    return 255 * blue, 255 * green, 255 * red
