"""First pass: following one object through the frames, and collecting its sharp patches."""

from dataclasses import dataclass, field, replace

import numpy as np

from galileo_jax.tracking.alignment import FINE_PX, Fit, align
from galileo_jax.tracking.exposure import MIN_SPEED_PX, Exposure, distinct
from galileo_jax.tracking.features import follow, rigid_motion
from galileo_jax.tracking.picture import Picture
from galileo_jax.tracking.pose import length, own_motion, patch_at, rotation
from galileo_jax.tracking.redetect import (
    SURE,
    TURNS_RAD,
    Guess,
    after_blow,
    best_fit,
    candidate_poses,
    is_alike,
)
from galileo_jax.tracking.template import Template, median_template

FOUND, FOUND_AGAIN = 0.75, 0.85
"""Least correlation with the template to count as found: near where expected, by a wide search."""
REACH_SHARE = 0.2  # of the frame's width is searched to each side of where an object was lost
WORSE = 0.1  # a fit that correlates this much less than the one before is worth a wide search
AS_EXPECTED_PX, AS_SEEN = 1.0, 0.02
"""What is this close to where it should be, and correlates by no more than this less than in the
frame before, is not looked for by its features."""
MAX_TURN_RAD = 0.7  # an object does not turn further between two frames in which it is seen
SETTLED_FRAMES, MAX_LEAP_FRAMES = 4, 4
"""After so many frames an object's velocity is known: it can then be no farther from where it
should be than a blow throws it, in each of so many frames of being hidden."""
MAX_COAST_FRAMES = 8  # for which a hidden object goes on as it did, before it has stopped
LONG_GONE_FRAMES, LOOK_EVERY = 16, 4
"""What is missed for longer is looked for in every so many frames."""
HELD_SPEED_PX, HELD_SHARE = 1.0, 0.1
"""What moved faster than this per frame and is now shown within this share of a step from where it
was has stopped at once, or the video repeats a frame; the next frame tells."""
AS_BEFORE = 0.3
"""Of its path since, by which what goes on after a repeated frame is off a steady motion."""
PATCH_PX = 1.0  # what moves less during the exposure gives a patch for the template
CLICKED_PX, CLICKED_SHARE = 4.0, 0.5
"""From its centre, or of its template's radius: where one may click on it."""
MAX_PATCHES = 32
KNOWN_FROM = 2  # before this frame, from 0, nobody knows whether an object moved in its first
HIT_GAIN = 2.0  # what is hit by something heavy, elastically, flies off with twice its speed
SAME_PLACE = 0.5  # of the smaller one's size: two objects are never so near
RENEWALS = frozenset(8 * 2**i for i in range(32))
"""Numbers of sharp frames after which the template becomes the median of the patches so far:
without noise, without the hand, and in time without what was behind the object."""


