"""What a fit has to say about the tracks and marks it rests on: in its status and warnings."""

import math
import shlex
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from galileo_jax.clip.declaration import CLICK_SD_PX
from galileo_jax.clip.scenarios import SCENARIOS
from galileo_jax.clip.schema import UNCERTAINTY_OF
from galileo_jax.measurement.measure import Measurement
from galileo_jax.measurement.segments.track_failure import longest_absence

FAR = 1000.0
"""chi2 per degree of freedom: residuals of thirty standard deviations on average. Few effects
leave as much; a track of something else does."""

MOST_OFF_PERCENT = 5.0
"""Root mean square; tracks that people make by hand are within one or two."""

OF_ROLLING = {
    "a ball": (2 / 5, "shape: sphere"),
    "a cylinder": (1 / 2, "shape: cylinder, rolls: true"),
}
"""J / (m r^2), and how a yaml declares such a body."""

AS_ROLLING = 0.02  # of k1: so near to that of a body that rolls, as the angle is known

SLOW_MOTION = 4.0
"""Times as many pictures, at least, as are played. What speeds up by g (sin a - k cos a) seems to
do so by 1 / 16 of that, as if k were at least 15 / 16 of tan a."""

TAKEN = {
    "ramp_angle_deg": "ramp_angle_deg as exact",
    "pixels_per_metre": "pixels_per_metre as known to a thousandth",
}


def with_track_doubts(
    measurements: Sequence[Measurement], result: Mapping[str, Any]
) -> dict[str, Any]:
    """The result with its status and warnings saying so where the tracks cannot be trusted."""
    wrong = ", ".join(str(one) for measured in measurements for one in measured.astray)
    chi2, warning = result["error"]["chi2_per_dof"], ""
    percent = result["error"].get("rms_percent_of_way") or 0.0
    if not wrong and not chi2 <= FAR:
        wrong = f"no motion of this model comes close to the track (chi2 {chi2:.0f})"
        warning = (
            f"chi2 per degree of freedom is {chi2:.0f}: before you conclude that a force is "
            "missing, "
        )
    elif not wrong and percent > MOST_OFF_PERCENT:
        wrong = f"the best motion stays {percent:.0f} % of the way moved from the track"
        warning = f"{wrong}: "
    found = dict(result)
    if warning:
        found["warnings"] = [*result.get("warnings", []), f"{warning}{_look_at(measurements)}"]
    if wrong:
        found["status"] = "; but ".join(filter(None, [result.get("status"), wrong]))
    return found


def _look_at(measurements: Sequence[Measurement]) -> str:
    text = "check that the track follows the objects"
    absences = [
        (back - gone, name, back)
        for name, gone, back in filter(None, (longest_absence(m.observation) for m in measurements))
    ]
    if absences:
        away_s, name, back = max(absences)
        text += f", above all {name} from {back:.2f} s on: it had not been seen for {away_s:.2f} s"
    videos = [m.clip.source or str(m.clip.path) for m in measurements if m.clip.video is not None]
    if videos:
        text += "; see the overlay: galileo track " + shlex.quote(videos[0])
    return text


