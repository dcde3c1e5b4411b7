"""The staircase: how the error falls, round by round, and how k1 and k2 move."""

import math
from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

from galileo_jax.results.shown import number, shown

WIDTH, HEIGHT, TOP, BOTTOM = 416, 150, 26, 38


def stairs(rounds: Sequence[Mapping[str, Any]]) -> str:
    """An SVG: the velocity error of each round on a logarithmic scale, the noise dotted."""
    errors = [max(float(one["rmse"]), 1e-9) for one in rounds]
    noise = max(float(rounds[-1]["noise"]), 1e-9)
    high, low = math.log(max(*errors, noise) * 1.2), math.log(min(*errors, noise) / 1.3)

    def y(value: float) -> float:
        return TOP + (high - math.log(value)) / (high - low) * (HEIGHT - TOP - BOTTOM)

    step = WIDTH / max(len(rounds), 2)
    path, texts = "", []
    for i, (one, error) in enumerate(zip(rounds, errors, strict=True)):
        left, right = i * step, (i + 1) * step
        path += f"{'L' if path else 'M'}{left:.1f} {y(error):.1f}L{right:.1f} {y(error):.1f}"
        name = "+ " + str(one["effects"][-1]) if one["effects"] else "no effects"
        texts.append(
            f'<text x="{left + 6:.1f}" y="{y(error) - 7:.1f}" font-weight="600">{error:.4f} m/s'
            f'</text><text class="soft" x="{left + 6:.1f}" y="{HEIGHT - 20}">{escape(name)}</text>'
            f'<text class="soft" x="{left + 6:.1f}" y="{HEIGHT - 4}">chi2 '
            f"{float(one['chi2_per_dof']):.3g}</text>"
        )
    floor = y(noise)
    return (
        f'<svg class="stairs" viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="velocity error '
        f'round by round"><line x1="0" x2="{WIDTH}" y1="{floor:.1f}" y2="{floor:.1f}" '
        f'stroke="var(--soft)" stroke-dasharray="3 4"/><text class="soft" x="{WIDTH - 2}" '
        f'y="{floor + 14:.1f}" text-anchor="end">noise</text>'
        f'<path d="{path}" fill="none" stroke="var(--accent)" stroke-width="3"/>'
        f"{''.join(texts)}</svg>"
    )


def friction_moves(rounds: Sequence[Mapping[str, Any]]) -> list[str]:
    """How the last round moved k1 and k2, in words."""
    found = []
    for name in ("k1", "k2"):
        if name not in rounds[-1]:
            continue
        now = rounds[-1][name]
        text = f"{name} {shown(now)} ± {shown(now, 'sd')}"
        if len(rounds) > 1 and name in rounds[-2]:
            before = rounds[-2][name]["mean"]
            arrow = "↑" if now["mean"] > before else "↓"
            change = abs(now["mean"] - before)
            text += f"  {arrow} {number(change, now['sd'])} (from {before:.3g})"
        found.append(text)
    return found
