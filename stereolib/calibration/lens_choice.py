"""Which lens model? Fit on some pairs, look at others: coefficients that help only the fitted ones are too many."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from stereolib.base import Float64, Ints
from stereolib.calibration.board_size import triangulate
from stereolib.calibration.board_views import BoardViews
from stereolib.calibration.bundle_adjustment import RigFit, fit_rig, with_coefficients
from stereolib.calibration.lens_models import LENS_MODELS
from stereolib.calibration.solve import calibrate_stereo
from stereolib.calibration.uncertainty import ErrorMap
from stereolib.rig import StereoRig

Split = tuple[Ints, Ints]
_BETTER = 0.02  # a longer lens must lower the hold-out error by so much to be worth its coefficients
_USUAL = "brown3"  # Table I's, and what webcams need
_FOLDS = 5  # enough pairs to fit on, and each left out once
_FEW_STEPS = 6  # enough for coefficients that the boards hold; the others would creep on and gain nothing


@dataclass(frozen=True)
class HoldOut:
    """How well one lens model explains pairs that it was fitted to, and pairs left out.

    Attributes
    ----------
    model : str
        A name of `LENS_MODELS`.
    coefficients : int
    train_rms_px, hold_out_rms_px : float
        Over all splits.
    """

    model: str
    coefficients: int
    train_rms_px: float
    hold_out_rms_px: float


def hold_out_splits(pairs: int, count: int = _FOLDS, *, few: bool = False) -> list[Split]:
    """Split pairs into those to fit and those to leave out: every count-th pair is left out in turn.

    Parameters
    ----------
    pairs, count : int
    few : bool
        The other way round: fit on every count-th pair, look at all others.

    Returns
    -------
    list of (fitted, left out)
        Indices of the pairs, as arrays of int.

    Raises
    ------
    ValueError
        If numbers are not whole, or there are too few pairs for so many parts.

    Examples
    --------
    >>> [left_out.tolist() for _, left_out in hold_out_splits(5, 2)]
    [[0, 2, 4], [1, 3]]
    """
    if not all(isinstance(n, int | np.integer) for n in (pairs, count)):
        raise ValueError(f"pairs and parts are counted in whole numbers, got {pairs!r} and {count!r}")
    if not 2 <= count <= pairs // (3 if few else 1):
        raise ValueError(f"{pairs} pairs cannot be split into {count} parts of {'at least three' if few else 'one'}")
    everyone: Ints = np.arange(pairs)
    parts = [(everyone[everyone % count != k], everyone[k::count]) for k in range(count)]
    return [(out, rest) for rest, out in parts] if few else parts


def hold_out_errors(
    views: BoardViews, models: Sequence[str] = tuple(LENS_MODELS), splits: Sequence[Split] | None = None
) -> list[HoldOut]:
    """Compare lens models by how well they predict pairs that they were not fitted to.

    Both views of a pair are always on the same side of a split.

    Parameters
    ----------
    views : BoardViews
    models : sequence of str
        Names of `LENS_MODELS`, from short to long: each one's fit is the next one's start.
    splits : sequence of (fitted, left out), optional
        From `hold_out_splits`; five folds if not given.

    Returns
    -------
    list of HoldOut
        In the order of `models`.

    Notes
    -----
    A pair left out is posed anew, six numbers, and the rig stays.
    """
    splits = hold_out_splits(len(views), min(_FOLDS, len(views) // 2)) if splits is None else splits
    squares: dict[str, Float64] = {model: np.zeros(4) for model in models}
    for train, test in splits:
        rig: StereoRig | None = None
        known, unknown = views.only(train.tolist()), views.only(test.tolist())
        for model in models:
            longer = None if rig is None else lengthened(rig, LENS_MODELS[model][0])
            fitted = fit_rig(known, longer) if longer else calibrate_stereo(known, model=model).fit
            rig = fitted.rig
            held = fit_rig(unknown, rig, free=False)
            squares[model] += [sum_ for f in (fitted, held) for sum_ in ((f.residuals_px**2).sum(), f.known.sum())]
    rms = {model: (float(np.sqrt(a / m)), float(np.sqrt(b / n))) for model, (a, m, b, n) in squares.items()}
    return [HoldOut(model, LENS_MODELS[model][0], *errors) for model, errors in rms.items()]


def hold_out_rigs(views: BoardViews, *, fixed: bool = False) -> list[tuple[StereoRig, BoardViews]]:
    """Calibrate on some pairs and keep the others for a test: in five folds, so that every pair is left out once.

    Parameters
    ----------
    views : BoardViews
    fixed : bool
        As `calibrate_stereo`: hold the single lenses in the pair's step.

    Returns
    -------
    list of (StereoRig, BoardViews)
        Each rig with the pairs that it has not seen.
    """
    return [
        (calibrate_stereo(views.only(known.tolist()), model=_USUAL, fixed=fixed).rig, views.only(unknown.tolist()))
        for known, unknown in hold_out_splits(len(views), min(_FOLDS, len(views) // 2))
    ]


def left_out_rms_px(fitted: RigFit) -> float:
    """Predict every pair by the rig of all other pairs: `hold_out_errors` with as many splits as pairs.

    Parameters
    ----------
    fitted : RigFit

    Returns
    -------
    float, px
        Rms over all corners.

    Notes
    -----
    Without a refit: pair k's sum of squares after a step d of the shared parameters, its board posed anew, is
    ``c_k - 2 g_k'd + d'N_k d`` to first order, and ``d = -(N - N_k)^-1 g_k`` leaves it out (`RigFit.without_each`).
    """
    steps, own = fitted.without_each(), (fitted.residuals_px**2).sum(axis=(1, 2, 3))
    more = np.einsum("ks,kst,kt->k", steps, fitted.normal, steps) - 2 * (fitted.gradient * steps).sum(axis=1)
    return float(np.sqrt((own + more).sum() / fitted.known.sum()))


def neighbour_fits(views: BoardViews, fitted: RigFit, model: str) -> dict[str, RigFit]:
    """Fit the neighbours of a lens model, for `left_out_rms_px`: cheap enough for every calibration.

    The neighbours are the next longer one, all up to ``brown3`` if that is not enough, and for models beyond it
    ``brown3`` and those between.

    Parameters
    ----------
    views : BoardViews
    fitted : RigFit
        Of these views with this model.
    model : str
        A name of `LENS_MODELS`.

    Returns
    -------
    dict of str to RigFit
        By the names of the models, the shortest first.
    """
    names = list(LENS_MODELS)
    usual, at = names.index(_USUAL), names.index(model)
    rig = fitted.rig if at <= usual else calibrate_stereo(views, model=_USUAL).rig
    results = dict[str, RigFit]()
    for name in names[min(at, usual) : max(at + 1, usual) + 1]:
        results[name] = fit_rig(views, lengthened(rig, LENS_MODELS[name][0]), iterations=_FEW_STEPS)
        rig = results[name].rig
    return results


def left_out_errors(fits: Mapping[str, RigFit]) -> tuple[HoldOut, ...]:
    """Judge fits of one set with several lens models by `left_out_rms_px`.

    Parameters
    ----------
    fits : mapping of str to RigFit
        From `neighbour_fits`.

    Returns
    -------
    tuple of HoldOut
    """
    return tuple(HoldOut(name, LENS_MODELS[name][0], fit.rms_px, left_out_rms_px(fit)) for name, fit in fits.items())


def lens_errors_mm(rig: StereoRig, better: StereoRig, errors: ErrorMap) -> tuple[Float64, Float64]:
    """Compare what two rigs with different lenses measure from the same pixels.

    Parameters
    ----------
    rig, better : StereoRig
        The one that measures, and the one that is right.
    errors : ErrorMap
        Says where and at which depth, and how long a length is.

    Returns
    -------
    depth_mm, length_mm : (h, w) float64
        The other's minus the rig's; NaN where a lens has no direction.

    Notes
    -----
    Pixels of the one are triangulated by the other: the two lenses' coefficients may be far apart along a valley in
    which the lenses are alike, so that a derivative by them would mislead.
    """
    pixels = np.stack(np.meshgrid(errors.columns_px, errors.rows_px), -1).reshape(-1, 2)
    points, half = rig.left.rays(pixels, clamp=True) * errors.at_mm, np.array([errors.of_mm / 2, 0.0, 0.0])

    def moved(X: Float64) -> Float64:
        return triangulate(better, rig.left.project(X), rig.right.project(X @ rig.R.T + rig.T)) - X

    depth, length = moved(points)[:, 2], (moved(points + half) - moved(points - half))[:, 0]
    shape = len(errors.rows_px), len(errors.columns_px)
    return depth.reshape(shape), length.reshape(shape)


def choose_lens_model(results: Sequence[HoldOut]) -> str:
    """Choose the shortest model whose hold-out error is within 2 % of the lowest.

    Parameters
    ----------
    results : sequence of HoldOut
        From `hold_out_errors`.

    Returns
    -------
    str
        A name of `LENS_MODELS`.

    Examples
    --------
    >>> choose_lens_model([HoldOut("brown3", 5, 0.048, 0.0485), HoldOut("rational8", 8, 0.047, 0.048)])
    'brown3'
    """
    limit = (1 + _BETTER) * min(r.hold_out_rms_px for r in results)
    return min((r for r in results if r.hold_out_rms_px <= limit), key=lambda r: r.coefficients).model


def lengthened(rig: StereoRig, coefficients: int) -> StereoRig:
    """Give a rig a longer lens, whose new coefficients are zero.

    Parameters
    ----------
    rig : StereoRig
    coefficients : int

    Returns
    -------
    StereoRig

    Raises
    ------
    ValueError
        If the lens has more coefficients than that.
    """
    if rig.left.dist.size > coefficients:
        raise ValueError(f"a lens of {rig.left.dist.size} coefficients cannot be shortened to {coefficients}")
    return with_coefficients(rig, coefficients)
