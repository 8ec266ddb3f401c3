"""Which lens model? Fit on some pairs, look at others: coefficients that help only the fitted ones are too many."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stereolib.calibration import bundle_adjustment
from stereolib.calibration.boards import BoardViews
from stereolib.calibration.solve import LENS_MODELS, calibrate_stereo
from stereolib.rig import Camera, StereoRig

Array = np.ndarray
Split = tuple[Array, Array]
_BETTER = 0.02  # a longer lens must lower the hold-out error by so much to be worth its coefficients
_USUAL = "brown3"
_FEW_STEPS = 6  # enough for coefficients that the boards hold; the others would creep on and gain nothing


@dataclass(frozen=True)
class HoldOut:
    """One lens model: rms on the pairs fitted and on the pairs left out, px, over all splits."""

    model: str
    coefficients: int
    train_rms_px: float
    hold_out_rms_px: float


def folds(pairs: int, count: int = 5, *, few: bool = False) -> list[Split]:
    """Splits of ``pairs`` into (fitted, left out): every count-th pair is left out in turn.

    Parameters
    ----------
    few : bool
        The other way round: fit on every count-th pair, look at all others.
    """
    if not 2 <= count <= pairs // (3 if few else 1):
        raise ValueError(f"{pairs} pairs cannot be split into {count} parts of {'at least three' if few else 'one'}")
    everyone = np.arange(pairs)
    parts = [(everyone[everyone % count != k], everyone[k::count]) for k in range(count)]
    return [(out, rest) for rest, out in parts] if few else parts


def hold_out(
    views: BoardViews, models: Sequence[str] = tuple(LENS_MODELS), splits: Sequence[Split] | None = None
) -> list[HoldOut]:
    """Train and hold-out error of lens models, both views of a pair always on the same side.

    Parameters
    ----------
    models : names of `LENS_MODELS`
        From short to long, each one's fit being the next one's start.
    splits : from `folds`
        Five folds if not given.

    Notes
    -----
    A pair left out is posed anew, six numbers, and the rig stays.
    """
    splits = folds(len(views), min(5, len(views) // 2)) if splits is None else splits
    squares: dict[str, Array] = {model: np.zeros(4) for model in models}
    for train, test in splits:
        rig: StereoRig | None = None
        known, unknown = views.only(train.tolist()), views.only(test.tolist())
        for model in models:
            longer = None if rig is None else padded(rig, LENS_MODELS[model][0])
            fitted = bundle_adjustment.fit(known, longer) if longer else calibrate_stereo(known, model=model).fit
            rig = fitted.rig
            held = bundle_adjustment.fit(unknown, rig, free=False)
            sums = [((f.residuals_px**2).sum(), f.seen.sum()) for f in (fitted, held)]
            squares[model] += np.array(sums).ravel()
    return [
        HoldOut(model, LENS_MODELS[model][0], float(np.sqrt(a / m)), float(np.sqrt(b / n)))
        for model, (a, m, b, n) in squares.items()
    ]


def left_out_rms_px(fitted: bundle_adjustment.Fit) -> float:
    """Rms of every pair before the rig of all other pairs, px: `hold_out` with as many splits as pairs.

    Notes
    -----
    Without a refit: pair k's sum of squares after a step d of the shared parameters, its board posed anew, is
    ``c_k - 2 g_k'd + d'N_k d`` to first order, and ``d = -(N - N_k)^-1 g_k`` leaves it out (`bundle.Fit.without_each`).
    """
    steps, own = fitted.without_each(), (fitted.residuals_px**2).sum(axis=(1, 2, 3))
    more = np.einsum("ks,kst,kt->k", steps, fitted.normal, steps) - 2 * (fitted.gradient * steps).sum(axis=1)
    return float(np.sqrt((own + more).sum() / fitted.seen.sum()))


def neighbours(views: BoardViews, fitted: bundle_adjustment.Fit, model: str) -> list[HoldOut]:
    """`left_out_rms_px` of a lens model and of its neighbours: cheap enough to be asked of every calibration.

    The neighbours are the next longer one, all up to ``brown3`` if that is not enough, and for models beyond it
    ``brown3`` and those between.
    """
    names = list(LENS_MODELS)
    usual, at = names.index(_USUAL), names.index(model)
    rig = fitted.rig if at <= usual else calibrate_stereo(views, model=_USUAL).rig
    results = []
    for name in names[min(at, usual) : max(at + 1, usual) + 1]:
        longer = bundle_adjustment.fit(views, padded(rig, LENS_MODELS[name][0]), iterations=_FEW_STEPS)
        rig = longer.rig
        results.append(HoldOut(name, LENS_MODELS[name][0], longer.rms_px, left_out_rms_px(longer)))
    return results


def choose(results: Sequence[HoldOut]) -> str:
    """The shortest model whose hold-out error is within 2 % of the lowest."""
    limit = (1 + _BETTER) * min(r.hold_out_rms_px for r in results)
    return min((r for r in results if r.hold_out_rms_px <= limit), key=lambda r: r.coefficients).model


def padded(rig: StereoRig, coefficients: int) -> StereoRig:
    """The same rig with a longer lens, whose new coefficients are zero."""
    if rig.left.dist.size > coefficients:
        raise ValueError(f"a lens of {rig.left.dist.size} coefficients cannot be shortened to {coefficients}")
    more = (0, coefficients - rig.left.dist.size)
    left, right = (Camera(c.K, np.pad(c.dist, more), c.size) for c in (rig.left, rig.right))
    return StereoRig(left, right, rig.R, rig.T)
