"""The webcam behind the lens: blur, vignetting, exposure, noise, 8 bits, JPEG."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from stereolib.base import Floats, UInt8

_MEAN_GREY = 0.42  # share of white that the automatic exposure aims at
_GAMMA = 2.2


@dataclass(frozen=True)
class Webcam:
    """A cheap camera with automatic exposure.

    Parameters
    ----------
    psf_sigma_px : float
        Width of the point spread function.
    vignetting : float
        Share of light lost in the image's corner.
    full_well_e : float
        Electrons that white collects in good light; the fewer, the more noise.
    read_noise_e : float
        Noise of the dark sensor, electrons.
    max_gain : float
        How much the automatic exposure brightens a dark picture at most.
    jpeg_quality : int
        Quality of the stream, 1 to 100.
    """

    psf_sigma_px: float = 0.6
    vignetting: float = 0.22
    full_well_e: float = 6000.0
    read_noise_e: float = 12.0
    max_gain: float = 6.0
    jpeg_quality: int = 90

    def expose(self, light: Floats, rng: np.random.Generator) -> UInt8:
        """Turn linear light into a picture.

        Parameters
        ----------
        light : (H, W, 3) float64 or float32
            Blue, green, red; 1 is white paper in good light.
        rng : numpy.random.Generator
            Draws the noise field: normal, scaled by the root of the signal. A Poisson draw would do it too, but its
            rejection steps flip with the last bit of the rate, and the picture must not depend on the processor.

        Returns
        -------
        (H, W, 3) uint8
        """
        height, width = light.shape[:2]
        x = (np.arange(width) - (width - 1) / 2) / (np.hypot(width, height) / 2)
        y = (np.arange(height) - (height - 1) / 2) / (np.hypot(width, height) / 2)
        falloff = 1 - self.vignetting * (x**2 + (y**2)[:, None])
        received = cv2.GaussianBlur(light, (0, 0), self.psf_sigma_px) * falloff[..., None]
        electrons = received * self.full_well_e
        noise = rng.standard_normal(light.shape, np.float32)
        electrons = electrons + noise * np.sqrt(electrons + self.read_noise_e**2)
        gain = np.clip(_MEAN_GREY / max(float(received.mean()), 1e-6), 1 / self.max_gain, self.max_gain)
        signal = np.clip(electrons * (gain / self.full_well_e), 0, 1)
        return np.asarray(np.rint(255 * signal ** (1 / _GAMMA)), np.uint8)

    def encode(self, image: UInt8) -> bytes:
        """Compress a picture as the camera does.

        Parameters
        ----------
        image : (H, W, 3) uint8

        Returns
        -------
        bytes
            JPEG.

        Raises
        ------
        ValueError
            If it is no such picture.
        """
        ok, data = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, self.jpeg_quality])
        if not ok:
            raise ValueError(f"could not encode an image of shape {image.shape} and type {image.dtype} as JPEG")
        return bytes(data)

    def shoot(self, light: Floats, rng: np.random.Generator) -> UInt8:
        """Take a picture and send it: `expose`, through JPEG and back.

        Parameters
        ----------
        light, rng
            As for `expose`.

        Returns
        -------
        (H, W, 3) uint8
            What a program receives from the camera.

        Examples
        --------
        >>> grey = np.full((48, 64, 3), 0.2)
        >>> Webcam().shoot(grey, np.random.default_rng(0)).shape
        (48, 64, 3)
        """
        received = cv2.imdecode(np.frombuffer(self.encode(self.expose(light, rng)), np.uint8), cv2.IMREAD_COLOR)
        return np.asarray(received)
