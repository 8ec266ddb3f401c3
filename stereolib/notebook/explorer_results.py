"""The line of results above the bench's pictures: what each method reads, or why it reads nothing."""

from __future__ import annotations

import re
from html import escape

import numpy as np
from jinja2 import Environment, PackageLoader

from stereolib import paper
from stereolib.measurement import FLOOR_BY_HAND, OBJECT_RGB, SIZE_NAMES, MeasuredObject, Measurement, Source
from stereolib.notebook import chain
from stereolib.notebook.knobs import BEST, MOTORCYCLE, OWN, State, knobs
from stereolib.paper import HeightResult
from stereolib.plotting import LASER, OURS, PAPER, REFUSED, TRUTH, color_disparity

_INTERVAL = 1.96
_NOT_CALIBRATED = "the laser's pose is not known"  # on the bench it never is
_UNKNOWN_RIG = "needs a calibration"
_MOST = 3  # objects that are told
_BEYOND_PCT = 2.0  # of the pixels: so many nearer than the search are told
_NEAREST = 0.999  # quantile of the disparities that a search should hold
_OWN_MATCHING = (
    '"Ground plane" and "{which}" are measured from the pictures by a matching of their own: the knobs of matcher '
    "and filter concern the recipe, the map and the pictures below."
)
_WRONG_BASELINE = (
    "no pair can tell a wrong baseline: here it changes every length by {pct:+g} %, and no interval holds it; a laser "
    "whose place is known tells it"
)
_MEASURED = "#{:02x}{:02x}{:02x}".format(*OBJECT_RGB[0])
_TEMPLATES = Environment(loader=PackageLoader("stereolib.notebook"), autoescape=True)


def legend() -> str:
    """Tell what is drawn in which colour, and what the words of the page mean.

    Returns
    -------
    str
        HTML.

    Examples
    --------
    >>> "laser's readings" in legend()
    True
    """
    grey = "#{:02x}{:02x}{:02x}".format(*color_disparity(np.full((1, 1), np.nan), 0, 1)[0, 0])
    colors = {"grey": grey, "recipe": PAPER, "measured": _MEASURED, "laser": LASER, "truth": TRUTH}
    cm_per_px = paper.printed_value("scale.cm_per_px")
    return _TEMPLATES.get_template("legend.html.jinja").render(colors, cm_per_px=cm_per_px)


def result_line(state: State) -> str:
    """What each method reads, beside each other, in HTML.

    Parameters
    ----------
    state : State
        Of half size, the methods that need the full pictures show dots.

    Returns
    -------
    str
    """
    truth = chain.true_scene(state)
    truth_text = "its disparities alone" if chain.known(state) else "unknown"
    if truth:
        sizes = [" x ".join(f"{mm / 10:.1f}" for mm in box.size_mm) for box in truth.boxes[1:]]
        truth_text = f"{'' if len(sizes) == 1 else f'{len(sizes)} boxes: '}{', '.join(sizes)} cm"
    laser = chain.scan(state) is not None
    which = "laser and pair" if laser else "pair alone"
    cells = [
        ("truth", TRUTH, [truth_text]),
        ("ground plane", OURS, ["…" if state.half else _plane_text(state)]),
        ("the paper's recipe", PAPER, _recipe_texts(state)),
        ("map on the box" if truth else "map", REFUSED, _quality_texts(state)),
        (which, _MEASURED, ["…" if state.half else _fused_text(state)]),
    ]
    parts = "".join(
        f'<div><b style="color:{color}">{name}</b>{"<br>".join(map(escape, texts))}</div>'
        for name, color, texts in cells
    )
    warned = "".join(f'<p class="stereolib-warnings">{escape(text)}</p>' for text in _warnings(state))
    if chain.rectified_rig(state) is not None:
        warned = f'<p class="stereolib-note">{_OWN_MATCHING.format(which=which)}</p>{warned}'
    return f'<div class="stereolib-result">{parts}</div>{warned}'


