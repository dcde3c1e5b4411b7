"""Measured against simulated motion from the side: inline SVG, a slider and a few lines of JS."""

import json
import math
from collections.abc import Mapping
from html import escape

import numpy as np

from galileo_jax.inference.problem import Problem
from galileo_jax.report.figure import COLOURS
from galileo_jax.report.side_view import MARGIN_M, SURFACE, View, surfaces
from galileo_jax.rollout.motion import pitch

MM = 1000.0  # per metre: the SVG's units
SLAB_MM = 12.0

SCRIPT = """
for (const box of document.querySelectorAll(".motion")) {
  const data = JSON.parse(box.querySelector("script").textContent);
  const slider = box.querySelector("input"), play = box.querySelector("button");
  const clock = box.querySelector("output");
  const shapes = [...box.querySelectorAll("[data-of]")];
  function show() {
    const frame = +slider.value;
    clock.value = data.times[frame].toFixed(2) + " s";
    for (const shape of shapes) {
      const place = data.motions[shape.dataset.of][shape.dataset.object][frame];
      shape.style.display = place ? "" : "none";
      if (place) shape.setAttribute("transform",
        `translate(${place[0]} ${place[1]}) rotate(${place[2]})`);
    }
  }
  let running = null, start = 0;
  function stop() { cancelAnimationFrame(running); running = null; play.textContent = "play"; }
  function tick(now) {
    const times = data.times, at = times[0] + (now - start) / 1000 / data.slower;
    let frame = times.findIndex((time) => time >= at);
    if (frame < 0) frame = times.length - 1;
    slider.value = frame; show();
    if (frame < times.length - 1) running = requestAnimationFrame(tick); else stop();
  }
  play.onclick = () => {
    if (running !== null) return stop();
    const from = +slider.value < data.times.length - 1 ? +slider.value : 0;
    start = performance.now() - 1000 * data.slower * (data.times[from] - data.times[0]);
    play.textContent = "stop"; running = requestAnimationFrame(tick);
  };
  slider.oninput = () => { if (running !== null) stop(); show(); };
  show();
}
"""
SLOWER = 3  # the clip's seconds take so many


def animation(
    problem: Problem, shapes: tuple[str, ...], predicted_m: Mapping[str, np.ndarray]
) -> str:
    """One clip's motion: measured in outline, each model's under it.

    Args:
      problem: the clip.
      shapes: of the objects, as the clip declares them.
      predicted_m: by what it is called `[object, 2, frame]`; the last is drawn full, those
        before it faint.
    """
    observation, scene = problem.observation, problem.model.scene
    measured = observation.position_m - _offset(problem, list(predicted_m.values())[-1])
    motions = {**predicted_m, "measured": measured}
    view = _view(problem, list(motions.values()))
    ground = "".join(_slab(*one) for one in surfaces(scene, view))
    drawn = []
    for k, name in enumerate(motions):
        for i, shape in enumerate(shapes):
            look = _look(name == "measured", k == len(motions) - 2, COLOURS[i])
            body = _body(problem, i, shape)
            drawn.append(
                f'<g data-of="{escape(name, quote=True)}" data-object="{i}" {look}>{body}</g>'
            )
    data = {
        "times": observation.times_s.round(4).tolist(),
        "motions": {name: _places(problem, motion) for name, motion in motions.items()},
        "slower": SLOWER,
    }
    left, top = MM * view.left_m, -MM * view.top_m
    size = (MM * (view.right_m - view.left_m), MM * (view.top_m - view.bottom_m))
    encoded = json.dumps(data, separators=(",", ":")).replace("<", "\\u003c")
    last = len(observation.times_s) - 1
    models = list(predicted_m)
    faint = f"; faint: {', '.join(models[:-1])}" if len(models) > 1 else ""
    return (
        f'<figure class="motion"><figcaption>{escape(problem.name)}: outline measured, '
        f"full {escape(models[-1])}{escape(faint)}.</figcaption>"
        f'<svg role="img" aria-label="motion" style="max-width:none" '
        f'viewBox="{left:.1f} {top:.1f} {size[0]:.1f} {size[1]:.1f}">{ground}{"".join(drawn)}</svg>'
        f'<div><button type="button">play</button> <input type="range" min="0" max="{last}" '
        f'value="0" aria-label="frame" style="width:60%"> <output></output></div>'
        f'<script type="application/json">{encoded}</script></figure>'
    )


def _offset(problem: Problem, predicted_m: np.ndarray) -> np.ndarray:
    """The followed points minus the centres, `[object, 2, 1]`."""
    observation = problem.observation
    found = np.zeros((len(observation.names), 2, 1))
    for i, seen in enumerate(observation.mask):
        if seen.any():
            difference = (observation.position_m[i] - predicted_m[i])[:, seen]
            found[i, :, 0] = np.median(difference, axis=1)
    return found


def _view(problem: Problem, motions: list[np.ndarray]) -> View:
    """All places with room round them."""
    places = np.concatenate([motion.transpose(0, 2, 1).reshape(-1, 2) for motion in motions])
    reach = MARGIN_M + max(problem.model.scene.surroundings.half_length_m)
    (left, bottom), (right, top) = (
        np.nanmin(places, axis=0) - reach,
        np.nanmax(places, axis=0) + reach,
    )
    return View(float(left), float(right), float(bottom), float(top), 0, 0, False)


def _places(problem: Problem, motion_m: np.ndarray) -> list[list[list[float] | None]]:
    """`[object][frame]` of x, y (mm, y down) and turn (degrees, clockwise); None where not seen."""
    scene = problem.model.scene.surroundings
    turned = pitch(np.nan_to_num(np.moveaxis(motion_m, 1, -1).swapaxes(0, 1)), scene).T
    found = []
    for i, (x, y) in enumerate(motion_m):
        rows = zip(MM * x, -MM * y, -np.degrees(turned[i]), strict=True)
        found.append(
            [[round(float(v), 1) for v in row] if np.isfinite(row).all() else None for row in rows]
        )
    return found


def _body(problem: Problem, index: int, shape: str) -> str:
    scene = problem.model.scene.surroundings
    length, height = MM * scene.half_length_m[index], MM * scene.half_height_m[index]
    if shape == "sphere":
        return f'<circle r="{length:.1f}"/>'
    return (
        f'<rect x="{-length:.1f}" y="{-height:.1f}" width="{2 * length:.1f}" '
        f'height="{2 * height:.1f}"/>'
    )


def _look(is_measured: bool, is_last: bool, colour: str) -> str:
    if is_measured:
        return 'fill="none" stroke="currentColor" stroke-width="2"'
    return f'fill="{colour}" fill-opacity="{0.8 if is_last else 0.25}"'


def _slab(corner: tuple[float, float], length_m: float, angle_rad: float) -> str:
    (x, y), far = corner, MM * length_m
    dx, dy = far * math.cos(angle_rad), -far * math.sin(angle_rad)
    x, y = MM * x, -MM * y
    return (
        f'<polygon fill="{SURFACE}" points="{x:.1f},{y:.1f} {x + dx:.1f},{y + dy:.1f} '
        f'{x + dx:.1f},{y + dy + SLAB_MM:.1f} {x:.1f},{y + SLAB_MM:.1f}"/>'
    )
