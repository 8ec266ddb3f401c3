"""The command ``stereolib disparity``: from a pair of pictures to its disparity, and to its depth in millimetres."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from stereolib.cli.boards import add_pair, said_of
from stereolib.cli.command import Command
from stereolib.cli.errors import DONE, named
from stereolib.cli.outputs import check_ending, check_outputs, default_name
from stereolib.cli.ranges import whole
from stereolib.cli.told import say_on_a_terminal, wrapped

if TYPE_CHECKING:
    from stereolib.base import UInt8
    from stereolib.matching import DisparityEstimate
    from stereolib.measurement import DepthMap

_AUTO = "auto"
_WIDEST_PX = 2**15  # no picture is wider
_BY_CHANCE, _HARDLY = 0.05, 0.1  # shares of matched pixels: pictures of two scenes have 1 to 4 %, in poor light 14
_ONE_SCENE = "are both pictures of one scene and one moment?"
_AT_ONE_PLACE_PX = 0.5  # where no disparity is larger, both pictures show all at one place
_ONE_CAMERA = (
    f"hardly a disparity is over {_AT_ONE_PLACE_PX} px: both pictures show everything at the same place, as those of "
    "one camera, opened under two numbers, do; else all of it is too far away to be measured"
)
_OPTIONS = {
    "looks for a multiple of 16 disparities, got": "needs a --max-disparity that is a multiple of 16, got",
    "looks for a multiple of 32 disparities, got": "needs a --max-disparity that is a multiple of 32, got",
    "reduce num_disparities, min_disparity or block_size": "reduce --max-disparity",
    "reduce num_disparities": "reduce --max-disparity",
    "num_disparities": "--max-disparity",
    "leave it out": "leave the option out",
}
_RECTIFY = "Rectify it with its calibration (RectifiedRig.rectify)"
_BEST = "best"
#: What is written, by the end of its name: always, with a calibration, and what it is.
_FILES = (
    (".npy", False, "disparity, (H, W) float32, px, guesses where filled; NaN is invalid, as in all .npy files here"),
    (".png", False, "to look at: the left picture and its depth, or disparity without --calibration, guesses hatched"),
    ("_std.npy", False, "from best: standard deviation of the disparity, px, as measured on virtual scenes"),
    ("_depth_mm.npy", True, "depth along the rectified left camera's axis, (H, W) float32, mm"),
    (
        "_depth_mm.png",
        True,
        "the same in whole mm, 16 bits (viewers show it black), 0 is invalid or beyond 65,535 mm (ROS REP 118)",
    ),
    ("_depth_std_mm.npy", True, "from best: its standard deviation, mm: the matcher's, and the calibration's"),
    (".ply", True, "coloured points in the rectified left camera's frame: x right, y down, z forward, m"),
)
_NOTES = """\
Of the pixels, "matched" were found in both pictures, "filled" got a guess from their neighbours, and of "refused" ones
nothing is told: patches of which a second, rough matching knows nothing are refused, too. Depths are those of matched
pixels, unless --filled is given. The points leave out what is known to 10 % of its depth only, or worse (with best,
which tells).

With --calibration all of them are of the rectified left picture, whose pixels are not those of LEFT: `stereolib measure
--between` takes them with --rectified.

