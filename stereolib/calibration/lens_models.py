"""The lens models by name, and where a fitted lens folds over: pixels of its image that no direction is seen at."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from stereolib.rig import Camera, distort

#: Lens models by name, shortest first: (number of coefficients, OpenCV flags). Table I is ``brown3``; ``brown2`` is all
#: that Kalibr's files hold.
LENS_MODELS: dict[str, tuple[int, int]] = {
    "pinhole": (0, cv2.CALIB_ZERO_TANGENT_DIST | cv2.CALIB_FIX_K1 | cv2.CALIB_FIX_K2 | cv2.CALIB_FIX_K3),
    "brown2": (4, cv2.CALIB_FIX_K3),
    "brown3": (5, 0),
    "rational8": (8, cv2.CALIB_RATIONAL_MODEL),
    "thin_prism12": (12, cv2.CALIB_RATIONAL_MODEL | cv2.CALIB_THIN_PRISM_MODEL),
    "tilted14": (14, cv2.CALIB_RATIONAL_MODEL | cv2.CALIB_THIN_PRISM_MODEL | cv2.CALIB_TILTED_MODEL),
}
_RING_POINTS = 361  # of the circle on which the lens folds, one for each degree
_WITHIN = 0.97  # of the fold's smallest radius: within it every pixel has a direction, and need not be asked


@dataclass(frozen=True)
class LensFold:
    """Where a lens folds over inside its image.

    Attributes
    ----------
    where : str
        The corners of the image, each with its number of pixels.
    pixels : int
        So many have no direction.
    radius_px : float
        From so far off the centre outwards.
    share : float
        Of the image's pixels, 0 to 1.
    """

    where: str
    pixels: int
    radius_px: float
    share: float

    def __str__(self) -> str:
        return f"folds over in the {self.where}, {self.radius_px:.0f} px and more from the centre"


def fold_inside(camera: Camera) -> LensFold | None:
    """Find out whether a lens folds over inside its image, and where.

    A radial polynomial that fits the boards may turn back where none was seen: ``d(r g)/dr <= 0``. What the image
    shows there has no inverse.

    Parameters
    ----------
    camera : Camera

    Returns
    -------
    LensFold or None
        None when it does not.

    Examples
    --------
    >>> K = [[700, 0, 320], [0, 700, 240], [0, 0, 1]]
    >>> fold_inside(Camera(K, [0.1, 0, 0, 0], (640, 480))) is None
    True
    >>> print(fold_inside(Camera(K, [-0.9, 0, 0, 0], (640, 480))).radius_px.__round__())
    284
    """
    if not np.isfinite(camera.fold_radius):
        return None
    width, height = camera.size
    u, v = np.meshgrid(np.arange(width), np.arange(height))
    angle = np.linspace(0, 2 * np.pi, _RING_POINTS)
    ring, _ = distort(camera.fold_radius * np.column_stack([np.cos(angle), np.sin(angle)]), camera.dist)
    radius = np.hypot((u - camera.K[0, 2]) / camera.K[0, 0], (v - camera.K[1, 2]) / camera.K[1, 1])
    outside = radius > _WITHIN * np.hypot(*ring.T).min()  # within, every pixel has a direction
    lost = np.zeros((height, width), bool)
    lost[outside] = ~np.isfinite(camera.rays(np.column_stack([u[outside], v[outside]]))[:, 0])
    if not lost.any():
        return None
    parts = [part for band in np.array_split(lost, 2) for part in np.array_split(band, 2, axis=1)]
    corners = zip(("upper left", "upper right", "lower left", "lower right"), parts, strict=True)
    where = " and ".join(f"{name} corner ({part.sum()} px)" for name, part in corners if part.any())
    far = np.hypot(u - camera.K[0, 2], v - camera.K[1, 2])[lost].min()
    return LensFold(where, int(lost.sum()), float(far), float(lost.mean()))
