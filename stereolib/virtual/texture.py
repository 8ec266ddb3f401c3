"""Procedural surfaces, filtered to what a pixel covers so that nothing flickers or aliases."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache

import cv2
import numpy as np

from stereolib.base import Float32, Float64, Floats, set_frozen

_TEXELS = 1024
_TEXELS_PER_FEATURE = 4
_REMAPPED_COLUMNS = 256


@lru_cache(maxsize=24)
def noise_pyramid(seed: int) -> tuple[Float32, ...]:
    """Draw periodic band-limited noise of zero mean and unit deviation, and its halvings.

    Parameters
    ----------
    seed : int

    Returns
    -------
    tuple of (n, n) float32, n = 1024, 512, ... 8
        Level 0 has a correlation length of 4 texels; each is padded by one texel so that it wraps.
    """
    rng = np.random.default_rng(seed)
    white = np.fft.rfft2(rng.standard_normal((_TEXELS, _TEXELS)))
    frequency = np.hypot(np.fft.fftfreq(_TEXELS)[:, None], np.fft.rfftfreq(_TEXELS))
    # Mostly features of the wanted size, with a tail of larger blotches as real prints and wood have.
    fine = np.exp(-0.5 * (2 * np.pi * frequency * _TEXELS_PER_FEATURE / 2.6) ** 2)
    coarse = np.exp(-0.5 * (2 * np.pi * frequency * _TEXELS_PER_FEATURE * 2.5) ** 2)
    tile = np.fft.irfft2(white * (fine + 2.5 * coarse))
    tile = np.tanh((tile - tile.mean()) / tile.std())
    return _pyramid(tile)


@dataclass(frozen=True, eq=False)
class Tile:
    """A pattern of one's own that repeats over a surface, instead of noise.

    Parameters
    ----------
    values : (n, n) array, n = 1024, 512, ...
        In any unit; columns run along the face's first axis. They are shifted and scaled to zero mean and unit
        deviation.
    mm_per_texel : float

    Raises
    ------
    ValueError
        If it is not square or its side no power of two, or nothing is drawn on it.
    """

    values: Float64
    mm_per_texel: float
    levels: tuple[Float32, ...] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        values, shape = np.asarray(self.values, np.float64), np.shape(self.values)
        if len(shape) != 2 or shape[0] != shape[1] or shape[0] < 8 or shape[0] & (shape[0] - 1):
            raise ValueError(f"a tile is square, its side a power of two of 8 or more; got {shape}")
        if not values.std() > 0:
            raise ValueError("a tile of one value shows nothing: give the material no contrast instead")
        set_frozen(self, values=values, levels=_pyramid(values))


def _pyramid(tile: Float64) -> tuple[Float32, ...]:
    """A tile at zero mean and unit deviation and its halvings, each padded by one texel so that it wraps."""
    levels = [((tile - tile.mean()) / tile.std()).astype(np.float32)]
    while levels[-1].shape[0] > 8:
        levels.append(cv2.resize(levels[-1], None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA))
    return tuple(np.pad(level, (0, 1), mode="wrap") for level in levels)


def noise(u_mm: Floats, v_mm: Floats, footprint_mm: Floats, scale_mm: float, seed: int) -> Float32:
    """Look a noise texture up, blurred to what a pixel covers.

    Parameters
    ----------
    u_mm, v_mm : (N,) array
        Surface coordinates, mm.
    footprint_mm : (N,) array
        What a pixel covers there, mm.
    scale_mm : float
        Size of the texture's features, mm.
    seed : int

    Returns
    -------
    (N,) float32
        Of zero mean and, where nothing is blurred, unit deviation.
    """
    return filtered(noise_pyramid(seed), u_mm, v_mm, footprint_mm, scale_mm / _TEXELS_PER_FEATURE)


def filtered(
    pyramid: tuple[Float32, ...], u_mm: Floats, v_mm: Floats, footprint_mm: Floats, texel_mm: float
) -> Float32:
    """Look a tile up, blurred to what a pixel covers.

    Parameters
    ----------
    pyramid : tuple of (n, n) float32
        As of `noise_pyramid` or of a `Tile`.
    u_mm, v_mm, footprint_mm : (N,) array
        As for `noise`.
    texel_mm : float
        What a texel of level 0 covers.

    Returns
    -------
    (N,) float32
    """
    level = np.clip(np.log2(np.maximum(footprint_mm / texel_mm, 1e-6)), 0, len(pyramid) - 1.001)
    lower = level.astype(np.int32)
    value = np.empty(len(level), np.float32)
    for k in np.flatnonzero(np.bincount(lower)).tolist():
        at = np.flatnonzero(lower == k)
        blend = (level[at] - k).astype(np.float32)
        # A texel of level j covers 2**j of level 0, whose centres have integer coordinates.
        fine, coarse = (
            _lookup(pyramid[j], *(x[at] / (texel_mm * 2**j) + (0.5 / 2**j - 0.5) for x in (u_mm, v_mm)))
            for j in (k, k + 1)
        )
        value[at] = fine + blend * (coarse - fine)
    return value


def checker(u_mm: Floats, v_mm: Floats, width_mm: tuple[Floats, Floats], square_mm: float) -> Floats:
    """Evaluate a checkerboard with edges as soft as the footprint (exact box filter).

    The origin is the corner of four squares; the square at u, v > 0 is black.

    Parameters
    ----------
    u_mm, v_mm : (N,) array
        Surface coordinates, mm.
    width_mm : two (N,) arrays
        What a pixel covers along u and v, mm.
    square_mm : float

    Returns
    -------
    (N,) float64
        0 (black) to 1 (white).

    Examples
    --------
    >>> u = np.array([-5.0, 0.0, 5.0])
    >>> checker(u, np.full(3, 5.0), (np.full(3, 1.0), np.full(3, 1.0)), 25.0)
    array([1. , 0.5, 0. ])
    """
    return 0.5 - 0.5 * _square_wave(u_mm, width_mm[0], square_mm) * _square_wave(v_mm, width_mm[1], square_mm)


def _square_wave(x: Floats, width: Floats, half_period: float) -> Floats:
    """Mean of a +-1 square wave over [x - width/2, x + width/2]: difference of its integral, a triangle wave."""
    width = np.clip(width, 1e-3, None)

    def integral(t: Floats) -> Floats:
        phase = np.mod(t, 2 * half_period)
        wave: Floats = np.minimum(phase, 2 * half_period - phase)
        return wave

    return (integral(x + width / 2) - integral(x - width / 2)) / width


def _lookup(tile: Float32, u: Floats, v: Floats) -> Floats:
    """Bilinear lookup with wrap; `tile` carries one texel of padding. In single precision to 1/32 texel, and faster."""
    n = tile.shape[0] - 1
    if u.dtype == np.float32:
        return _remapped(tile, u, v)
    x, y = np.mod(u, n), np.mod(v, n)
    column, row = x.astype(np.intp), y.astype(np.intp)
    x, y = x - column, y - row
    at = row * (n + 1) + column
    upper, lower = ((1 - x) * tile.take(at + k) + x * tile.take(at + k + 1, mode="clip") for k in (0, n + 1))
    return np.asarray((1 - y) * upper + y * lower)


def _remapped(tile: Float32, u: Floats, v: Floats) -> Float32:
    """`_lookup` by OpenCV, which wants maps of less than 32767 rows and columns."""
    n, count = tile.shape[0] - 1, len(u)
    maps = np.zeros((2, -(-count // _REMAPPED_COLUMNS), _REMAPPED_COLUMNS), np.float32)
    for place, x in zip(maps.reshape(2, -1), (u, v), strict=True):
        np.subtract(x, n * np.floor(x / n), out=place[:count])
    found = cv2.remap(tile, maps[0], maps[1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(found, np.float32).reshape(-1)[:count]