written, for --output d.npy; those of depth with --calibration only:
""" + "\n".join(f"  d{end:18} {what}" for end, _, what in _FILES)


def _configure(parser: argparse.ArgumentParser) -> None:
    add_pair(parser)
    about = "calibration.json, for pictures as they come and for mm; default: a rectified pair"
    parser.add_argument("--calibration", type=Path, metavar="FILE", help=about)
    parser.add_argument("--pipeline", default=_BEST, metavar="NAME", help="paper, fast or best (default: best)")
    about = "px, a multiple of 16, of 32 for fast; auto takes what a rough match of the pair tells (auto)"
    parser.add_argument("--max-disparity", type=_count, default=_AUTO, metavar="N", help=about)
    parser.add_argument("--filled", action="store_true", help="depth where it was filled by a guess, too")
    parser.add_argument("--output", type=Path, metavar="NPY", help="as below (default: disparity.npy, numbered)")
    parser.add_argument("--force", action="store_true", help="replace the files if they are there")


def _count(word: str) -> int | None:
    """What --max-disparity says; None for auto."""
    if word == _AUTO:
        return None
    try:
        return whole(1, _WIDEST_PX)(word)
    except argparse.ArgumentTypeError as error:
        raise argparse.ArgumentTypeError(f"{error} pixels, nor {_AUTO}") from None


def _run(arguments: argparse.Namespace) -> int:
    import numpy as np

    from stereolib.matching import check_matchable, match_checked, stereo_pipeline
    from stereolib.measurement import Instrument, measure_depth
    from stereolib.rig import find_pair, read_pair

    how = arguments.pipeline, arguments.max_disparity
    with _named_as_options():
        stereo_pipeline(*how)  # before files are read
    if arguments.filled and not arguments.calibration:
        raise ValueError("--filled is about depth, which needs --calibration FILE")
    files, all_ends = find_pair(arguments.left, arguments.right), [end for end, *_ in _FILES]
    out = arguments.output or default_name(Path("disparity.npy"), force=arguments.force, ends=all_ends)
    check_ending(out, ".npy", "the map (--output)")
    ends = [end for end, metric, _ in _FILES if arguments.calibration or not metric]
    paths = {end: out.with_name(out.stem + end) for end in ends if how[0] == _BEST or "std" not in end}
    check_outputs(paths.values(), force=arguments.force, option="--output")
    instrument = Instrument.load(arguments.calibration) if arguments.calibration else None
    pair = read_pair(*files)
    check_matchable(*pair, (str(files[0]), str(files[1])))
    say_on_a_terminal(f"matching {files[0].name} and {files[1].name}, in some seconds ...")
    with named(*files), _named_as_options(arguments.calibration):
        depth = None if instrument is None else measure_depth(*pair, instrument, *how, filled=arguments.filled)
        match = depth.match if depth else match_checked(*pair, *how)
        if (matched := match.shares["matched"]) < _BY_CHANCE:
            raise ValueError(f"{100 * matched:.1f} % match, as chance has it: {_ONE_SCENE}")
    said = [*said_of(arguments.calibration), *depth.instrument.warnings] if depth else []
    if matched < _HARDLY:
        said.append(f"hardly anything matches: {_ONE_SCENE} What was filled is a guess")
    low, high = np.nanpercentile(match.estimate.disparity_px, (1, 99))
    if max(abs(low), abs(high)) < _AT_ONE_PLACE_PX:
        said.append(_ONE_CAMERA)
    for text in (*said, *map(_as_options, match.notes)):
        print(f"warning: {text}")
    _write_arrays(paths, match.estimate, depth)
    _draw(paths[".png"], depth.left if depth else pair[0], match.estimate, depth)
    shares = ", ".join(f"{100 * share:.1f} % {kind}" for kind, share in match.shares.items())
    print(f"{out}: of the pixels {shares}; 98 % of the disparities lie between {low:z.1f} and {high:z.1f} px")
    print(_told(depth) if depth else "no --calibration, so that nothing is told in millimetres")
    wide, what = max(len(str(path)) for path in paths.values()), {end: text for end, _, text in _FILES}
    print(wrapped(["written:", *(f"  {path!s:{wide}}  {what[end]}" for end, path in paths.items())]))
    return DONE


def _told(depth: DepthMap) -> str:
    """Depths in millimetres, and what they were computed with."""
    import numpy as np

    rectified, known = depth.instrument.rectified, depth.depth_mm[np.isfinite(depth.depth_mm)]
    low, middle, high = np.percentile(known, (1, 50, 99))
    std = (
        "" if depth.std_mm is None else f", the median of their standard deviations {np.nanmedian(depth.std_mm):.1f} mm"
    )
    which = "matched and filled" if depth.is_filled else "matched"
    return (
        f"depth = f B / disparity, f {rectified.f_px:.1f} px, B {rectified.baseline_mm:.2f} mm; 98 % of the {which} "
        f"pixels between {low:.0f} and {high:.0f} mm, median {middle:.0f} mm{std}"
    )


def _write_arrays(paths: dict[str, Path], found: DisparityEstimate, depth: DepthMap | None) -> None:
    import io

    import cv2
    import numpy as np

    from stereolib.base import write_atomic
    from stereolib.mapping import Cloud, write_cloud
    from stereolib.measurement import whole_mm

    arrays = {".npy": found.disparity_px, "_std.npy": found.std_px}
    arrays |= {"_depth_mm.npy": depth.depth_mm, "_depth_std_mm.npy": depth.std_mm} if depth else {}
    for end, array in arrays.items():
        if array is not None:
            stream = io.BytesIO()
            np.save(stream, array.astype(np.float32), allow_pickle=False)
            write_atomic(paths[end], stream.getvalue())
    if depth:
        write_atomic(paths["_depth_mm.png"], cv2.imencode(".png", whole_mm(depth.depth_mm))[1].tobytes())
        write_cloud(paths[".ply"], Cloud(*depth.points()), overwrite=True)


def _draw(path: Path, left: UInt8, found: DisparityEstimate, depth: DepthMap | None) -> None:
    """The left picture, and beside it the map, its guesses hatched."""
    import numpy as np

    from stereolib.base import write_atomic
    from stereolib.plotting import hatch, panels, plot_depth, plot_disparity, plot_image, show_figure

    guessed = np.isfinite(found.disparity_px) & ~found.matched
    guess = "a guess" if depth is None or depth.is_filled else "a guess, no depth is told"
    hatched = f"; hatched: {guess}" if guessed.any() else ""
    values, draw = (depth.depth_mm, plot_depth) if depth else (found.disparity_px, plot_disparity)
    low, high = (float(limit) for limit in np.nanpercentile(values, (1, 99)))
    figure, ax = panels(2, width_in=13.0)
    plot_image(left, ax[0], "the left picture, rectified" if depth else "the left picture")
    draw(values, ax[1], ("depth" if depth else "disparity") + hatched, low=low, high=max(high, low + 1))
    hatch(guessed, guessed.shape[::-1], ax[1])
    of_what = " of the rectified left picture: for measure --between, with --rectified" if depth else ""
    ax[0].set(xlabel=f"column (px){of_what}", ylabel="row (px)")
    write_atomic(path, show_figure(None, figure).data)


@contextmanager
def _named_as_options(calibration: Path | None = None) -> Iterator[None]:
    """What the library says of its own arguments, in the words of the command line."""
    remedy = f"Is {calibration} of these cameras, and as they stand now? Else calibrate them again"
    try:
        yield
    except ValueError as error:
        advice = remedy if calibration else "Rectify it with its rig: --calibration FILE"
        raise ValueError(_as_options(str(error).replace(_RECTIFY, advice))) from None


def _as_options(text: str) -> str:
    for said, option in _OPTIONS.items():
        text = text.replace(said, option)
    return text


DISPARITY = Command(
    "disparity",
    "match a pair of pictures: its disparity and, with a calibration, its depth in mm and its points",
    "stereolib disparity left.png right.png --calibration rig/calibration.json --output d.npy",
    _run,
    _configure,
    notes=_NOTES,
)