def _recipe_texts(state: State) -> list[str]:
    """What the recipe reads, and what it counted, a text a line."""
    read, scale = chain.recipe(state), 2 if state.half else 1
    if not isinstance(read, HeightResult):
        return [f"nothing: {read}"]
    greatest = f"the map's greatest disparity, {scale * read.threshold_px + state.tolerance_px:.1f} px"
    within = f"at most {state.tolerance_px:g} px below {greatest}" if state.tolerance_px else f"of {greatest}"
    truth, counted = chain.known(state), np.where(read.mask, chain.filtered(state), -np.inf)
    true_px = scale * truth.disparity_px.flat[counted.argmax()] if truth else np.nan
    told = f" (true there: {true_px:.1f})" if np.isfinite(true_px) else ""
    texts = [f"{read.height_mm / 10:.1f} cm high", f"counts {scale**2 * read.mask.sum()} pixels, {within}{told}"]
    if state.source in (OWN, MOTORCYCLE):
        texts.append(f"by {paper.printed_value('scale.cm_per_px')} cm a pixel, which is the paper's set-up's alone")
    return texts


def _warnings(state: State) -> list[str]:
    """What the measurement says of the rig, without what the bench knows itself, and what takes long."""
    if state.half and state.matcher == BEST:
        return [f'half size for now: the matcher "{BEST}" is at the full one …']
    if state.half:
        return []
    told = [_search_warning(state), _rows_warning(state)]
    if state.baseline_pct and chain.rectified_rig(state) is not None:
        told.append(_WRONG_BASELINE.format(pct=state.baseline_pct))
    if isinstance(measured := chain.measured(state), Measurement):
        attempt = chain.ground_plane(state)
        known = f": {attempt.why}" if attempt and attempt.why else ""  # it stands above already
        told += [text.replace(known, "") for text in measured.warnings if not text.startswith(_NOT_CALIBRATED)]
        told.append(_laser_adds(state, measured))
    return list(filter(None, told))


def _search_warning(state: State) -> str:
    """That much is nearer than what the matcher searches; empty where it is not."""
    _, rough_px = chain.rows(state)
    found, last = 2 * rough_px[np.isfinite(rough_px)], state.min_disparity + state.num_disparities - 1
    beyond_pct = 100 * float(np.mean(found > last)) if found.size else 0.0
    if beyond_pct < _BEYOND_PCT:
        return ""
    needed, choices = float(np.quantile(found, _NEAREST)) - state.min_disparity, knobs()["num_disparities"].choices
    enough = next((one for one in choices if isinstance(one, int) and one > needed + 1), choices[-1])
    return (
        f"{beyond_pct:.0f} % of what a rough matching finds is nearer than the {last} px at which the search ends, and "
        f"is matched wrongly or not at all: search {enough} disparities"
    )


def _rows_warning(state: State) -> str:
    """That the rows of an uncalibrated pair disagree; empty where they do not."""
    rows, _ = chain.rows(state)
    if state.source != OWN or chain.rectified_rig(state) is not None or not rows.warnings:
        return ""
    seen = " and ".join(re.split("[,:]", text)[0] for text in rows.warnings)
    return f"this pair is not rectified: {seen}, and no knob of the matcher mends that; add its calibration"


def _laser_adds(state: State, measured: Measurement) -> str:
    """What the laser changes in the nearest object; empty where there is no scan, or no size."""
    without = chain.without_laser(state)
    if chain.scan(state) is None or not (isinstance(without, Measurement) and measured.objects and without.objects):
        return ""
    both, alone = measured.objects[0], without.objects[0]
    known = [name for name, mm, before in zip(SIZE_NAMES, both.size_mm, alone.size_mm, strict=True)
             if np.isfinite(mm) and not np.isfinite(before)]  # fmt: skip
    if known:
        return f"the laser adds the nearest object's {' and '.join(known)}, which the pair alone does not know"
    change_mm, narrower = np.abs(both.size_mm - alone.size_mm), 1 - both.std_mm / alone.std_mm
    if not np.isfinite(change_mm).any():
        return ""
    return (
        f"the laser changes the nearest object's sizes by {np.nanmax(change_mm) / 10:.2f} cm at most, and makes their "
        f"intervals narrower by {max(0.0, 100 * float(np.nanmax(narrower))):.0f} % at most"
    )


