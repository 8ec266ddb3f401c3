"""What the bench offers: sources to look at, own files that can be used, and which knobs turn nothing."""

from __future__ import annotations

from pathlib import Path

from stereolib.mapping import read_scan
from stereolib.matching import check_matchable
from stereolib.measurement import Instrument
from stereolib.notebook.chain import OF_SCENE, OF_SGBM
from stereolib.notebook.knobs import DILATION, FILTERS, MATCHERS, MOTORCYCLE, OWN, VIRTUAL, WINDOWS, State
from stereolib.rig import read_pair
from stereolib.virtual import recordings

#: Name of the environment variable in which ``stereolib explore`` hands over an own pair, as JSON.
OWN_FILES = "STEREOLIB_EXPLORE"
_WITHOUT_KERNEL = (FILTERS[0], "background", "inpaint_biharmonic")


def check_own(files: tuple[str, ...]) -> None:
    """Check an own pair as the commands do.

    Parameters
    ----------
    files : (left, right, calibration, scan)
        Paths; the last two may be empty.

    Raises
    ------
    ValueError
        If a file cannot be used; the text names it.
    OSError
        If one cannot be read.
    """
    left, right, calibration, scan_file = files
    pictures, names = read_pair(left, right), (Path(left).name, Path(right).name)
    check_matchable(*pictures, names)
    if calibration:
        rectified = Instrument.load(calibration).rectified
        try:
            rectified.rectify(*pictures)
        except ValueError as error:
            raise ValueError(f"{' and '.join(names)} do not fit {Path(calibration).name}: {error}") from error
    if scan_file:
        read_scan(Path(scan_file))


def sources(state: State) -> tuple[str, ...]:
    """What the bench can look at, by name.

    Parameters
    ----------
    state : State
        Knows whether there is an own pair.

    Returns
    -------
    tuple of str
    """
    return (VIRTUAL, *((OWN,) if state.own else ()), *recordings.pairs(), MOTORCYCLE)


def idle(state: State) -> frozenset[str]:
    """Knobs that change nothing in a state: those of the scene where a recording is shown, and the like.

    Parameters
    ----------
    state : State

    Returns
    -------
    frozenset of str
        Names of fields of `State`.

    Examples
    --------
    >>> sorted(idle(State(filter="dilation")) ^ idle(State()))
    ['kernel_px', 'kernel_shape']
    """
    scans = state.source in (VIRTUAL, *recordings.pairs()) or (state.source == OWN and bool(state.own[3]))
    is_emulated = scans and state.source != OWN and not state.source.startswith("room/")
    has_rig = state.source != MOTORCYCLE and (state.source != OWN or bool(state.own[2]))
    is_guided = state.laser and scans and state.source != OWN
    narrows = is_guided and state.window != WINDOWS[0]
    turned = {
        OF_SCENE: state.source == VIRTUAL,
        ("exposure_ev",): state.source not in (OWN, MOTORCYCLE),
        ("roll_deg", "row_px", "baseline_pct"): has_rig,
        ("laser",): scans,
        ("turns", "laser_noise", "laser_yaw_deg", "laser_ahead_mm"): state.laser and is_emulated,
        ("window",): is_guided,
        ("matcher",): not narrows,
        OF_SGBM: narrows or state.matcher == MATCHERS[0] or state.filter == "left_right",
        ("kernel_px",): state.filter not in _WITHOUT_KERNEL,
        ("kernel_shape",): state.filter == DILATION,
    }
    return frozenset(name for names, turns_something in turned.items() if not turns_something for name in names)
