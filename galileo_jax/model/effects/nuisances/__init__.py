"""Nuisances: always free, with tight priors, never a verdict while inside them.

They are effects like any other; only their parameters' role differs
(`nuisances` in docs/reference/result_files.md).
"""

from galileo_jax.model.effects.effect import Effect
from galileo_jax.model.effects.nuisances.board_shape import BoardShape
from galileo_jax.model.effects.nuisances.declared import DeclaredAngle, DeclaredScale
from galileo_jax.model.effects.nuisances.foot_transition import FootTransition
from galileo_jax.model.effects.nuisances.hits import ContactGap, ImpactMomentum
from galileo_jax.model.effects.nuisances.impact_restitution import ImpactRestitution
from galileo_jax.model.effects.nuisances.perspective import Perspective
from galileo_jax.model.effects.nuisances.pixel_scale import PixelScale
from galileo_jax.model.effects.nuisances.release_instant import ReleaseInstant
from galileo_jax.model.effects.nuisances.start_offset import StartOffset

NUISANCES: tuple[Effect, ...] = (
    StartOffset(),
    FootTransition(),
    DeclaredAngle(),
    DeclaredScale(),
    ImpactRestitution(),
    ImpactMomentum(),
    ContactGap(),
    ReleaseInstant(),
    BoardShape(),
    PixelScale(),
    Perspective(),
)
