"""Pairs with a known truth, and how they are compared with many maps in one go."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any, TypeAlias

import cv2
import numpy as np
import numpy.typing as npt

from stereolib.base import Bools, Float32, Floats, Ints, UInt8
from stereolib.matching.scoring import RIM_PX, Score, beside_jumps, check_mask
from stereolib.matching.sgbm import STEPS_PER_PX, SGBMParams
from stereolib.rig import check_pair, to_grey

_Steps: TypeAlias = npt.NDArray[np.int16]  # of OpenCV, 1/16 px
#: The settings that a sweep varies, by name.
FIELDS = tuple(f.name for f in fields(SGBMParams))
#: What is measured in each region: the fields of `Score`, and `fattening_px` (of the whole map).
METRICS = (*(f.name for f in fields(Score)), "fattening_px")


@dataclass(frozen=True, eq=False)
class KnownView:
    """A rectified pair whose true disparity is known.

    Parameters
    ----------
    name : str
        Tells the view from the others of a sweep.
    left, right : (H, W) or (H, W, 3) uint8
    truth_px : (H, W) float
        True disparity, NaN where unknown.
    visible : (H, W) bool, optional
        Pixels that the right camera sees too; scored as the region ``"visible"``.
    regions : mapping of str to (H, W) bool
        Further regions to score, for example ``{"cube": mask}``.
    about : mapping of str to number or text
        What the rows shall tell of the view, for example ``{"distance_mm": 700}``.

    Raises
    ------
    ValueError
        If the images are no pair, a shape differs, a mask is no mask, or nothing of the truth is known.
    """

    name: str
    left: UInt8
    right: UInt8
    truth_px: Floats
    visible: Bools | None = None
    regions: Mapping[str, Bools] = field(default_factory=dict)
    about: Mapping[str, float | str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        check_pair(self.left, self.right, (f"{self.name}, left", f"{self.name}, right"))
        shape, truth = self.left.shape[:2], np.asarray(self.truth_px)
        if truth.shape != shape:
            shapes = f"the images are {shape}, the truth is {truth.shape}"
            raise ValueError(f"{self.name}: {shapes}: they must have one shape")
        if not np.isfinite(truth).any() or np.isinf(truth).any():
            counted = f"{np.isinf(truth).sum()} pixels are infinite, {np.isnan(truth).sum()} NaN"
            raise ValueError(f"{self.name}: the truth must be in px, NaN where unknown, and known somewhere; {counted}")
        for name, mask in self.masks().items():
            check_mask(mask, shape, f"{self.name}: region {name!r}")
            if not (mask & np.isfinite(truth)).any():
                raise ValueError(f"{self.name}: region {name!r} holds no pixel whose truth is known")
        if clash := ", ".join(sorted(set(self.about) & {"key", "view", "where", *FIELDS, *METRICS})):
            raise ValueError(f"{self.name}: {clash} cannot be told in `about`: a column is called so")

    def masks(self) -> dict[str, Bools]:
        """Collect the regions by name: all, visible, and the view's own.

        Returns
        -------
        dict of str to (H, W) bool
        """
        everywhere = {"all": np.isfinite(self.truth_px)}
        return everywhere | ({} if self.visible is None else {"visible": self.visible}) | dict(self.regions)

    def digest(self) -> str:
        """Make a fingerprint of everything in it.

        Returns
        -------
        str
            32 hexadecimal digits.
        """
        fingerprint = hashlib.blake2b(repr((self.name, sorted(self.about.items()))).encode(), digest_size=16)
        truth = np.asarray(self.truth_px, np.float64)
        arrays: dict[str, npt.NDArray[Any]] = {"left": self.left, "right": self.right, "truth": truth, **self.masks()}
        for name, array in arrays.items():
            fingerprint.update(f"{name} {array.shape}".encode())
            fingerprint.update(np.ascontiguousarray(array).data)
        return fingerprint.hexdigest()


@dataclass(frozen=True, eq=False)
class ReadyView:
    """A view made ready for many comparisons: its pixels in one row, those of the same regions (a class) together.

    Parameters
    ----------
    left, right : (H, W) uint8
    order : (n,) int32
        Index of every known pixel, class after class.
    ends : (classes,) int
        Where the classes end.
    member : (regions, classes) bool
    truth : (n,) float32, 1/16 px
    swing : two (n,) float32
        Cosine and sine of the truth's fraction, for `Score.locking_px`.
    beside : (m,) int32
        Background beside jumps.
    border : (m,) float32, 1/16 px
        The disparity from which it is wrong.
    """

    left: UInt8
    right: UInt8
    order: Ints
    ends: Ints
    member: Bools
    truth: Float32
    swing: tuple[Float32, Float32]
    beside: Ints
    border: Float32

    @classmethod
    def of(cls, view: KnownView) -> ReadyView:
        """Sort a view's pixels.

        Parameters
        ----------
        view : KnownView

        Returns
        -------
        ReadyView
        """
        truth, known = np.asarray(view.truth_px, np.float32).ravel(), np.isfinite(view.truth_px)
        flags = np.stack([(mask & known).ravel() for mask in view.masks().values()])
        bits = 1 << np.arange(len(flags))
        code = np.zeros(truth.shape, np.uint16 if len(flags) <= 16 else np.uint64)  # few bits are sorted faster
        for bit, flag in zip(bits, flags, strict=True):
            code |= flag * code.dtype.type(bit)
        order = np.argsort(code, kind="stable").astype(np.int32)
        order = order[np.count_nonzero(code == 0) :]
        codes, counts = np.unique(code[order], return_counts=True)
        member = (codes.astype(np.int64) & bits[:, None]) > 0
        truth = truth[order]
        swing = np.cos(2 * np.pi * (truth % 1)), np.sin(2 * np.pi * (truth % 1))
        where, border = beside_jumps(view.truth_px, known if view.visible is None else view.visible)
        beside, border = np.flatnonzero(where).astype(np.int32), (STEPS_PER_PX * border[where]).astype(np.float32)
        left, right, ends = to_grey(view.left), to_grey(view.right), np.cumsum(counts)
        return cls(left, right, order, ends, member, STEPS_PER_PX * truth, swing, beside, border)

    def score(self, steps: _Steps, min_disparity: int) -> list[list[float]]:
        """Score OpenCV's answer in every region: as `score` and `fattening_px`, in one go.

        Parameters
        ----------
        steps : (H, W) int16, 1/16 px
        min_disparity : int, px
            Where the search window began: below it there is no match.

        Returns
        -------
        list of list of float
            `METRICS` of each region.
        """
        steps, least = steps.ravel(), STEPS_PER_PX * min_disparity
        known, first = steps.take(self.order), (0, *self.ends[:-1])
        parts = [slice(a, b) for a, b in zip(first, self.ends, strict=True)]
        per_class = np.array([_sums(known[p], least, self.truth[p], *(w[p] for w in self.swing)) for p in parts])
        pixels = np.diff(self.ends, prepend=0)
        lost, o1, o2, o4, n, absolute, square, s, s2, a, b = per_class.T @ self.member.T
        all_of = pixels @ self.member.T
        returned, n = all_of - lost, n - lost  # a missing pixel was set to no error
        with np.errstate(invalid="ignore", divide="ignore"):
            shares = [100 * (count + lost) / all_of for count in (o1, o2, o4)] + [100 * returned / all_of]
            means = [s / n, np.sqrt(s2 / n), absolute / returned, np.sqrt(square / returned), 2 * np.hypot(a, b) / n]
        over = steps.take(self.beside) > np.maximum(self.border, least - 1)
        wide = RIM_PX * np.count_nonzero(over) / over.size if over.size else float("nan")
        return [[float(x) for x in one] + [wide] for one in np.transpose(shares + means)]


def _sums(steps: _Steps, least: int, truth: Float32, cosine: Float32, sine: Float32) -> tuple[float, ...]:
    """Sums over some pixels of which their measures are made, px; disparities come in 1/16 px.

    The sums are not made by BLAS, whose results depend on its number of threads.
    """
    missing = steps < least
    error = np.subtract(steps, truth, dtype=np.float32)
    np.copyto(error, 0, where=missing)
    off = np.abs(error)
    far = off > 64
    counts = [int(np.count_nonzero(x)) for x in (missing, off > 16, off > 32, far)]
    absolute, square = cv2.norm(off, cv2.NORM_L1), cv2.norm(off, cv2.NORM_L2SQR)
    np.copyto(error, 0, where=far)  # what is left are the errors within 4 px
    swing = (float(np.einsum("i,i->", error, wave)) / 16 for wave in (cosine, sine))
    near = cv2.sumElems(error)[0] / 16, cv2.norm(error, cv2.NORM_L2SQR) / 256
    return (*counts, len(steps) - counts[-1], absolute / 16, square / 256, *near, *swing)


def seen_by_both(truth_px: Floats) -> Bools:
    """Find the pixels that the right camera sees too: carried into its view, no nearer surface covers them.

    Parameters
    ----------
    truth_px : (H, W) float, px
        True disparity, NaN where unknown.

    Returns
    -------
    (H, W) bool

    Examples
    --------
    >>> seen_by_both(np.array([[0.0, 0.0, 0.0, 2.0]]))
    array([[ True, False,  True,  True]])
    """
    rows, columns = np.nonzero(np.isfinite(truth_px))
    disparity = truth_px[rows, columns]
    target = np.rint(columns - disparity).astype(int)
    inside = (target >= 0) & (target < truth_px.shape[1])
    nearest = np.full(truth_px.shape, -np.inf)
    np.maximum.at(nearest, (rows[inside], target[inside]), disparity[inside])
    visible = np.zeros(truth_px.shape, bool)
    visible[rows[inside], columns[inside]] = disparity[inside] > nearest[rows[inside], target[inside]] - 1
    return visible


def motorcycle_view() -> KnownView:
    """Load the Middlebury 2014 motorcycle at quarter size: photographs with measured truth, in every install.

    Returns
    -------
    KnownView
        ``visible`` are the pixels whose truth, carried into the right view, is not covered by a nearer surface.

    References
    ----------
    D. Scharstein et al., High-resolution stereo datasets with subpixel-accurate ground truth,
    doi:10.1007/978-3-319-11752-2_3
    """
    from skimage.data import stereo_motorcycle

    load: Any = stereo_motorcycle
    left, right, truth = load()
    truth = np.where(np.isfinite(truth), truth, np.nan).astype(np.float64)
    left, right = (np.ascontiguousarray(image[..., ::-1]) for image in (left, right))
    return KnownView("motorcycle", left, right, truth, seen_by_both(truth))
