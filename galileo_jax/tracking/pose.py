"""Poses of a rigid object in the image, and the patch an object fills at a pose.

A pose is an array `(x, y, angle)`: the place of the followed point in pixels (x right, y
down) and the rotation since the template was taken, radians, clockwise positive. A patch is
the image seen in the object's own axes: its centre pixel is the followed point.
"""

import cv2
import numpy as np

SHARP_PX = 0.1  # A motion during the exposure that is shorter leaves the picture as it is


def length(motion: np.ndarray) -> float:
    """Of the shift in a motion `(dx, dy, ...)`, px."""
    return float(np.hypot(motion[0], motion[1]))


def rotation(angle_rad: float) -> np.ndarray:
    """The `[2, 2]` matrix that turns image vectors clockwise (x right, y down)."""
    c, s = np.cos(angle_rad), np.sin(angle_rad)
    return np.array([[c, -s], [s, c]])


def corners(places: np.ndarray, angle_rad: float) -> tuple[np.ndarray, np.ndarray]:
    """The least and the largest coordinates, `[2]` each, of places along axes that are turned."""
    own = places @ rotation(angle_rad)
    return own.min(axis=0), own.max(axis=0)


def compose(pose: np.ndarray, motion: np.ndarray) -> np.ndarray:
    """`pose` followed by `motion`, a small pose given in the object's own axes."""
    return np.array([*(pose[:2] + rotation(pose[2]) @ motion[:2]), pose[2] + motion[2]])


def own_motion(velocity: np.ndarray, angle_rad: float) -> np.ndarray:
    """A pose's change per frame `(dx, dy, dangle)`, its shift turned into the object's axes."""
    return np.array([*(rotation(angle_rad).T @ velocity[:2]), velocity[2]])


def patch_at(image: np.ndarray, pose: np.ndarray, radius: int) -> np.ndarray:
    """The float32 patch `[2 radius + 1, 2 radius + 1]` of a grey `image` at `pose` (Lanczos).

    Beyond the border the image is continued by its last pixels. Not bicubic: OpenCV's
    kernel (a = -0.75) does not reproduce a straight line; it shifts by up to 0.048 px,
    towards whole pixels, and positions would carry that error.
    """
    turn = rotation(pose[2])
    shift = pose[:2] - turn @ (radius, radius)
    # Only the square around the object is converted and sampled: time per object, not per frame.
    crop, corner = square_around(image, pose[:2], int(np.ceil(radius * 1.5)) + 3)
    return cv2.warpAffine(
        crop.astype(np.float32),
        np.column_stack([turn, shift - corner]),
        (2 * radius + 1, 2 * radius + 1),
        flags=cv2.INTER_LANCZOS4 | cv2.WARP_INVERSE_MAP,
        borderMode=cv2.BORDER_REPLICATE,
    )


def square_around(
    image: np.ndarray, place: np.ndarray, reach: int
) -> tuple[np.ndarray, tuple[int, int]]:
    """What of an image is within `reach` pixels of a place, never empty, and its corner (x, y)."""
    height, width = image.shape
    x, y = (int(c) for c in np.floor(place))
    left, top = min(max(x - reach, 0), width - 1), min(max(y - reach, 0), height - 1)
    right, bottom = min(x + reach + 2, width), min(y + reach + 2, height)
    return image[top : max(bottom, top + 1), left : max(right, left + 1)], (left, top)


def moved(patch: np.ndarray, motion: np.ndarray, border: int = cv2.BORDER_REPLICATE) -> np.ndarray:
    """A patch that is turned about its middle and shifted, `(dx, dy, dangle)`."""
    turn, middle = rotation(motion[2]), np.full(2, (patch.shape[0] - 1) / 2)
    matrix = np.column_stack([turn, middle + motion[:2] - turn @ middle])
    return cv2.warpAffine(patch, matrix, patch.shape[::-1], borderMode=border)


def smear(patch: np.ndarray, motion: np.ndarray) -> np.ndarray:
    """A patch as seen while the object moves by `motion` (own axes) during the exposure.

    The mean of the patch over the poses from `-motion / 2` to `+motion / 2`: the blur of a
    constant velocity and turn, centred on the pose itself.
    """
    turning = abs(motion[2]) * (patch.shape[0] - 1) / 4
    if length(motion) + turning < SHARP_PX:
        return patch
    if turning < SHARP_PX:
        return smeared_along(patch, motion[:2])
    return np.mean([moved(patch, share * motion) for share in _shares(length(motion) + turning)], 0)


def smeared_along(image: np.ndarray, shift: np.ndarray) -> np.ndarray:
    """A picture that is smeared evenly along `shift` (x, y), px, centred; as `smear`."""
    if length(shift) < SHARP_PX:
        return image
    kernel = _kernel(_shares(length(shift))[:, None] * shift)
    return cv2.filter2D(image, -1, kernel, borderType=cv2.BORDER_REPLICATE)


def _shares(length_px: float) -> np.ndarray:
    """Instants of an exposure, -1/2 to 1/2, between which less than a pixel is gone."""
    samples = int(np.ceil(length_px)) + 1
    return (np.arange(samples) + 0.5) / samples - 0.5


def _kernel(shifts: np.ndarray) -> np.ndarray:
    """The filter that averages an image over `shifts` `[n, 2]`, each by linear interpolation."""
    reach = int(np.ceil(np.abs(shifts).max()))
    kernel = np.zeros((2 * reach + 3, 2 * reach + 3), np.float32)
    # The filter reads at +offset what is shifted by -offset; the shifts are symmetric.
    low = np.floor(shifts).astype(int)
    x, y = (shifts - low).T
    column, row = (low + reach + 1).T
    for i, j, part in (
        (0, 0, (1 - x) * (1 - y)), (1, 0, x * (1 - y)), (0, 1, (1 - x) * y), (1, 1, x * y),
    ):  # fmt: skip
        np.add.at(kernel, (row + j, column + i), part)
    return kernel / len(shifts)
