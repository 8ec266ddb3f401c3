"""The command ``stereolib disparity``: from a pair of pictures to a disparity map."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from stereolib.base import Float32
from stereolib.cli.boards import add_pair
from stereolib.cli.command import Command
from stereolib.cli.errors import DONE, named
from stereolib.cli.outputs import check_ending, check_outputs

_OUT = """(H, W) float32, px, NaN invalid; a picture goes beside it, and from `best` NPY_std.npy, the standard deviation
in px as measured on virtual scenes"""
_AUTO = "auto"
_BEYOND = 0.005  # share of the roughly matched pixels that may lie beyond the range before it is told
_OPTIONS = {
    "looks for a multiple of 16 disparities, got": "needs a --max-disparity that is a multiple of 16, got",
    "looks for a multiple of 32 disparities, got": "needs a --max-disparity that is a multiple of 32, got",
    "reduce num_disparities, min_disparity or block_size": "reduce --max-disparity",
    "reduce num_disparities": "reduce --max-disparity",
}
_RECTIFY = "Rectify it with its calibration (RectifiedRig.rectify)"


def _configure(parser: argparse.ArgumentParser) -> None:
    add_pair(parser)
    parser.add_argument("--calibration", type=Path, metavar="FILE", help="calibration.json; default: a rectified pair")
    parser.add_argument("--pipeline", default="best", metavar="NAME", help="paper, fast or best (default: best)")
    about = "px, a multiple of 16, of 32 for fast; auto takes what a rough match of the pair tells (auto)"
    parser.add_argument("--max-disparity", type=_count, default=_AUTO, metavar="N", help=about)
    parser.add_argument("--output", type=Path, default=Path("disparity.npy"), metavar="NPY", help=_OUT)
    parser.add_argument("--force", action="store_true", help="replace the files if they are there")


def _count(word: str) -> int | None:
    """What --max-disparity says; None for auto."""
    try:
        return None if word == _AUTO else int(word)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{word!r} is neither a whole number of pixels nor {_AUTO}") from None


def _run(arguments: argparse.Namespace) -> int:
    import io

    import cv2
    import numpy as np

    from stereolib.base import write_atomic
    from stereolib.matching import check_matchable, check_rectified, find_rows, stereo_pipeline
    from stereolib.plotting import color_disparity
    from stereolib.rig import StereoRig, find_pair, read_pair

    with _named_as_options():
        run = stereo_pipeline(arguments.pipeline, arguments.max_disparity)
    out, files = arguments.output, find_pair(arguments.left, arguments.right)
    check_ending(out, ".npy", "the map (--output)")
    picture, deviation = out.with_suffix(".png"), out.with_name(f"{out.stem}_std.npy")
    written = [out, picture, *([deviation] if arguments.pipeline == "best" else [])]
    check_outputs(written, force=arguments.force, option="--output")
    pair = read_pair(*files)
    check_matchable(*pair, (str(files[0]), str(files[1])))
    if arguments.calibration:
        with named(arguments.calibration):
            rectified = StereoRig.load(arguments.calibration).rectify()
        with named(*files):
            pair = rectified.rectify(*pair)
    with named(*files), _named_as_options(arguments.calibration):
        unsure = np.isnan(check_rectified(*pair))
        estimate = run(*pair)
    if unsure:
        print("note: too few points of the two pictures could be matched to tell whether the pair is rectified")
    rows, rough = find_rows(*pair)
    if rows.warning and arguments.pipeline == "best":
        print(f"warning: {rows.warning}")
    _warn_of_range(2 * rough[np.isfinite(rough)], arguments.max_disparity)
    valid = np.isfinite(estimate.disparity_px)
    if not valid.any():
        which = " and ".join(map(str, files))
        raise ValueError(f"{which}: no pixel was matched; check that they are a stereo pair, left one first")
    low, high = (float(limit) for limit in np.percentile(estimate.disparity_px[valid], (1, 99)))
    for path, array in ((out, estimate.disparity_px), (deviation, estimate.std_px)):
        if array is not None:
            stream = io.BytesIO()
            np.save(stream, array.astype(np.float32), allow_pickle=False)
            write_atomic(path, stream.getvalue())
    shown = color_disparity(estimate.disparity_px, low, max(high, low + 1))
    write_atomic(picture, cv2.imencode(".png", shown)[1].tobytes())
    kinds = {"matched": estimate.matched, "filled": valid & ~estimate.matched, "refused": ~valid}
    shares = ", ".join(f"{100 * mask.mean():.1f} % {kind}" for kind, mask in kinds.items())
    print(f"{out}: of the pixels {shares}; disparities {low:.1f} to {high:.1f} px")
    return DONE


def _warn_of_range(rough_px: Float32, count: int | None) -> None:
    """Say that a range that was asked for leaves out what is near, as a rough match saw it."""
    if count is None or not rough_px.size or (beyond := float((rough_px > count).mean())) < _BEYOND:
        return
    lost = f"{100 * beyond:.1f} % of the roughly matched pixels lie beyond --max-disparity {count}"
    print(f"warning: {lost}: what stands there is wrong; leave the option out or give more")


@contextmanager
def _named_as_options(calibration: Path | None = None) -> Iterator[None]:
    """What the library says of its own arguments, in the words of the command line."""
    remedy = f"Is {calibration} of these cameras, and as they stand now? Else calibrate them again"
    try:
        yield
    except ValueError as error:
        text = str(error).replace(_RECTIFY, remedy if calibration else "Rectify it with its rig: --calibration FILE")
        for said, option in _OPTIONS.items():
            text = text.replace(said, option)
        raise ValueError(text) from None


DISPARITY = Command(
    "disparity",
    "match a pair of pictures and write its disparity map",
    "stereolib disparity left.png right.png --pipeline best --max-disparity 96 --output d.npy",
    _run,
    _configure,
)
