"""Pairs with a known truth, made ready to be compared with many maps."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field, fields

import cv2
import numpy as np

from stereolib.matching.scoring import Score, beside_jumps, check_mask
from stereolib.matching.sgbm import SGBMParams
from stereolib.rig import check_pair, to_grey

Array = np.ndarray
FIELDS = tuple(f.name for f in fields(SGBMParams))
#: What is measured in each region: the fields of `Score`, and `metrics.fattening_px` (of the whole map).
METRICS = (*(f.name for f in fields(Score)), "fattening_px")


@dataclass(frozen=True, eq=False)
class View:
    """A rectified pair whose truth is known.

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
    left: Array
    right: Array
    truth_px: Array
    visible: Array | None = None
    regions: Mapping[str, Array] = field(default_factory=dict)
    about: Mapping[str, float | str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        check_pair(self.left, self.right, (f"{self.name}, left", f"{self.name}, right"))
        shape, truth = self.left.shape[:2], np.asarray(self.truth_px)
        if truth.shape != shape:
            raise ValueError(
                f"{self.name}: the images are {shape}, the truth is {truth.shape}: they must have one shape"
            )
        if not np.isfinite(truth).any() or np.isinf(truth).any():
            raise ValueError(f"{self.name}: the truth must be in px, NaN where unknown, and known somewhere; "
                             f"{np.isinf(truth).sum()} pixels are infinite, {np.isnan(truth).sum()} NaN")  # fmt: skip
        for name, mask in self.masks().items():
            check_mask(mask, shape, f"{self.name}: region {name!r}")
            if not (mask & np.isfinite(truth)).any():
                raise ValueError(f"{self.name}: region {name!r} holds no pixel whose truth is known")
        clash = set(self.about) & {"key", "view", "where", *FIELDS, *METRICS}
        if clash:
            raise ValueError(
                f"{self.name}: {', '.join(sorted(clash))} cannot be told in `about`: a column is called so"
            )

    def masks(self) -> dict[str, Array]:
        """The regions by name: all, visible, and the view's own."""
        everywhere = {"all": np.isfinite(self.truth_px)}
        return everywhere | ({} if self.visible is None else {"visible": self.visible}) | dict(self.regions)

    def digest(self) -> str:
        """Fingerprint of everything in it."""
        found = hashlib.blake2b(repr((self.name, sorted(self.about.items()))).encode(), digest_size=16)
        truth = np.asarray(self.truth_px, np.float64)
        for name, array in {"left": self.left, "right": self.right, "truth": truth, **self.masks()}.items():
            found.update(f"{name} {array.shape}".encode())
            found.update(np.ascontiguousarray(array).data)
        return found.hexdigest()


@dataclass(frozen=True, eq=False)
class Ready:
    """A view made ready for many comparisons: its pixels in one row, those of the same regions together."""

    left: Array
    right: Array
    order: Array  # index of every known pixel, class after class
    ends: Array  # where the classes end
    member: Array  # (regions, classes) bool
    truth: Array  # 1/16 px
    swing: tuple[Array, Array]
    beside: Array  # background beside jumps, and from which raw disparity on it is wrong
    border: Array

    @classmethod
    def of(cls, view: View) -> Ready:
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
        angle = 2 * np.pi * (truth % 1)
        visible = known if view.visible is None else view.visible
        where, border = beside_jumps(view.truth_px, visible)
        beside = np.flatnonzero(where).astype(np.int32)
        return cls(to_grey(view.left), to_grey(view.right), order, np.cumsum(counts), member, 16 * truth,
                   (np.cos(angle), np.sin(angle)), beside, (16 * border[where]).astype(np.float32))  # fmt: skip

    def measure(self, raw: Array, min_disparity: int) -> list[list[float]]:
        """`METRICS` of every region from OpenCV's 1/16 px: as `metrics.score` and `metrics.fattening_px`, in one go."""
        raw, least = raw.ravel(), 16 * min_disparity
        found, first = raw.take(self.order), (0, *self.ends[:-1])
        parts = [slice(a, b) for a, b in zip(first, self.ends, strict=True)]
        per_class = np.array([_sums(found[p], least, self.truth[p], *(w[p] for w in self.swing)) for p in parts])
        pixels = np.diff(self.ends, prepend=0)
        lost, o1, o2, o4, n, absolute, square, s, s2, a, b = per_class.T @ self.member.T
        all_of = pixels @ self.member.T
        returned, n = all_of - lost, n - lost  # a missing pixel was set to no error
        with np.errstate(invalid="ignore", divide="ignore"):
            shares = [100 * (count + lost) / all_of for count in (o1, o2, o4)] + [100 * returned / all_of]
            means = [s / n, np.sqrt(s2 / n), absolute / returned, np.sqrt(square / returned), 2 * np.hypot(a, b) / n]
        wide = float("nan")
        if self.beside.size:
            over = raw.take(self.beside) > np.maximum(self.border, least - 1)
            wide = 8 * np.count_nonzero(over) / self.beside.size
        return [[float(x) for x in one] + [wide] for one in np.transpose(shares + means)]


def _sums(raw: Array, least: int, truth: Array, cosine: Array, sine: Array) -> tuple[float, ...]:
    """What the measures of some pixels are made of, px; disparities come in 1/16 px.

    The sums are not made by BLAS, whose results depend on its number of threads.
    """
    missing = raw < least
    error = np.subtract(raw, truth, dtype=np.float32)
    np.copyto(error, 0, where=missing)
    off = np.abs(error)
    far = off > 64
    counts = [int(np.count_nonzero(x)) for x in (missing, off > 16, off > 32, far)]
    absolute, square = cv2.norm(off, cv2.NORM_L1), cv2.norm(off, cv2.NORM_L2SQR)
    np.copyto(error, 0, where=far)  # what is left are the errors within 4 px
    swing = (float(np.einsum("i,i->", error, wave)) / 16 for wave in (cosine, sine))
    return (*counts, len(raw) - counts[-1], absolute / 16, square / 256, cv2.sumElems(error)[0] / 16,
            cv2.norm(error, cv2.NORM_L2SQR) / 256, *swing)  # fmt: skip


def motorcycle() -> View:
    """The Middlebury 2014 motorcycle at quarter size: photographs with measured truth, in every install.

    ``visible`` are the pixels whose truth, carried into the right view, is not covered by something nearer.
    """
    from skimage.data import stereo_motorcycle

    left, right, truth = stereo_motorcycle()
    truth = np.where(np.isfinite(truth), truth, np.nan).astype(np.float64)
    rows, columns = np.nonzero(np.isfinite(truth))
    target = np.rint(columns - truth[rows, columns]).astype(int)
    inside = target >= 0
    nearest = np.full(truth.shape, -np.inf)
    np.maximum.at(nearest, (rows[inside], target[inside]), truth[rows[inside], columns[inside]])
    visible = np.zeros(truth.shape, bool)
    visible[rows[inside], columns[inside]] = truth[rows, columns][inside] > nearest[rows[inside], target[inside]] - 1
    left, right = (np.ascontiguousarray(image[..., ::-1]) for image in (left, right))
    return View("motorcycle", left, right, truth, visible)
