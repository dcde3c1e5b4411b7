"""Drawing the frames: every texture goes through one homography per instant.

Each object's texture is glued to it. For a frame it is warped to a grid several times finer
than the pixels at enough instants of the exposure that it moves half a pixel between two,
averaged over these (motion blur) and over each pixel's area, and laid over the still
background with the averaged coverage as its opacity. Nothing is ever rounded to a pixel.
"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from galileo_jax.video.encode import writing_mp4
from galileo_jax.video.synthetic.filming import (
    Camera,
    Filming,
    Hand,
    placed,
    project,
    sway,
    turned_camera,
)
from galileo_jax.video.synthetic.textures import Body, body_texture, hand_texture, wall, wood

SUPERSAMPLING = 3
LONGEST_STEP_PX = 0.5  # between two instants of one exposure
HAND_LENGTH_M = 1.2
TABLE_TOP_M = 0.06


@dataclass(frozen=True)
class Motion:
    """Where the objects are; linear between the times, at rest before and after."""

    times_s: np.ndarray  # `[time]`, s, ascending
    position_m: np.ndarray  # `[object, 2, time]`, centres, x along the travel, y up, m
    pitch_rad: np.ndarray  # `[object, time]`, counter-clockwise positive with x right and y up

    def at(self, time_s: float) -> tuple[np.ndarray, np.ndarray]:
        """Returns positions `[object, 2]` and pitch `[object]`."""
        index = np.interp(time_s, self.times_s, np.arange(len(self.times_s)))
        before = min(int(index), len(self.times_s) - 2)
        weight = index - before
        pair = slice(before, before + 2)
        blend = np.array([1 - weight, weight])
        return self.position_m[..., pair] @ blend, self.pitch_rad[..., pair] @ blend


@dataclass(frozen=True)
class Ramp:
    """The ramp: its angle and the length of its slope, from the foot at the origin up."""

    angle_rad: float
    length_m: float


@dataclass(frozen=True)
class Layer:
    """What one thing adds to a frame."""

    window: tuple[slice, slice]  # rows and columns of the frame
    colour: np.ndarray  # `[row, column, 3]`, premultiplied
    opacity: np.ndarray  # `[row, column]`, 0 to 1

    def over(self, picture: np.ndarray) -> None:
        """Lays the layer over `picture`, in place."""
        view = picture[self.window]
        view *= 1 - self.opacity[..., None]
        view += self.colour


@dataclass(frozen=True)
class Frame:
    """One frame."""

    picture: np.ndarray  # `[height, width, 3]`, uint8, BGR
    covered: tuple[float, ...]  # `[object]`, the share of each object's picture that the hand hides


def write_clip(
    path: Path,
    frames: Iterable[Frame],
    camera: Camera,
    filming: Filming,
    on_frame: Callable[[], object] = lambda: None,
) -> np.ndarray:
    """Writes frames to `path`, whole or not at all; `on_frame` is called after each (progress).

    The codec moves what it shows by 0.01 to 0.02 px RMS; a file of MJPEG would be four times as
    large.

    Returns:
      `[object, frame]`, the share of each object that the hand hides, 0 to 1.
    """
    covered = []
    with writing_mp4(path, filming.written_fps or filming.fps, camera.size_px) as writer:
        for frame in frames:
            writer.write(frame.picture)
            covered.append(frame.covered)
            on_frame()
    return np.array(covered).T


def render_frames(
    motion: Motion,
    bodies: tuple[Body, ...],
    camera: Camera,
    ramp: Ramp | None,
    filming: Filming,
    num_frames: int,
    *,
    seed: int,
) -> Iterator[Frame]:
    """Yields the frames, one at a time.

    The same seed gives the same frames. Looks, noise and sway have streams of their own: a
    clip with another noise level or another motion shows the same things.
    """
    looks, noise = (np.random.default_rng([seed, stream]) for stream in (0, 1))
    texels_per_metre = camera.pixels_per_metre * SUPERSAMPLING
    backdrop = draw_backdrop(camera, ramp, looks)
    textures = [body_texture(body, texels_per_metre, looks) for body in bodies]
    hand = hand_texture(HAND_LENGTH_M, texels_per_metre, looks) if filming.hand else None
    turns = sway(filming, num_frames, np.random.default_rng([seed, 2]))
    latest: Frame | None = None
    for index in range(num_frames):
        brightness = 1 + filming.flicker * noise.standard_normal()
        grain = noise.standard_normal(backdrop.shape, np.float32)
        if latest is not None and index in filming.repeated_frames:
            yield latest
            continue
        instants = _instants(motion, camera, filming, index / filming.fps)
        poses = [motion.at(instant) for instant in instants]
        layers = []
        for body, texture in enumerate(textures):
            to_metres = _texels_to_metres(_middle(texture), texels_per_metre)
            where = [placed(position[body], pitch[body]) @ to_metres for position, pitch in poses]
            layers.append(_layer(texture, where, camera))
        picture = backdrop.copy()
        for layer in filter(None, layers):
            layer.over(picture)
        covered = (0.0,) * len(bodies)
        if filming.hand and hand:
            held_m = motion.position_m[0, :, 0]
            to_metres = _texels_to_metres(hand[1], texels_per_metre)
            where = [_hand_pose(filming.hand, held_m, t) @ to_metres for t in instants]
            if hand_layer := _layer(hand[0], where, camera):
                covered = tuple(_covered(layer, hand_layer, camera.size_px) for layer in layers)
                hand_layer.over(picture)
        if filming.sway_rad:
            there = turned_camera(turns[index], camera.size_px)
            picture = cv2.warpPerspective(
                picture, there, camera.size_px, None, cv2.INTER_LANCZOS4, cv2.BORDER_REFLECT
            )
        if filming.defocus_px:
            picture = cv2.GaussianBlur(picture, (0, 0), filming.defocus_px)
        picture = picture * brightness + filming.noise_grey_levels * grain
        latest = Frame(np.clip(np.rint(picture), 0, 255).astype(np.uint8), covered)
        yield latest


def draw_backdrop(camera: Camera, ramp: Ramp | None, rng: np.random.Generator) -> np.ndarray:
    """Returns wall, table and ramp as the camera sees them, `[height, width, 3]` float32."""
    width, height = camera.size_px
    fine = (width * SUPERSAMPLING, height * SUPERSAMPLING)
    to_fine = _to_fine(0, 0) @ camera.world_to_image
    canvas = wall(fine, rng)
    reach = 4 * width / camera.pixels_per_metre
    top, front = wood((2400, 120), rng), wood((2400, 240), rng) * 0.6
    _lay(canvas, top, to_fine, (-reach, 0.0), (reach, -TABLE_TOP_M), 0.0)
    _lay(canvas, front, to_fine, (-reach, -TABLE_TOP_M), (reach, -reach), 0.0)
    boards = wood((1200, 600), rng)
    if ramp:
        across, up = ramp.length_m * np.cos(ramp.angle_rad), ramp.length_m * np.sin(ramp.angle_rad)
        corners = project(to_fine, np.array([[0.0, 0.0], [-across, up], [-across, 0.0]]))
        triangle = np.zeros(canvas.shape[:2], np.float32)
        cv2.fillPoly(triangle, [np.rint(corners * 64).astype(np.int32)], 1.0, cv2.LINE_AA, 6)
        side = canvas.copy()
        _lay(side, boards, to_fine, (-ramp.length_m, 0.0), (0.0, -ramp.length_m), -ramp.angle_rad)
        canvas += triangle[..., None] * (side - canvas)
    return cv2.resize(np.clip(canvas, 0, 255), (width, height), interpolation=cv2.INTER_AREA)


def _lay(
    canvas: np.ndarray,
    texture: np.ndarray,
    to_canvas: np.ndarray,
    upper_left_m: tuple[float, float],
    lower_right_m: tuple[float, float],
    turn_rad: float,
) -> None:
    """Stretches `texture` over a rectangle, turned about the origin, in place."""
    height, width = texture.shape[:2]
    (left, top), (right, bottom) = upper_left_m, lower_right_m
    to_rectangle = np.array(
        [[(right - left) / width, 0, left], [0, (bottom - top) / height, top], [0, 0, 1]]
    )
    matrix = to_canvas @ placed((0.0, 0.0), turn_rad) @ to_rectangle
    cv2.warpPerspective(
        texture,
        matrix,
        canvas.shape[1::-1],
        dst=canvas,
        flags=cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_TRANSPARENT,
    )


def _instants(motion: Motion, camera: Camera, filming: Filming, time_s: float) -> np.ndarray:
    """Returns instants of the exposure, close enough for smooth motion blur."""
    ends = time_s + filming.exposure_s * np.array([-0.5, 0.5])
    (start, _), (end, _) = motion.at(ends[0]), motion.at(ends[1])
    distance_px = np.abs(end - start).max() * camera.pixels_per_metre
    if filming.hand and ends[1] > filming.hand.leave_s:
        moved_m = filming.hand.speed_m_s * filming.exposure_s
        distance_px = max(distance_px, moved_m * camera.pixels_per_metre)
    count = 1 + int(np.ceil(distance_px / LONGEST_STEP_PX))
    return ends[0] + filming.exposure_s * (np.arange(count) + 0.5) / count


def _layer(texture: np.ndarray, to_metres: list[np.ndarray], camera: Camera) -> Layer | None:
    """Draws a texture at several instants and averages; None = outside the picture."""
    height, width = texture.shape[:2]
    to_image = [camera.world_to_image @ matrix for matrix in to_metres]
    corners = np.array([[0, 0], [width, 0], [width, height], [0, height]])
    reached = np.concatenate([project(matrix, corners) for matrix in to_image])
    low = np.maximum(np.floor(reached.min(axis=0)).astype(int) - 1, 0)
    high = np.minimum(np.ceil(reached.max(axis=0)).astype(int) + 2, camera.size_px)
    if (high <= low).any():
        return None
    size = high - low
    total = np.zeros((size[1] * SUPERSAMPLING, size[0] * SUPERSAMPLING, 4), np.float32)
    for matrix in to_image:
        total += cv2.warpPerspective(
            texture, _to_fine(*low) @ matrix, total.shape[1::-1], flags=cv2.INTER_LINEAR
        )
    total /= len(to_image)
    drawn = cv2.resize(total, size.tolist(), interpolation=cv2.INTER_AREA)
    window = (slice(low[1], high[1]), slice(low[0], high[0]))
    return Layer(window, drawn[..., :3], drawn[..., 3])


def _to_fine(left: int, top: int) -> np.ndarray:
    """From pixels to the finer grid of a window; middles of pixels are whole in both."""
    fine, shift = SUPERSAMPLING, (SUPERSAMPLING - 1) / 2
    return np.array([[fine, 0, shift - fine * left], [0, fine, shift - fine * top], [0, 0, 1]])


def _middle(texture: np.ndarray) -> tuple[float, float]:
    height, width = texture.shape[:2]
    return (width - 1) / 2, (height - 1) / 2


def _texels_to_metres(
    about: tuple[float, float] | np.ndarray, texels_per_metre: float
) -> np.ndarray:
    """From texels to metres about one of them, y up."""
    (x, y), scale = about, 1 / texels_per_metre
    return np.array([[scale, 0, -x * scale], [0, -scale, y * scale], [0, 0, 1]])


def _hand_pose(hand: Hand, held_m: np.ndarray, time_s: float) -> np.ndarray:
    drawn_back_m = hand.speed_m_s * max(0.0, time_s - hand.leave_s)
    arm = np.array([np.cos(hand.angle_rad), np.sin(hand.angle_rad)])
    return placed(held_m + hand.offset_m + drawn_back_m * arm, hand.angle_rad)


def _covered(layer: Layer | None, hand: Layer, size_px: tuple[int, int]) -> float:
    """The share of a layer that a hand hides."""
    if layer is None:
        return 0.0
    whole = np.zeros(size_px[::-1], np.float32)
    whole[hand.window] = hand.opacity
    hidden = layer.opacity * whole[layer.window]
    return float(hidden.sum() / max(float(layer.opacity.sum()), 1e-9))
