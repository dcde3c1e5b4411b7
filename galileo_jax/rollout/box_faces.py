"""Where two boxes touch, or will: the faces that look at each other, one clipped by the other.

Of the planes of all faces the one that keeps the boxes farthest apart carries the reference face;
the face of the other box that looks at it most squarely is cut to the reference face's outline.
The corners of what is left are the points of contact. Edges that cross each other at an angle, with
no face between them, are not looked for: boxes that have stood on one table need to topple first.

Source: Gottschalk, Lin and Manocha (1996), OBBTree, SIGGRAPH, for the separating planes; Sutherland
and Hodgman (1974), Reentrant polygon clipping, Commun. ACM 17, 32.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Bool, Float

AFAR_M = 1.0  # the gap of a point that there is not
NUM_POINTS = 12  # 4 edges, cut at both ends, and 4 corners
INSIDE_M = 1e-9
ALIKE_M = 1e-7
AROUND = ((-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0))  # the corners of a face in turn


class Box(NamedTuple):
    """A box in space."""

    centre_m: Float[jax.Array, " 3"]
    turned: Float[jax.Array, "3 3"]  # from its axes to the world's
    half_m: Float[jax.Array, " 3"]  # half its edges


class Touch(NamedTuple):
    """Where a box touches another one."""

    points_m: Float[jax.Array, "point 3"]  # in the world
    gaps_m: Float[jax.Array, " point"]  # `[point]`; `AFAR_M` of points that there are not
    normal: Float[jax.Array, " 3"]  # from the one to the other


def touch(one: Box, other: Box) -> Touch:
    """Where `one` touches `other`."""
    apart = other.centre_m - one.centre_m
    between = one.turned.T @ other.turned  # cosines of one's axes with the other's
    gaps = jnp.concatenate(
        [
            jnp.abs(apart @ one.turned) - one.half_m - jnp.abs(between) @ other.half_m,
            jnp.abs(apart @ other.turned) - other.half_m - one.half_m @ jnp.abs(between),
        ]
    )
    # Of faces that lie on each other always the same one, whatever rounding says.
    best = jnp.argmax(gaps - ALIKE_M * jnp.arange(6))
    is_one = best < 3
    reference, incident = (
        Box(*(jnp.where(is_one, a, b) for a, b in zip(first, second, strict=True)))
        for first, second in ((one, other), (other, one))
    )
    away = jnp.where(is_one, apart, -apart)
    found = _clipped(reference, incident, away, best % 3)
    return found._replace(normal=jnp.where(is_one, found.normal, -found.normal))


def _clipped(reference: Box, incident: Box, away: jax.Array, axis: jax.Array) -> Touch:
    """The points between the reference box' face across `axis` and the incident box."""
    centre, normal, sides, half = _face(reference, axis, away)
    most = jnp.argmax(jnp.abs(normal @ incident.turned))
    facing, facing_normal, edges, reach = _face(incident, most, -normal)
    around = jnp.array(AROUND)
    corners = facing + (around * reach) @ edges
    place = (corners - centre) @ sides.T  # along the reference face
    height = (corners - centre) @ normal
    ahead, climbs = jnp.roll(place, -1, axis=0) - place, jnp.roll(height, -1) - height
    enters, leaves, is_cut = jax.vmap(_cut, (0, 0, None))(place, ahead, half)
    shares = jnp.concatenate([enters, leaves])
    along = jnp.concatenate([corners, corners])
    step = jnp.roll(corners, -1, axis=0) - corners
    on_edges = along + shares[:, None] * jnp.concatenate([step, step])
    edge_gaps = jnp.concatenate([height, height]) + shares * jnp.concatenate([climbs, climbs])
    # Where an edge ends inside, the next one begins: once is enough.
    is_edge = jnp.concatenate([is_cut, is_cut & (leaves < 1.0)])
    own = centre + (around * half) @ sides
    own_gaps = ((facing - own) @ facing_normal) / (normal @ facing_normal)
    seen = own + own_gaps[:, None] * normal
    is_inside = jnp.all(jnp.abs((seen - facing) @ edges.T) < reach + INSIDE_M, axis=1)
    gaps = jnp.where(jnp.concatenate([is_edge, is_inside]), 0.0, AFAR_M)
    return Touch(
        jnp.concatenate([on_edges, seen]),
        jnp.where(gaps > 0, gaps, jnp.concatenate([edge_gaps, own_gaps])),
        normal,
    )


def _face(
    box: Box, axis: jax.Array, towards: jax.Array
) -> tuple[jax.Array, jax.Array, jax.Array, jax.Array]:
    """Of the face across `axis` that looks `towards`: centre, normal, its sides, half of them."""
    order = (axis + jnp.arange(3)) % 3
    axes, half = box.turned.T[order], box.half_m[order]
    normal = jnp.where(axes[0] @ towards < 0, -axes[0], axes[0])
    return box.centre_m + half[0] * normal, normal, axes[1:], half[1:]


def _cut(
    start: Float[jax.Array, " 2"], ahead: Float[jax.Array, " 2"], half: Float[jax.Array, " 2"]
) -> tuple[jax.Array, jax.Array, Bool[jax.Array, ""]]:
    """Which part of the way from `start` on is within +- `half`: from, to, and whether any is."""
    moves = jnp.abs(ahead) > INSIDE_M
    over = jnp.where(moves, ahead, 1.0)
    ends = jnp.stack([(-half - start) / over, (half - start) / over])
    stays = jnp.abs(start) <= half + INSIDE_M
    enters = jnp.where(moves, jnp.min(ends, axis=0), jnp.where(stays, 0.0, 2.0))
    leaves = jnp.where(moves, jnp.max(ends, axis=0), 1.0)
    first, last = jnp.maximum(jnp.max(enters), 0.0), jnp.minimum(jnp.min(leaves), 1.0)
    return first, last, first <= last