def _plane_text(state: State) -> str:
    attempt = chain.ground_plane(state)
    if attempt is None:
        return _UNKNOWN_RIG
    if attempt.refused:
        why = _without_hint(attempt.why)
        return f"refused: {why}" if why.startswith(attempt.refused) else f"refused: {attempt.refused} ({why})"
    return f"{attempt.height_mm / 10:.2f} ± {_INTERVAL * attempt.std_mm / 10:.2f} cm high"


def _without_hint(text: str) -> str:
    """A reason without the remedy for which the page has no knob."""
    return text.replace(FLOOR_BY_HAND, "")


def _fused_text(state: State) -> str:
    measured, attempt = chain.measured(state), chain.ground_plane(state)
    if attempt is None:
        return _UNKNOWN_RIG
    if not isinstance(measured, Measurement):  # there is neither floor nor scan
        return f"refused, as the ground plane: {attempt.refused}"
    whole = [entry for entry in measured.objects if np.isfinite(entry.size_mm).any()]
    if not whole:
        reasons = dict.fromkeys(_reasons(entry) for entry in measured.objects[:_MOST])
        told = ["as the ground plane" if attempt.why and why == attempt.why else why for why in reasons]
        return f"no size: {'; '.join(told)}" if told else "nothing stands there"
    sizes = "; ".join(_sizes(entry) for entry in whole[:_MOST])
    return sizes.replace(attempt.why, "as the ground plane") if attempt.why else sizes


def _sizes(entry: MeasuredObject) -> str:
    parts = [
        f"{size / 10:.2f} ± {_INTERVAL * std / 10:.2f}" if np.isfinite(size) else "?"
        for size, std in zip(entry.size_mm, entry.std_mm, strict=True)
    ]
    ends = [name for name in ("right end", "left end") if entry.sources.get(name) is Source.SCAN]
    scanned = f"the laser alone sees its {' and '.join(ends)}" if ends and len(entry.sources) > len(ends) + 1 else ""
    told = "; ".join(filter(None, (_reasons(entry), scanned)))
    return " x ".join(parts) + " cm" + (f" ({told})" if told else "")


def _reasons(entry: MeasuredObject) -> str:
    """Why nothing of an object is known, or why sizes are missing, those together that share a reason."""
    whole, names = entry.reasons.get("object"), dict[str, list[str]]()
    if whole is not None and not whole.reason.leaves_the_pair:
        return str(whole)
    for name in SIZE_NAMES:
        if name in entry.reasons:
            names.setdefault(str(entry.reasons[name]), []).append(name)
    missing = [f"{' and '.join(of)}: {why}" for why, of in names.items()]
    return "; ".join([*missing, *([str(whole)] if whole else [])])


def _quality_texts(state: State) -> list[str]:
    """Share and errors of what was matched, a text a line; in full pixels also in half size."""
    quality, scale = chain.quality(state), 2 if state.half else 1
    everywhere = f"{100 * np.isfinite(chain.filtered(state)).mean():.1f} % of all pixels"
    if quality is None:
        return [f"{everywhere} matched"]
    bad = quality.bad1_pct if state.half else quality.bad2_pct  # a pixel of the half size is two
    return [
        f"{bad:.1f} % wrong or empty",
        f"{quality.density_pct:.1f} % matched ({everywhere})",
        f"mean error {scale * quality.bias_px:+z.2f} px, scatter {scale * quality.scatter_px:.2f} px"
        if np.isfinite(quality.bias_px)
        else "no mean error: none is within 4 px of the truth",
    ]
