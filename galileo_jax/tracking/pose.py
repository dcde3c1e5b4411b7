"""Poses of a rigid object in the image, and the patch an object fills at a pose.

A pose is an array `(x, y, angle)`: the place of the followed point in pixels (x right, y
down) and the rotation since the template was taken, radians, clockwise positive. A patch is
the image seen in the object's own axes: its centre pixel is the followed point.
"""

import cv2
import numpy as np

SHARP_PX = 0.1
"""A motion during the exposure that is shorter leaves the picture as it is."""


def rotation(angle_rad: float) -> np.ndarray:
    """The `[2, 2]` matrix that turns image vectors clockwise (x right, y down)."""
    c, s = np.cos(angle_rad), np.sin(angle_rad)
    return np.array([[c, -s], [s, c]])


def compose(pose: np.ndarray, motion: np.ndarray) -> np.ndarray:
    """`pose` followed by `motion`, a small pose given in the object's own axes."""
    return np.array([*(pose[:2] + rotation(pose[2]) @ motion[:2]), pose[2] + motion[2]])


def patch_at(image: np.ndarray, pose: np.ndarray, radius: int) -> np.ndarray:
    """The float32 patch `[2 radius + 1, 2 radius + 1]` of a grey `image` at `pose` (Lanczos).

    Beyond the border the image is continued by its last pixels. Not bicubic: OpenCV's
    kernel (a = -0.75) does not reproduce a straight line; it shifts by up to 0.048 px,
    towards whole pixels, and positions would carry that error.
    """
    turn = rotation(pose[2])
    shift = pose[:2] - turn @ (radius, radius)
    # Only the square around the object is converted and sampled: time per object, not per frame.
    reach = int(np.ceil(radius * 1.5)) + 3
    x0, y0 = (int(np.floor(c)) - reach for c in pose[:2])
    x1, y1 = x0 + 2 * reach + 1, y0 + 2 * reach + 1
    height, width = image.shape[:2]
    left, top = min(max(x0, 0), width - 1), min(max(y0, 0), height - 1)
    crop = image[top : max(min(y1, height), top + 1), left : max(min(x1, width), left + 1)]
    return cv2.warpAffine(
        crop.astype(np.float32),
        np.column_stack([turn, shift - (left, top)]),
        (2 * radius + 1, 2 * radius + 1),
        flags=cv2.INTER_LANCZOS4 | cv2.WARP_INVERSE_MAP,
        borderMode=cv2.BORDER_REPLICATE,
    )


def smear(image: np.ndarray, motion: np.ndarray) -> np.ndarray:
    """A patch as seen while the object moves by `motion` (own axes) during the exposure.

    The mean of the patch over the poses from `-motion / 2` to `+motion / 2`: the blur of a
    constant velocity and turn, centred on the pose itself.
    """
    radius = (image.shape[0] - 1) / 2
    turning = abs(motion[2]) * radius / 2
    length = np.hypot(*motion[:2]) + turning
    if length < SHARP_PX:
        return image
    if turning < SHARP_PX:
        return smeared_along(image, motion[:2])
    samples = int(np.ceil(length)) + 1
    shares = (np.arange(samples) + 0.5) / samples - 0.5
    total = np.zeros_like(image)
    centre = np.array([radius, radius])
    for share in shares:
        turn = rotation(share * motion[2])
        shift = centre + share * motion[:2] - turn @ centre
        total += cv2.warpAffine(
            image,
            np.column_stack([turn, shift]),
            image.shape[::-1],
            flags=cv2.INTER_LINEAR,
            borderMode=cv2.BORDER_REPLICATE,
        )
    return total / samples


def smeared_along(image: np.ndarray, shift: np.ndarray) -> np.ndarray:
    """A picture that is smeared evenly along `shift` (x, y), px, centred; as `smear`."""
    length = float(np.hypot(*shift))
    if length < SHARP_PX:
        return image
    samples = int(np.ceil(length)) + 1
    shares = (np.arange(samples) + 0.5) / samples - 0.5
    kernel = _kernel(shares[:, None] * shift)
    return cv2.filter2D(image, -1, kernel, borderType=cv2.BORDER_REPLICATE)


def _kernel(shifts: np.ndarray) -> np.ndarray:
    """The filter that averages an image over `shifts` `[n, 2]`, each by linear interpolation."""
    reach = int(np.ceil(np.abs(shifts).max()))
    kernel = np.zeros((2 * reach + 3, 2 * reach + 3), np.float32)
    # The filter reads at +offset what is shifted by -offset; the shifts are symmetric.
    low = np.floor(shifts).astype(int)
    x, y = (shifts - low).T
    column, row = (low + reach + 1).T
    for i, j, part in (
        (0, 0, (1 - x) * (1 - y)),
        (1, 0, x * (1 - y)),
        (0, 1, (1 - x) * y),
        (1, 1, x * y),
    ):
        np.add.at(kernel, (row + j, column + i), part)
    return kernel / len(shifts)