def taken_as_exact(measured: Measurement, k1: float | None) -> str | None:
    """Which marks in a video the fit takes as exact or nearly so, and how much hangs on them.

    A line that is read off with an error e at either end, half a pixel, and is as long as the
    way L of object 1 down the ramp has its angle off by sqrt(2) e / L and its length by as much
    of itself. On the ramp k1 = tan a - acceleration / (g cos a), so that

        dk1 = (1 + k1 tan a) da,    dk1 = (tan a - k1) dscale / scale.

    Args:
      measured: the clip.
      k1: the friction found; None where there is none.

    Returns:
      One line; None of tracks, and where all is declared with its uncertainty (a scale may be
      declared to be exact).
    """
    clip, scenario = measured.clip, SCENARIOS[measured.clip.scenario]
    if clip.video is None:
        return None
    exact = []
    if scenario.is_sloped and not clip.ramp_angle_sd_deg:
        exact.append("ramp_angle_deg")
    is_told = clip.pixels_per_metre is not None and not clip.is_scale_assumed
    if is_told and clip.pixels_per_metre_sd is None and "pixels_per_metre" not in measured.inferred:
        exact.append("pixels_per_metre")
    if not exact:
        return None
    text = f"{clip.path}: the fit takes {' and '.join(TAKEN[key] for key in exact)}"
    way_px = _way_px(measured)
    if k1 is None or clip.ramp_angle_deg is None or way_px < 1:
        return text
    slope, off = math.tan(math.radians(clip.ramp_angle_deg)), math.sqrt(2) * CLICK_SD_PX / way_px
    change = {"ramp_angle_deg": (1 + k1 * slope) * off, "pixels_per_metre": (slope - k1) * off}
    by = " and ".join(f"{abs(change[key]):.2g}" for key in exact)
    keys = " and ".join(UNCERTAINTY_OF[key] for key in exact)
    they_were = "it was" if len(exact) == 1 else "they were"
    return (
        f"{text}. If {they_were} read off the picture, half a pixel at either end of a line as "
        f"long as object 1's way ({way_px:.0f} px) would change k1 by {by}: declare "
        f"{keys} to include that in its interval"
    )


def with_other_angle(measured: Measurement, k1: float | None) -> str | None:
    """What k1 would be if the path's angle were the board's; None where they are the same.

    The acceleration g (sin a - k1 cos a) is what was seen.
    """
    way, clip = measured.way, measured.clip
    if way is None or k1 is None or not SCENARIOS[clip.scenario].has_ramp:
        return None
    used, other = math.radians(way.declared_deg), math.radians(way.path_deg)
    seen = math.sin(used) - k1 * math.cos(used)
    friction = math.tan(other) - seen / math.cos(other)
    if friction < 0:
        return None
    name = clip.objects[0].name
    return (
        f"{clip.path}: if the board falls by {way.path_deg:.1f} degrees, as {name}'s path does, k1 "
        f"is {friction:.3f}"
    )


def as_if_rolling(measured: Measurement, k1: float | None) -> str | None:
    """What rolls, if k1 is that of a box which goes down as fast; None where none does.

    Of what rolls down without losses the acceleration is g sin a / (1 + J / (m r^2)), as of a box
    with the friction coefficient tan a J / (J + m r^2).
    """
    clip = measured.clip
    angle, item = clip.ramp_angle_deg, clip.objects[0]
    if k1 is None or not angle or item.shape != "box" or not SCENARIOS[clip.scenario].has_ramp:
        return None
    for what, (inertia, declared) in OF_ROLLING.items():
        k_rolling = math.tan(math.radians(angle)) * inertia / (1 + inertia)
        if abs(k1 / k_rolling - 1) < AS_ROLLING:
            return (
                f"{clip.path}: {what} that rolls down {angle:g} degrees is as fast as a box with "
                f"k1 {k_rolling:.3g}; if {item.name} rolls, write {declared}"
            )
    return None


def as_in_slow_motion(measured: Measurement, k1: float | None) -> str | None:
    """What to look at where a body hardly speeds up, as in slow motion; None where it does.

    Friction is within a few per cent of the slope's tangent then.
    """
    clip = measured.clip
    angle, scenario = clip.ramp_angle_deg, SCENARIOS[clip.scenario]
    if k1 is None or not angle or not scenario.has_ramp or scenario.is_level:
        return None
    share = 1 - k1 / math.tan(math.radians(angle))
    if not 0 < share < 1 / SLOW_MOTION**2:
        return None
    return (
        f"{clip.path}: {clip.objects[0].name} speeds up by {100 * share:.2g} % of what the slope "
        f"alone gives, as in slow motion: if the camera took more than {clip.fps:.4g} pictures a "
        "second, say so: fps"
    )


def _way_px(measured: Measurement) -> float:
    """How far object 1 is seen to go on the ramp, px."""
    seen = measured.observation
    place = seen.position_m[0][:, seen.mask[0]]
    if SCENARIOS[measured.clip.scenario].has_table:
        place = place[:, place[0] < 0]
    if not place.size:
        return 0.0
    return float(np.linalg.norm(np.ptp(place, axis=1))) * (measured.clip.pixels_per_metre or 0.0)
