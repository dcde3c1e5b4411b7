"""What a class found of one quantity: a sentence, and a strip chart that prints without scripts."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

import numpy as np

from galileo_jax.comparison.consensus import Consensus
from galileo_jax.report.html_page import prose, section
from galileo_jax.results.shown import number

WIDTH_PX, HEIGHT_PX = 720, 150  # of the frame with its margins, without names
LEFT_PX, RIGHT_PX, TOP_PX = 62, 8, 8
NAMES_PX, LETTERS = 74, 14  # room for slanted names, and how many letters of them fit there
LETTER_PX = 11  # of slanted names so near to each other none can be read
HALF_95 = 1.96  # standard deviations
CLASS_NOTE = (
    "Each group with its 95 % interval. Line: the class's value. Band: where 95 % of groups "
    "would be if each measured without error. Diamond: a group that lies outside, further from "
    "what the others find than its own uncertainty and the scatter between groups explain."
)


@dataclass(frozen=True)
class Agreement:
    """A quantity that most groups of a class determined."""

    quantity: str
    unit: str  # "1" of a pure number
    groups: tuple[str, ...]  # names of those that determined it
    values: np.ndarray  # `[group]`
    # `[group]`, ends of the 95 % intervals.
    low: np.ndarray
    high: np.ndarray
    found: Consensus
    undetermined: int = 0  # how many groups have a result and not this quantity

    @property
    def sentence(self) -> str:
        """What the class found, and how many agree with it."""
        found, count = self.found, len(self.groups)
        unit = "" if self.unit == "1" else f" {self.unit}"
        value, sd = number(found.mean, found.sd), number(found.sd, found.sd)
        within = "their intervals"
        if found.scatter:
            within += f" and the scatter between groups of {number(found.scatter, found.scatter)}"
        text = (
            f"The class found {self.quantity} = {value} ± {sd}{unit} "
            f"({count - found.is_outside.sum()} of {count} groups agree within {within}{unit})."
        )
        if self.undetermined:
            text += f" {self.undetermined} more did not determine it."
        return text


def strip_chart(one: Agreement) -> str:
    """The value and interval of each group as SVG, and the class's value as a line.

    The band is where 95 % of groups would be if they measured without any error.
    """
    count, found = len(one.groups), one.found
    step = (WIDTH_PX - LEFT_PX - RIGHT_PX) / count
    spread = HALF_95 * math.hypot(found.scatter, found.sd)
    low, high = _limits(one, spread)

    def y(value: float) -> float:
        inside = min(max(value, low), high)
        return TOP_PX + (HEIGHT_PX - 2 * TOP_PX) * (high - inside) / (high - low)

    end = WIDTH_PX - RIGHT_PX
    top, bottom = y(found.mean + spread), y(found.mean - spread)
    shapes = [
        f'<rect class="band" x="{LEFT_PX}" y="{top:.1f}" width="{end - LEFT_PX}" '
        f'height="{max(bottom - top, 1.0):.1f}"/>',
        *(
            f'<line class="grid-line" x1="{LEFT_PX}" x2="{end}" y1="{y(at):.1f}" y2="{y(at):.1f}"/>'
            f'<text x="{LEFT_PX - 6}" y="{y(at) + 4:.1f}" text-anchor="end">{text}</text>'
            for at, text in _ticks(low, high)
        ),
        f'<line class="class-line" x1="{LEFT_PX}" x2="{end}" '
        f'y1="{y(found.mean):.1f}" y2="{y(found.mean):.1f}"/>',
    ]
    is_named = step >= LETTER_PX
    for i, name in enumerate(one.groups):
        x, mark = LEFT_PX + (i + 0.5) * step, "outside" if found.is_outside[i] else "inside"
        shapes.append(
            f'<g class="{mark}"><line x1="{x:.1f}" x2="{x:.1f}" y1="{y(one.low[i]):.1f}" '
            f'y2="{y(one.high[i]):.1f}"/>{_mark(x, y(one.values[i]), mark)}</g>'
        )
        if is_named:
            short = name if len(name) <= LETTERS else f"{name[: LETTERS - 1]}…"
            shapes.append(
                f'<text class="{mark}" text-anchor="end" transform="translate({x + 3:.1f} '
                f'{HEIGHT_PX + 8}) rotate(-45)">{escape(short)}</text>'
            )
    label = escape(f"{one.quantity} of each group. {one.sentence}", quote=True)
    height = HEIGHT_PX + (NAMES_PX if is_named else 0)
    return (
        f'<svg class="strip" viewBox="0 0 {WIDTH_PX} {height}" role="img" aria-label="{label}">'
        f"{''.join(shapes)}</svg>"
    )


def class_section(found: Sequence[Agreement]) -> str:
    """A sentence and a strip chart of each quantity as HTML, with a heading; empty of none."""
    if not found:
        return ""
    parts = "".join(f"{prose(one.sentence)}{strip_chart(one)}" for one in found)
    note = f"<figcaption>{CLASS_NOTE}</figcaption>"
    return section("What the class found", f'<figure class="class">{parts}{note}</figure>')


def _limits(one: Agreement, spread: float) -> tuple[float, float]:
    """The ends of the axis: all values with a usual interval; a very long one is cut off."""
    room, mean = float(np.median(one.high - one.low)) / 2, one.found.mean
    low = min(float(one.values.min()) - room, mean - spread)
    high = max(float(one.values.max()) + room, mean + spread)
    spare = 0.05 * (high - low)
    return low - spare, high + spare


def _ticks(low: float, high: float) -> list[tuple[float, str]]:
    """Three to seven round values and their texts."""
    rough = (high - low) / 3
    unit = 10.0 ** math.floor(math.log10(rough))
    step = max(m * unit for m in (1, 2, 5) if m * unit <= rough)
    places = max(0, -math.floor(math.log10(step)))
    first, last = math.ceil(low / step), math.floor(high / step)
    return [(n * step, f"{n * step:.{places}f}") for n in range(first, last + 1)]


def _mark(x: float, y: float, kind: str) -> str:
    """A dot, or a diamond that is told from it without colours."""
    if kind == "inside":
        return f'<circle cx="{x:.1f}" cy="{y:.1f}" r="3"/>'
    points = ((x, y - 6), (x + 6, y), (x, y + 6), (x - 6, y))
    return f'<polygon points="{" ".join(f"{a:.1f},{b:.1f}" for a, b in points)}"/>'
