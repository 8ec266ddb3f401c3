"""The line of results above the bench's pictures: what each method reads, or why it reads nothing."""

from __future__ import annotations

from html import escape

import numpy as np
from jinja2 import Environment, PackageLoader

from stereolib import paper
from stereolib.measurement import FLOOR_BY_HAND, OBJECT_RGB, SIZE_NAMES, MeasuredObject, Measurement
from stereolib.notebook import chain
from stereolib.notebook.knobs import BEST, State
from stereolib.paper import HeightResult
from stereolib.plotting import LASER, OURS, PAPER, REFUSED, TRUTH

_INTERVAL = 1.96
_NOT_CALIBRATED = "the laser's pose is not known"  # on the bench it never is
_UNKNOWN_RIG = "needs a calibration"
_MOST = 3  # objects that are told
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
    colors = {"recipe": PAPER, "measured": _MEASURED, "laser": LASER, "truth": TRUTH}
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
    truth, read = chain.true_scene(state), chain.recipe(state)
    true_mm = truth.boxes[1].size_mm if truth and len(truth.boxes) == 2 else None
    recipe = [f"nothing: {read}"]
    if isinstance(read, HeightResult):
        scale = 2 if state.half else 1
        least, most = scale * read.threshold_px, scale * read.threshold_px + state.tolerance_px
        range_px = f"{least:.1f} to {most:.1f} px" if state.tolerance_px else f"{most:.1f} px"
        counted = f"{scale**2 * read.mask.sum()} pixels of {range_px}"
        recipe = [f"{read.height_mm / 10:.1f} cm high", counted]
    truth_text = "its disparities alone" if chain.known(state) else "unknown"
    if truth:
        truth_text = f"{len(truth.boxes) - 1} boxes"
    if true_mm:
        truth_text = " x ".join(f"{mm / 10:.1f}" for mm in true_mm) + " cm"
    laser = chain.scan(state) is not None
    cells = [
        ("truth", TRUTH, [truth_text]),
        ("ground plane", OURS, ["…" if state.half else _plane_text(state)]),
        ("the paper's recipe", PAPER, recipe),
        ("map on the box" if truth else "map", REFUSED, _quality_texts(state)),
        ("laser and pair" if laser else "pair alone", _MEASURED, ["…" if state.half else _fused_text(state)]),
    ]
    parts = "".join(
        f'<div><b style="color:{color}">{name}</b>{"<br>".join(map(escape, texts))}</div>'
        for name, color, texts in cells
    )
    warned = "".join(f'<p class="stereolib-warnings">{escape(text)}</p>' for text in _warnings(state))
    return f'<div class="stereolib-result">{parts}</div>{warned}'


def _warnings(state: State) -> list[str]:
    """What the measurement says of the rig, without what the bench knows itself, and what takes long."""
    if state.half and state.matcher == BEST:
        return [f'half size for now: the matcher "{BEST}" computes the full one for some seconds …']
    if state.half or not isinstance(measured := chain.measured(state), Measurement):
        return []
    attempt = chain.ground_plane(state)
    known = f": {attempt.why}" if attempt and attempt.why else ""  # it stands above already
    return [text.replace(known, "") for text in measured.warnings if not text.startswith(_NOT_CALIBRATED)]


def _plane_text(state: State) -> str:
    attempt = chain.ground_plane(state)
    if attempt is None:
        return _UNKNOWN_RIG
    if attempt.refused:
        return f"refused: {attempt.refused} ({_without_hint(attempt.why)})"
    return f"{attempt.height_mm / 10:.2f} ± {_INTERVAL * attempt.std_mm / 10:.2f} cm high"


def _without_hint(text: str) -> str:
    """A reason without the remedy for which the page has no knob."""
    return text.replace(FLOOR_BY_HAND, "")


def _fused_text(state: State) -> str:
    measured, attempt = chain.measured(state), chain.ground_plane(state)
    if attempt is None:
        return _UNKNOWN_RIG
    if not isinstance(measured, Measurement):  # there is neither floor nor scan
        return f"refused: {attempt.refused}"
    whole = [entry for entry in measured.objects if np.isfinite(entry.size_mm).any()]
    if not whole:
        reasons = [_reasons(entry) for entry in measured.objects[:_MOST]]
        return f"no size: {'; '.join(dict.fromkeys(reasons))}" if reasons else "nothing stands there"
    return "; ".join(_sizes(entry) for entry in whole[:_MOST])


def _sizes(entry: MeasuredObject) -> str:
    parts = [
        f"{size / 10:.2f} ± {_INTERVAL * std / 10:.2f}" if np.isfinite(size) else "?"
        for size, std in zip(entry.size_mm, entry.std_mm, strict=True)
    ]
    reasons = _reasons(entry)
    return " x ".join(parts) + " cm" + (f" ({reasons})" if reasons else "")


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
        f"mean error {scale * quality.bias_px:+z.2f} px, scatter {scale * quality.scatter_px:.2f} px",
    ]
