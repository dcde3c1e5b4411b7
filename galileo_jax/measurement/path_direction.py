"""Does an object go the way that is declared? Down the board, or straight down.

The direction of a straight path is the principal axis of its points. A camera stands level within
half a degree; a path that leaves the declared way by more than `CLEAR` standard deviations is said.
By more than `TURNED_DEG`, no angle was read off wrongly: a table's axes are turned (lengths along
the board as x, a camera on its side), and its points are turned back.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from galileo_jax.clip.scenarios import SCENARIOS
from galileo_jax.clip.schema import Clip
from galileo_jax.measurement.infer_slope import LEVEL_SD_DEG
from galileo_jax.observation.observation import Observation

CLEAR = 4.0
TURNED_DEG = 6.0
FEWEST = 5  # points
STRAIGHT = 0.02  # of its length: a path that bends by more has no direction
MOST_SD_DEG = 1.0


@dataclass(frozen=True)
class OtherWay:
    """A path that does not go where it is declared to go.

    Attributes:
      declared_deg: below the horizontal, along the travel.
      path_deg, sd_deg: the path's, as it was measured.
      is_turned_back: whether the points were turned, so that the declared angle is used.
    """

    declared_deg: float
    path_deg: float
    sd_deg: float
    is_turned_back: bool


def other_way(clip: Clip, observation: Observation, may_turn: bool) -> OtherWay | None:
    """What the path of object 1 says against the declared way; None where they agree.

    Args:
      clip: what is declared.
      observation: the motion of the scene.
      may_turn: whether its axes may be any.
    """
    scenario = SCENARIOS[clip.scenario]
    if scenario.moves_in_plane or scenario.is_level or scenario.has_table:
        return None
    if scenario.has_ramp and clip.ramp_angle_deg is None:
        return None
    declared = clip.ramp_angle_deg if scenario.has_ramp else 90.0
    assert declared is not None
    found = _direction_deg(observation)
    if found is None:
        return None
    path, sd = found
    apart = abs(_turn_deg(declared, path, "spring" in scenario.laws))
    known = math.hypot(sd, LEVEL_SD_DEG, clip.ramp_angle_sd_deg)
    if sd > MOST_SD_DEG or apart < CLEAR * known:
        return None
    return OtherWay(declared, path, sd, may_turn and apart > TURNED_DEG)


def turned_back(clip: Clip, observation: Observation, way: OtherWay) -> Observation:
    """The observation with its axes turned so that object 1 goes where it is declared to go."""
    is_swing = "spring" in SCENARIOS[clip.scenario].laws
    angle = -math.radians(_turn_deg(way.declared_deg, way.path_deg, is_swing))
    turn = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
    modes = observation.modes_m
    return replace(
        observation,
        position_m=np.einsum("ab,obt->oat", turn, observation.position_m),
        covariance_m2=np.einsum("ab,obct,dc->oadt", turn, observation.covariance_m2, turn),
        modes_m=None if modes is None else np.einsum("ab,mobt->moat", turn, modes),
    )


def way_text(clip: Clip, way: OtherWay) -> str:
    """The two directions, and which is used, in a line without the clip's name."""
    falls = "falls" if way.path_deg >= 0 else "rises"
    declared = (
        f"ramp_angle_deg: {way.declared_deg:g} is declared"
        if SCENARIOS[clip.scenario].has_ramp
        else f"straight down is what scenario {clip.scenario} says"
    )
    text = (
        f"{clip.objects[0].name}'s path {falls} by {abs(way.path_deg):.1f} +- {way.sd_deg:.1g} "
        f"degrees, but {declared}"
    )
    if way.is_turned_back:
        return f"{text}; the axes are taken to be turned, and the declared angle is used"
    return f"{text}, which is used; check the angle, and whether the camera stood level"


def _turn_deg(declared_deg: float, path_deg: float, is_either: bool) -> float:
    """From the path to the declared way, -180 to 180; -90 to 90 of what goes to and fro."""
    period = 180.0 if is_either else 360.0
    return (declared_deg - path_deg + period / 2) % period - period / 2


def _direction_deg(observation: Observation) -> tuple[float, float] | None:
    """Below the horizontal, and its standard deviation; None where it is not straight."""
    points = observation.position_m[0, :2][:, observation.mask[0]]
    if points.shape[1] < FEWEST or observation.position_m.shape[1] != 2:
        return None
    gone = points - points[:, :1]
    away = points - points.mean(axis=1, keepdims=True)
    values, axes = np.linalg.eigh(away @ away.T)
    furthest = gone[:, int(np.argmax((gone**2).sum(axis=0)))]
    along = axes[:, 1] * math.copysign(1.0, axes[:, 1] @ furthest)
    length = float(np.ptp(along @ away))
    if not length or np.abs(axes[:, 0] @ away).max() > STRAIGHT * length:
        return None
    covariance = observation.covariance_m2[0][..., observation.mask[0]]
    noise = float(np.median(np.einsum("aat->t", covariance))) / 2
    scatter = max(float(values[0]) / (points.shape[1] - 2), noise)
    sd = math.degrees(math.sqrt(scatter / float(values[1])))
    return math.degrees(math.atan2(-along[1], along[0])), sd
