"""The measured and the simulated motion, with a slider.

Drawn over the frames of the video, or, of a csv track, over the scene from the side; page.js
moves the shapes.
"""

import json
from collections.abc import Mapping
from html import escape

import numpy as np

from galileo_jax.clip.schema import Clip
from galileo_jax.inference.problem import Problem
from galileo_jax.report.html_page import legend
from galileo_jax.report.side_view import View, outline, surfaces, view_of
from galileo_jax.report.style import object_colour
from galileo_jax.report.video_frames import VideoFrames, sample_frames
from galileo_jax.rollout.motion import pitch

MM = 1000.0  # per metre: the SVG's units
SLOWER = 3  # times slower than the clip
MOST_STEPS = 480  # of the slider, without a video
CROSS_PX, DOT_PX, PAGE_PX = 9.0, 3.2, 1000.0  # half a cross, a dot, on a page so wide


def animation(clip: Clip, problem: Problem, predicted_m: Mapping[str, np.ndarray]) -> str:
    """One clip's motion.

    Args:
      clip: where its video is still there, the frames are shown.
      problem: its observation and its scene.
      predicted_m: centres `[object, axis, frame]` by the name of the model; the last is drawn
        filled, those before it dashed.
    """
    observation = problem.observation
    # What flies in space is drawn from the side.
    predicted_m = {name: motion[:, :2] for name, motion in predicted_m.items()}
    models = list(predicted_m)
    offset = observation.offset_m(predicted_m[models[-1]])[..., None]
    count = len(observation.times_s)
    video = _frames(clip, count)
    # Over a frame, shapes stand around the tracked point, in a drawing around the centre.
    motions = {name: motion + offset * (video is not None) for name, motion in predicted_m.items()}
    motions["measured"] = observation.position_m[:, :2] - offset * (video is None)
    view = view_of(clip, problem.model.scene, np.stack(list(motions.values())))
    steps = list(video.frames if video else range(0, count, -(-count // MOST_STEPS)))
    data = {
        "times": observation.times_s[steps].round(4).tolist(),
        "motions": {name: _places(problem, one[..., steps]) for name, one in motions.items()},
        "pictures": list(video.pictures) if video else [],
        "slower": SLOWER,
    }
    encoded = json.dumps(data, separators=(",", ":")).replace("<", "\\u003c")
    name = escape(problem.name, quote=True)
    return (
        f'<figure class="motion" data-clip="{name}">'
        f"<figcaption>{escape(_caption(video, problem))}</figcaption>"
        f"{_stage(clip, problem, motions, models, view, video)}"
        f'<div class="controls"><button type="button">Play</button>'
        f'<input type="range" min="0" max="{len(steps) - 1}" value="0" '
        f'aria-label="time in {name}"><output></output></div>{_legend(problem, models, video)}'
        f'<script type="application/json">{encoded}</script></figure>'
    )


def _frames(clip: Clip, num_frames: int) -> VideoFrames | None:
    """None for a csv track, a clip without a place for its origin, a video that is gone.

    Nor where the picture is distorted, while the motion is drawn square.
    """
    has_origin = clip.origin_px is not None or clip.objects[0].point_px is not None
    if clip.video is None or not clip.video.is_file() or not clip.is_camera_plain or not has_origin:
        return None
    return sample_frames(clip.video, num_frames)


def _caption(video: VideoFrames | None, problem: Problem) -> str:
    keys = "Arrow keys move the slider frame by frame."
    if video is None:
        side = "above" if problem.model.scene.surroundings.is_level else "the side"
        return f"The scene from {side}. {keys}"
    step = video.frames[1] - video.frames[0] if len(video.frames) > 1 else 1
    every = "" if step == 1 else f" One frame in {step} is shown."
    return f"The clip, with the tracked points and the fitted motion drawn over it.{every} {keys}"


def _legend(problem: Problem, models: list[str], video: VideoFrames | None) -> str:
    scene, names = problem.model.scene.surroundings, problem.observation.names
    entries = [("fill", object_colour(i), f"{name}, {models[-1]}") for i, name in enumerate(names)]
    if len(models) > 1:
        entries.append(("dashed", "soft", ", ".join(models[:-1])))
    if video is None:
        return legend([*entries, ("line", "ink", "measured (outline; its path dotted)")])
    entries.append(("cross", "ink", "measured"))
    if scene.has_surface and not scene.is_level:
        entries.append(("line", "soft", "ramp and table as declared"))
    if scene.walls_m:
        entries.append(("line", "soft", "walls as declared"))
    return legend(entries)


def _stage(
    clip: Clip,
    problem: Problem,
    motions: Mapping[str, np.ndarray],
    models: list[str],
    view: View,
    video: VideoFrames | None,
) -> str:
    """The picture: a canvas for the video's frames, shapes over it."""
    width, height = (MM * side for side in view.size_m)
    left = -MM * view.right_m if view.is_mirrored else MM * view.left_m
    turn = ' transform="scale(-1 1)"' if view.is_mirrored else ""
    drawn = [_surface(slab, video is not None) for slab in surfaces(problem.model.scene, view)]
    drawn += map(_trail, motions["measured"])
    arm = CROSS_PX * width / PAGE_PX
    cross = f'<path d="M{-arm:.1f} 0H{arm:.1f}M0 {-arm:.1f}V{arm:.1f}"/>'
    bodies = [_body(clip, problem, i) for i in range(len(clip.objects))]
    for of in (*models, "measured"):
        for i, body in enumerate(bodies):
            colour = f"var(--{object_colour(i)})"
            look = f'fill="none" stroke="{colour}" stroke-dasharray="4 3"'
            if of == models[-1]:
                look = f'fill="{colour}" fill-opacity="{0.45 if video else 0.8}" stroke="{colour}"'
            if of == "measured":
                look = 'fill="none" stroke="currentColor" stroke-width="1.5"'
                body = cross if video else body
            name = escape(of, quote=True)
            drawn.append(f'<g data-of="{name}" data-object="{i}" {look}>{body}</g>')
    canvas = ""
    if video:
        canvas = f'<canvas width="{video.size_px[0]}" height="{video.size_px[1]}"></canvas>'
    names = escape(" and ".join(problem.observation.names), quote=True)
    return (
        f'<div class="stage{" filmed" if video else ""}" '
        f'style="aspect-ratio:{width:.1f}/{height:.1f}">{canvas}'
        f'<svg role="img" aria-label="{names}, measured and simulated, at the slider\'s time" '
        f'viewBox="{left:.1f} {-MM * view.top_m:.1f} {width:.1f} {height:.1f}">'
        f"<g{turn}>{''.join(drawn)}</g></svg></div>"
    )


def _trail(measured_m: np.ndarray) -> str:
    """Every measured place of an object as a dot."""
    x, y = measured_m[:, np.isfinite(measured_m).all(axis=0)]
    dots = "".join(f"M{a:.1f} {b:.1f}h0" for a, b in zip(MM * x, -MM * y, strict=True))
    look = f'fill="none" stroke="currentColor" stroke-width="{DOT_PX}" stroke-linecap="round"'
    return f'<path class="trail" d="{dots}" {look}/>'


def _places(problem: Problem, motion_m: np.ndarray) -> list[list[list[float] | None]]:
    """`[object][frame]` of x, y (mm, y down) and turn (degrees, clockwise); None where not seen."""
    scene = problem.model.scene.surroundings
    turned = pitch(np.nan_to_num(np.moveaxis(motion_m, 1, -1).swapaxes(0, 1)), scene).T
    rows = np.stack([MM * motion_m[:, 0], -MM * motion_m[:, 1], -np.degrees(turned)], axis=-1)
    return [
        [place if np.isfinite(place).all() else None for place in one]
        for one in rows.round(1).tolist()
    ]


def _body(clip: Clip, problem: Problem, index: int) -> str:
    if clip.objects[index].shape == "sphere" or problem.model.scene.surroundings.is_level:
        return f'<circle r="{MM * problem.model.scene.surroundings.half_length_m[index]:.1f}"/>'
    return f'<polygon points="{_points(outline(clip, problem.model.scene, index))}"/>'


def _surface(slab: np.ndarray, is_line: bool) -> str:
    if is_line:
        points = _points(slab[:2])
        return f'<polyline points="{points}" fill="none" stroke="currentColor" opacity="0.5"/>'
    return f'<polygon fill="var(--surface)" points="{_points(slab)}"/>'


def _points(corners_m: np.ndarray) -> str:
    return " ".join(f"{MM * x:.1f},{-MM * y:.1f}" for x, y in corners_m)
