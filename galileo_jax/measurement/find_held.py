"""How long a swing, or what sinks in a liquid, is held before it is let go, and who stops it.

From rest the distance d from where it was grows as (t - t0)^2: the root of a straight line through
sqrt(d), between a twentieth and three tenths of the first way, is when it is let go. What swings
already when the film begins has its root before the first frame; its place at rest scatters by no
more than errors do.
"""

import numpy as np

from galileo_jax.observation.observation import Observation

LEAST_S, LEAST_FRAMES = 0.04, 4  # held for less, or in fewer frames, it is not held
EARLY = (0.05, 0.3)  # of the first way
STILL_SD = 6.0  # of the errors: what is farther from where it was has moved
REST_S, SOON_S = 0.25, 0.1  # at rest for so long; how far ahead it would have moved
ENOUGH = 3  # places through which the line is laid


def let_go_frame(observation: Observation) -> int | None:
    """The first frame in which it moves by itself; None where it is not held at first."""
    seen = np.flatnonzero(observation.mask[0])
    times, place = observation.times_s[seen], observation.position_m[0][:, seen]
    if len(seen) < 2 * LEAST_FRAMES:
        return None
    stood = np.median(place[:, :LEAST_FRAMES], axis=1, keepdims=True)
    gone = np.linalg.norm(place - stood, axis=0)
    variance = 2 * observation.variance_m2[0, seen]
    farthest = int(np.argmax(gone > EARLY[1] * gone.max()))  # where the first way is that long
    low = max(EARLY[0] * gone.max(), STILL_SD * float(np.sqrt(np.median(variance))))
    moves = np.flatnonzero(gone[: farthest + 1] > low)
    if len(moves) < ENOUGH:
        return None
    slope, intercept = np.polyfit(times[moves], np.sqrt(gone[moves]), 1)
    if slope <= 0:
        return None
    let_go_s = -intercept / slope
    step_s = float(np.median(np.diff(times)))
    if let_go_s - times[0] < max(LEAST_S, LEAST_FRAMES * step_s):
        return None
    if (gone[times < let_go_s - step_s] > low).any():
        return None  # it was elsewhere before: no rest
    at = int(np.searchsorted(times, let_go_s + step_s))
    return int(seen[at]) if at < len(seen) else None


def standstill_frame(observation: Observation) -> int | None:
    """The last frame before something stops it for good; None where it comes to rest by itself.

    It is at rest for the last quarter of a second or longer, and would have gone on for a twentieth
    of its whole way within a tenth of a second.
    """
    seen = np.flatnonzero(observation.mask[0])
    times, place = observation.times_s[seen], observation.position_m[0][:, seen]
    ended = times > times[-1] - REST_S if len(seen) else np.zeros(0, bool)
    if ended.sum() < 2 * ENOUGH or ended.all():
        return None
    variance = 2 * observation.variance_m2[0, seen]
    still = STILL_SD * float(np.sqrt(np.median(variance)))
    away = np.linalg.norm(place - np.median(place[:, ended], axis=1, keepdims=True), axis=0) > still
    if (away & ended).any() or not away.any():
        return None
    last = int(np.flatnonzero(away)[-1])
    before = min(max(last - ENOUGH, 0), int(np.searchsorted(times, times[last] - SOON_S / 2)))
    if last == before:
        return None
    way = float(np.linalg.norm(place[:, last] - place[:, before]))
    speed = way / (times[last] - times[before])
    width = float(np.linalg.norm(np.ptp(place, axis=1)))
    goes_on = speed * SOON_S > max(EARLY[0] * width, still)
    return int(seen[last - 1]) if goes_on else None