@dataclass
class Follower:
    """Follows one object from frame to frame; `poses` grows by one entry per frame."""

    template: Template  # from the first frame at first, hand and noise included
    pose: np.ndarray  # the last one found
    exposure: Exposure  # of the video, shared by all objects
    first_picture: Picture  # the frame in which it began: the scene without it, elsewhere
    # change of the pose per usual step, extrapolated to the last one
    velocity: np.ndarray = field(default_factory=lambda: np.zeros(3))
    # over the step to the last one
    mean_velocity: np.ndarray = field(default_factory=lambda: np.zeros(3))
    # pose of every frame so far, NaN where not found
    poses: list[np.ndarray] = field(default_factory=list)
    # sharp aligned patches, thinned evenly to at most `MAX_PATCHES`
    patches: list[np.ndarray] = field(default_factory=list)
    correlation: float = 1.0
    frames_missed: int = 0
    frames_held: int = 0
    since: float = 0.0  # the last frame that showed where it is, in usual steps
    off_course_px: float = 0.0  # how far from where it should have been it was found last
    stride: int = 1
    frames_sharp: int = 0
    frames_before: int = 0  # that somebody has put it right in
    fastest_px: float = 0.0  # of the other objects, per frame
    is_alone: bool = True  # there is nothing that could strike it
    taken: tuple[np.ndarray, ...] = ()  # places where other objects are in this frame

    def __post_init__(self) -> None:
        self.first_pose = self.pose

    @property
    def size_px(self) -> float:
        """The radius of a disc as large as the region that is compared."""
        return float(np.sqrt(self.template.region.sum() / np.pi))

    @property
    def speed_px(self) -> float:
        """How far it goes per frame, as last seen."""
        return length(self.velocity)

    def again(
        self, before: Picture | None, picture: Picture, taken: tuple[np.ndarray, ...]
    ) -> None:
        """Looks for the object anew in the frame of the last `step`, but not at `taken`."""
        vars(self).update(self._last)
        self.taken = taken
        self.step(before, picture, self._step)
        self.taken = ()

    def step(self, before: Picture | None, picture: Picture, step: float = 1.0) -> None:
        """Finds the object in the next frame, `step` usual steps after the frame `before`."""
        self._step = step
        lists = {"poses": [*self.poses], "patches": [*self.patches]}
        self._last = {k: v for k, v in vars(self).items() if k != "_last"} | lists
        self.since += step
        fit = None
        if self.frames_missed <= LONG_GONE_FRAMES or self.frames_missed % LOOK_EVERY == 0:
            fit = self._near(before, picture)
        if fit is None or fit.correlation < min(SURE, self.correlation - WORSE):
            both = (one for one in (fit, self._far(picture)) if one is not None)
            fit = max(both, key=lambda one: one.correlation, default=None)
        if fit is None:
            self.poses.append(np.full(3, np.nan))
            self.frames_missed += 1
        elif self._is_held(fit):
            self.frames_held = 1
            self.poses.append(fit.pose)
        else:
            self._goes_on(fit, picture, is_first=before is None)

    def put_right(self, picture: Picture, point_px: tuple[float, float]) -> bool:
        """Looks for the object around a point where somebody has seen it; False: it looks other.

        Where it is found it is followed on from there, as if it were new: how fast it goes is
        seen in the next frames.
        """
        turns = TURNS_RAD if self.template.shows_turns else (0.0,)
        upright = {float(self.pose[2]), float(self.first_pose[2])}
        guesses = [
            Guess(np.array([*point_px, angle + turn]), np.zeros(3))
            for angle in upright
            for turn in turns
        ]
        fit = best_fit(picture, self.template, guesses)
        most_px = max(CLICKED_SHARE * self.template.radius, CLICKED_PX)
        is_it = is_alike(fit) and fit.correlation >= FOUND
        if not is_it or length(fit.pose[:2] - point_px) >= most_px:
            return False
        self.poses.append(fit.pose)
        self.pose, self.correlation = fit.pose, fit.correlation
        self.velocity = self.mean_velocity = np.zeros(3)
        self.frames_missed = self.frames_held = 0
        self.since = 0.0
        self.frames_before = len(self.poses)
        return True

    def _goes_on(self, fit: Fit, picture: Picture, is_first: bool) -> None:
        """Takes a fit for where the object is."""
        self.off_course_px = length(fit.pose - self._expected())
        is_steady = self.off_course_px < AS_BEFORE * self.since * self.speed_px
        if self.frames_held and not self.frames_missed and is_steady:
            self.poses[-1] = np.full(3, np.nan)  # that frame repeats the one before it
        mean, velocity, is_blow = self._velocity_to(fit.pose)
        is_smooth = not self.frames_missed and not is_blow
        if not is_first:
            # what is alone is never struck: it is smeared now as it was first, and its template
            # is renewed from what it looks like on its way.
            if len(self.poses) == KNOWN_FROM and not self.frames_before and not self.is_alone:
                self._see_how_it_began(fit.pose)
            self.velocity, self.mean_velocity = velocity, mean
        self.correlation = fit.correlation
        self.frames_missed = self.frames_held = 0
        self.since = 0.0
        self.pose = fit.pose
        self.poses.append(fit.pose)
        if self.is_alone or (len(self.poses) > KNOWN_FROM and is_smooth):
            self.exposure.add(picture, self.template, self.pose, self.velocity)
        if self.speed_px * self.exposure.share <= PATCH_PX:
            self._keep(patch_at(picture.grey, self.pose, self.template.radius))

    def _is_held(self, fit: Fit) -> bool:
        """Whether the object is shown where it was though it moved: first frame of a stop, too."""
        is_first = not self.frames_held and not self.frames_missed
        step = length(fit.pose - self.pose)
        return is_first and self.speed_px > HELD_SPEED_PX and step < HELD_SHARE * self.speed_px

    def _near(self, before: Picture | None, picture: Picture) -> Fit | None:
        """The best fit around where the object was, went, or is led to by its features."""
        guesses = [self._expected(), self.pose]
        if before is not None and not self.frames_missed:
            if (fit := self._as_expected(picture)) is not None:
                return fit
            reach = int(np.ceil(2 * self.since * self.speed_px)) + 16
            features = follow(before.grey, picture.grey, self.pose, self.template.region, reach)
            if (motion := rigid_motion(*features)) is not None:
                angle, shift = motion
                place = rotation(angle) @ self.pose[:2] + shift
                turned = self.pose[2] + (angle if self.template.shows_turns else 0.0)
                guesses.insert(0, np.array([*place, turned]))
        return self._best(picture, guesses, FOUND)

    def _as_expected(self, picture: Picture) -> Fit | None:
        """The object where it should be, looking as it did; its features would tell no more."""
        expected = self._expected()
        motion = own_motion(self.velocity, expected[2])
        guess = self._compared(expected, motion, (self.exposure.share,))[0]
        fit = align(*guess.pair(picture, self.template, FINE_PX), expected)
        is_there = length(fit.pose - expected) < AS_EXPECTED_PX
        least = max(SURE, self.correlation - AS_SEEN)
        return fit if is_there and self._is_it(picture, fit, least) else None

    def _far(self, picture: Picture) -> Fit | None:
        """The best fit in a wide neighbourhood; rarely looked for while the object is gone."""
        missed = self.frames_missed
        if missed & (missed - 1):  # at once, after 1, 2, 4, 8, ... frames
            return None
        reach = max(2 * self.speed_px, REACH_SHARE * max(picture.size_px))
        poses = candidate_poses(picture.grey, self.template, self._expected(), reach)
        if (fit := self._best(picture, poses, FOUND_AGAIN)) is not None:
            return fit
        most = max(self.speed_px, HIT_GAIN * self.fastest_px)
        if self.is_alone or most < MIN_SPEED_PX:
            return None
        shares = tuple(filter(None, self.exposure.trials))
        last = self.pose, self.velocity, self.since
        guesses = after_blow(picture, self.template, *last, shares, most)
        return self._best_of(picture, guesses, FOUND_AGAIN)

    def _see_how_it_began(self, pose: np.ndarray) -> None:
        """Whether the object, now in its third frame, moved in its first, and how.

        If so the template, taken from the first frame, is smeared.
        """
        steps = np.diff([*self.poses, pose], axis=0)
        change = steps[1] - steps[0]
        velocity = steps[0] - (0 if length(change) > 0.5 * length(steps[1]) else change / 2)
        # NaN compares False: if it was not found in between nobody knows.
        if length(velocity) >= MIN_SPEED_PX:
            self.template = replace(self.template, moved=own_motion(velocity, self.first_pose[2]))

    def _compared(
        self, pose: np.ndarray, motion: np.ndarray, shares: tuple[float, ...]
    ) -> list[Guess]:
        """How the object, moving so (own axes, per frame), is compared with its template."""
        template = self.template
        if template.is_sharp:
            smears = distinct([share * motion for share in shares], template.radius)
            return [Guess(pose, smear) for smear in smears]
        if length(motion - template.moved) < MIN_SPEED_PX:
            return [Guess(pose, np.zeros(3))]
        return [Guess(pose, share * motion, share * template.moved) for share in shares]

    def _best(self, picture: Picture, poses: list[np.ndarray], least: float) -> Fit | None:
        """The best fit from the guessed `poses` if it can be the object."""
        motions = [own_motion(self._velocity_to(pose)[1], pose[2]) for pose in poses]
        guesses = [
            guess
            for pose, motion in zip(poses, motions, strict=True)
            for guess in self._compared(pose, motion, self.exposure.trials)
        ]
        return self._best_of(picture, guesses, least)

    def _best_of(self, picture: Picture, guesses: list[Guess], least: float) -> Fit | None:
        """The best fit from the guesses if it can be the object."""
        if not guesses:
            return None
        fit = best_fit(picture, self.template, guesses)
        width, height = picture.size_px
        is_inside = 0 <= fit.pose[0] < width and 0 <= fit.pose[1] < height
        leap = min(length(fit.pose - place) for place in (self.pose, self._expected()))
        is_upright = abs(fit.pose[2] - self.pose[2]) <= MAX_TURN_RAD
        is_possible = is_inside and leap <= self._leap_px() and is_upright
        return fit if is_possible and self._is_it(picture, fit, least) else None

    def _is_it(self, picture: Picture, fit: Fit, least: float) -> bool:
        """Whether it looks like the object, where no other one is and none like it stood before."""
        near = SAME_PLACE * self.size_px
        is_free = all(length(fit.pose - place) > near for place in self.taken)
        is_it = is_alike(fit) and fit.correlation >= least and is_free
        return is_it and not self._is_scene(picture, fit)

    def _is_scene(self, picture: Picture, fit: Fit) -> bool:
        """Whether what was found stood there before the object came.

        A region with some background in it can fit the scene once the object has gone.
        """
        if length(fit.pose - self.first_pose) < self.template.radius:
            return False
        target = self.template.sharp(FINE_PX)
        then, now = (target.values_at(one, fit.pose) for one in (self.first_picture, picture))
        if not (np.ptp(then) and np.ptp(now)):
            return False  # nothing is seen there
        return float(np.corrcoef(then, now)[0, 1]) > fit.correlation

    def _expected(self) -> np.ndarray:
        """Where the object should be if it goes on, for a few frames of hiding."""
        return self.pose + min(self.since, MAX_COAST_FRAMES) * self.velocity

    def _leap_px(self) -> float:
        """How far from the expected place the object can be; any distance while it is new."""
        if len(self.poses) - self.frames_before - self.frames_missed < SETTLED_FRAMES:
            return np.inf
        most = max(1.5 * self.speed_px, self.template.radius, HIT_GAIN * self.fastest_px)
        return most * min(self.since, MAX_LEAP_FRAMES)

    def _velocity_to(self, pose: np.ndarray) -> tuple[np.ndarray, np.ndarray, bool]:
        """The mean velocity since the last frame, that at `pose`, and whether a blow changed it.

        That at `pose` is the mean one plus half its change: without this a steadily accelerated
        object seems slower than it is, and the exposure longer. Where the speed changes by more
        than a half, it was a blow.
        """
        mean = (pose - self.pose) / self.since
        change = mean - self.mean_velocity
        is_blow = length(change) > 0.5 * length(mean)
        return mean, mean if is_blow else mean + change / 2, is_blow

    def _keep(self, patch: np.ndarray) -> None:
        """Renews the template from the sharp patches so far."""
        if not self.template.is_sharp:
            # The first sharp look of what was smeared takes the smeared one's place.
            self.patches, self.frames_sharp, self.stride = [], 0, 1
            self.template = self.template.renewed(patch)
        if self.frames_sharp % self.stride == 0:
            self.patches.append(patch)
            if len(self.patches) > MAX_PATCHES:
                del self.patches[1::2]
                self.stride *= 2
        self.frames_sharp += 1
        if self.frames_sharp in RENEWALS:
            self.template = median_template(self.patches, self.template)
