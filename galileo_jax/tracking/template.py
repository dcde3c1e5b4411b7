"""An object's template: its patch, the region that belongs to it, and its smeared versions."""

from dataclasses import dataclass, field, replace
from functools import cached_property

import cv2
import numpy as np

from galileo_jax.tracking.alignment import FINE_PX, Target
from galileo_jax.tracking.pose import patch_at, rotation, smear

CORE_SHARE = 0.88
"""Only this share of the declared size is compared: the rim shows background when the scale
is a few percent off, and is what another object touches."""
RIM_SHARE = 1.4
"""Of its size: up to where a plain object is compared, its edge against what is behind."""
PLAIN = 2.0e3
"""Texture (see `is_plain`) below which an object counts as plain: with a noise of five grey
levels its place would be known to 0.1 px only."""
WINDOW_PX = 21.0  # side of the region of unknown size: the object and some of what is around it
WINDOWS_PX = (WINDOW_PX, 2 * WINDOW_PX, 4 * WINDOW_PX)
"""The first that has texture is taken: the middle of a plain object has none, but its edge."""
ALWAYS = 0.99  # of the exposure that the object covers a pixel that is compared
MIN_REGION_SHARE = 0.3  # of the sharp region that a smeared one keeps at least


@dataclass(frozen=True)
class Outline:
    """The rectangle (or disc) an object fills in the image."""

    size_px: tuple[float, float] | None  # (width, height) in the object's own axes; None if unknown
    angle_rad: float = 0.0  # how much those axes are turned in the template's frame
    is_round: bool = False  # a disc or ring seen from the side of its axis


@dataclass(frozen=True)
class Template:
    """`image` `[size, size]` float32, and `region` (bool), the pixels that are compared.

    `moved` is the object's change of place (own axes) and angle per frame when the image was
    taken: it is smeared by the open share of that. 0: it is sharp.
    """

    image: np.ndarray
    region: np.ndarray
    moved: np.ndarray = field(default_factory=lambda: np.zeros(3))
    is_plain: bool = False  # known by its edge alone, in a colour of its own
    _sharp: dict[float, Target] = field(default_factory=dict, repr=False)

    @property
    def radius(self) -> int:
        """Pixels from the centre, the followed point, to the patch's border."""
        return (self.image.shape[0] - 1) // 2

    def renewed(self, image: np.ndarray) -> "Template":
        """A sharp one of the same region."""
        return Template(image, self.region, is_plain=self.is_plain)

    @cached_property
    def shows_turns(self) -> bool:
        """False for a plain disc, which looks the same however it is turned."""
        return self.sharp(FINE_PX).shows_turns

    @property
    def is_sharp(self) -> bool:
        """Whether it was taken of an object that hardly moved."""
        return not self.moved.any()

    def target(
        self, motion: np.ndarray, width_px: float, through: np.ndarray | None = None
    ) -> Target:
        """What a patch looks like that moves by `motion` (own axes) during the exposure, smoothed.

        `through` is a smear that is in this template and is given to the picture, too: what neither
        smear brings in from beside the object is compared.
        """
        smeared = smear(self.image, motion)
        if smeared is self.image and through is None:
            return self.sharp(width_px)
        share = smear(self.region.astype(np.float32), motion)
        if through is not None:
            share = smear(share, through)
        least, region = MIN_REGION_SHARE * self.region.mean(), share >= ALWAYS
        if region.mean() < least:
            region = share >= np.quantile(share, 1 - least)
        return Target(smeared, region, width_px, self.shows_turns, self.is_plain)

    def sharp(self, width_px: float) -> Target:
        """What a patch looks like that does not move."""
        if width_px not in self._sharp:
            self._sharp[width_px] = Target(
                self.image, self.region, width_px, is_plain=self.is_plain
            )
        return self._sharp[width_px]


def template_at(
    image: np.ndarray, point_px: np.ndarray, outline: Outline, by_edge: bool = False
) -> Template:
    """The template of the object at `point_px` in the grey `image`.

    `by_edge`: it is plain, though an edge of it may seem to be texture of its middle.
    """

    def cut(outline: Outline, share: float) -> Template:
        region = region_of(outline, share)
        patch = patch_at(image, np.array([*point_px, 0.0]), region.shape[0] // 2)
        return Template(patch, region)

    if outline.size_px is not None:
        core = cut(outline, CORE_SHARE)
        if by_edge:
            return replace(cut(outline, RIM_SHARE), is_plain=True)
        return cut(outline, RIM_SHARE) if is_plain(core) else core
    windows = [cut(Outline((side, side), outline.angle_rad), 1.0) for side in WINDOWS_PX]
    return next((one for one in windows if not is_plain(one)), windows[0])


def is_plain(template: Template) -> bool:
    """Whether a template has so little texture that its place is hardly known.

    By the smaller eigenvalue of the summed structure tensor, grey levels^2 (Shi, Tomasi 1994): the
    variance of the place is the noise's variance divided by it.
    """
    return float(np.linalg.eigvalsh(template.sharp(FINE_PX).normal[:2, :2])[0]) < PLAIN


def region_of(outline: Outline, share: float) -> np.ndarray:
    """The pixels within `share` of an object's outline, `[size, size]` (bool), size odd."""
    assert outline.size_px is not None
    half = np.array(outline.size_px) * share / 2
    radius = int(np.ceil(np.hypot(*half))) + 2
    grid = np.arange(-radius, radius + 1, dtype=float)
    own = np.stack(np.meshgrid(grid, grid), axis=-1) @ rotation(outline.angle_rad) / half
    return (np.hypot(*own.T).T if outline.is_round else np.abs(own).max(axis=-1)) <= 1


def median_template(patches: list[np.ndarray], like: Template) -> Template:
    """The pixelwise median of aligned patches: less noise, and no hand that was there a while.

    `like`: the template that they look like. Each patch is first brought to the common brightness
    (gain and offset by its median and spread in the region).
    """
    stack = np.stack(patches)
    inside = stack[:, like.region]
    middle = np.median(inside, axis=1)
    spread = np.median(np.abs(inside - middle[:, None]), axis=1)
    if like.is_plain:  # more than half of its region looks the same
        spread = np.ptp(np.quantile(inside, (0.25, 0.75), axis=1), axis=0) / 2
    spread += 1e-3
    scaled = (stack - middle[:, None, None]) / spread[:, None, None]
    scaled = scaled * np.median(spread) + np.median(middle)
    return like.renewed(np.median(scaled, axis=0).astype(np.float32))


def grey(frame: np.ndarray) -> np.ndarray:
    """The grey uint8 picture of a BGR frame."""
    return cv2.cvtColor(frame, cv2.COLOR_BGR2GRAY) if frame.ndim == 3 else frame
