"""Recorded pairs as people have them: two folders, one with both sides, patterns, side-by-side pictures, videos."""

from __future__ import annotations

import difflib
import glob
import re
from collections.abc import Iterable, Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import NamedTuple

from stereolib.base import check_name, counted, listed
from stereolib.rig.images import image_orientation, image_size, read_image
from stereolib.rig.unpacked import VIDEOS, WIDE, unpack_halves, unpack_videos

_SIDES = {"left": 0, "l": 0, "cam0": 0, "right": 1, "r": 1, "cam1": 1}
_FOLDERS = (("left", "right"), ("l", "r"), ("cam0", "cam1"))
#: Ends of the names of pictures.
PICTURES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".webp")
_SCAN = ".bin"  # end of the name of a laser's recording
_LISTED, _GUESSES = 8, 2
_FEW = 3  # pictures that are named where more is said of them
_TURNS = {3: "turned by 180 degrees", 6: "turned by 90 degrees", 8: "turned by 270 degrees"}  # EXIF's, clockwise
_Key = tuple[tuple[bool, int, str], ...]
_WORDS = re.compile(r"[Cc]am[01](?!\d)|\d+|[A-Z]?[a-z]+|[A-Z]+|[^\W\d_]+")
_OTHER = {"left": "right", "l": "r", "cam0": "cam1", "right": "left", "r": "l", "cam1": "cam0"}


class PairFile(NamedTuple):
    """The two pictures of a pair."""

    left: Path
    right: Path


def find_pairs(
    left: str | PathLike[str], right: str | PathLike[str] | None = None, *, every: int | None = None, least: int = 1
) -> list[PairFile]:
    """Find the pairs of a recording and put them in the order of the numbers in their names.

    Parameters
    ----------
    left : path
        A folder with the left camera's pictures, a pattern (``"rig/*_l.png"``), a video or one picture. With no
        `right`: a folder, pattern, video or picture that holds both sides, as

        - names that tell the side: ``left01`` and ``right01``, ``L_3`` and ``R_3``, ``chessboard-L0`` and ``-R0``,
          ``3_L`` and ``3_R``, ``Im_L_1`` and ``Im_R_1``, ``cam0_1`` and ``cam1_1``;
        - folders ``left`` and ``right`` (or ``L`` and ``R``, ``cam0`` and ``cam1``);
        - pictures or frames that are at least 2.2 times as wide as high: both sides beside each other, the left one
          at the left.
    right : path, optional
        The same of the right camera. Names belong together if they agree but for the words of a side: ``03.png`` and
        ``3.png``, too. Where none occurs on both sides (time stamps) and there are equally many, they are paired in
        sorted order.
    every : int, optional
        Of a video: the sharpest of so many frames is taken; without it, at most 60 are, where its length is known.
    least : int
        Pairs that there must be.

    Returns
    -------
    list of PairFile
        Files. Halves and frames are written to a folder ``.stereolib_pairs`` beside their source, once.

    Raises
    ------
    ValueError
        If nothing is found, pictures have no partner, share a number, are too few, differ in size, or EXIF turns only
        some of a camera's. They are named, a lonely one with the two likeliest partners of those that have none
        either, else with the one that is missing.
    """
    if right is None:
        _check_not_alone(left, least)
        pairs = _both_sides(str(left), every)
    else:
        if Path(left).resolve() == Path(right).resolve():
            raise ValueError(f"{left} was given for both cameras: name it once if it holds both, else the right one's")
        if all(_is_video(side) for side in (left, right)):
            pairs = [PairFile(*files) for files in unpack_videos([Path(left), Path(right)], every)]
        else:
            sources = str(left), str(right)
            a, b = map(_by_key, _pictures(*sources), sources)
            pairs = _matched(a, b)
    if len(pairs) < least:
        raise ValueError(f"too few pairs, {len(pairs)} ({_names(pair.left for pair in pairs)}): {_needed(least)}")
    _check_sizes(pairs)
    _check_turns(pairs)
    return pairs


def _needed(least: int) -> str:
    return f"at least {least} with different tilts are needed, and 15 to 30 give a trustworthy rig"


def _check_not_alone(source: str | PathLike[str], least: int) -> None:
    """Where several pairs are wanted, refuse a single picture, or a folder of one, by what is wanted."""
    path = Path(source)
    there = [path] if path.is_file() else _without_scans(_there(path)) if path.is_dir() else []
    if least > 1 and len(there) == 1 and there[0].suffix.lower() in PICTURES and not _side_folders(path):
        raise ValueError(
            f"{there[0]} is a single picture, pairs of both cameras are wanted: {_needed(least)}. Give a folder of them"
        )


def _there(folder: Path) -> list[Path]:
    """Files of a folder that are not hidden."""
    return [path for path in sorted(folder.iterdir()) if path.is_file() and not path.name.startswith(".")]


def find_pair(left: str | PathLike[str], right: str | PathLike[str] | None = None) -> PairFile:
    """Find the one pair that is asked for.

    Parameters
    ----------
    left, right : path
        Two pictures, which belong together whatever their names; or what `find_pairs` takes, if it holds one pair.

    Returns
    -------
    PairFile
        Two pictures are not looked at: `read_pair` says what is wrong with them.

    Raises
    ------
    ValueError
        As `find_pairs`; or if there are several pairs, of which the first is named, or one camera's picture alone.
    """
    named = [left] if right is None else [left, right]
    are_many = [glob.has_magic(str(one)) or Path(one).is_dir() or _is_video(one) for one in named]
    if right is not None and not all(are_many):
        return PairFile(Path(left), Path(right))
    if right is None and Path(left).is_file() and not _is_video(left):
        width, height = image_size(left)
        if width < WIDE * height:
            raise ValueError(f"{left} is {width}x{height}, the picture of one camera: name the right camera's, too")
    pairs = find_pairs(left, right)
    if len(pairs) > 1:
        first = f"the first is {pairs[0].left} {pairs[0].right}"
        raise ValueError(f"{' '.join(map(str, named))}: {len(pairs)} pairs, one is wanted: name its pictures; {first}")
    return pairs[0]


def pair_sides(files: Sequence[Path], source: str) -> tuple[list[PairFile], list[Path]]:
    """Pair those of some pictures whose names tell a side.

    Parameters
    ----------
    files : sequence of Path
        Pictures.
    source : str
        Where they are from, for the message.

    Returns
    -------
    pairs : list of PairFile
        In the order of the numbers in their names. Where no name tells a side, pictures that are both sides beside each
        other make pairs, too.
    others : list of Path
        Those that are of no pair.

    Raises
    ------
    ValueError
        As `find_pairs`, of pictures without a partner, or of one name.
    """
    sides: list[list[Path]] = [[], []]
    others = list[Path]()
    for path in files:
        (others if (side := _side(path)) is None else sides[side]).append(path)
    if any(sides):
        left, right = (_by_key(side, source) for side in sides)
        return _matched(left, right, sides=(f"of the left camera in {source}", f"of the right one in {source}")), others
    wide = [path for path in others if (size := image_size(path))[0] >= WIDE * size[1]]
    return [PairFile(*halves) for halves in unpack_halves(wide)], [path for path in others if path not in wide]


def left_pictures(source: str | PathLike[str]) -> list[Path]:
    """Find the pictures of the left camera, or of the only one.

    Parameters
    ----------
    source : path
        A folder or a pattern of one camera's pictures, or of both, of which the right ones are left out.

    Returns
    -------
    list of Path
        In the order of the numbers in their names.

    Raises
    ------
    ValueError
        If there is nothing of that name, or an empty folder.
    """
    folders = _side_folders(Path(source))
    files = _files(folders[0] if folders else str(source))
    return sorted((path for path in files if path.suffix.lower() in PICTURES and _side(path) != 1), key=_key)


def pair_name(file: str | PathLike[str]) -> str:
    """Tell what a pair is called: the words of one of its names without those of a side.

    Parameters
    ----------
    file : path

    Returns
    -------
    str

    Examples
    --------
    >>> pair_name("pairs/03_left.jpg"), pair_name("rightKitchen.png")
    ('3', 'kitchen')
    """
    return " ".join(str(number) if is_number else word for is_number, number, word in _key(Path(file)))


def one_size(sizes: Mapping[Path, tuple[int, int]]) -> tuple[int, int]:
    """Refuse pictures of several sizes.

    Parameters
    ----------
    sizes : mapping of file to (width, height), px

    Returns
    -------
    (width, height), px
        The one they all have.

    Raises
    ------
    ValueError
        If they differ; those are named that most do not have.
    """
    usual = max(sorted(set(sizes.values())), key=list(sizes.values()).count)
    if odd := [f"{path} is {w}x{h}" for path, (w, h) in sizes.items() if (w, h) != usual]:
        many = "most" if 2 * len(odd) < len(sizes) else "some"
        shown = "".join(f"\n  {text}" for text in (*odd[:_LISTED], *["..."] * (len(odd) > _LISTED)))
        raise ValueError(f"all pictures must have one size, {many} are {usual[0]}x{usual[1]}, but:{shown}")
    return usual


def _sizes(files: Sequence[Path]) -> dict[Path, tuple[int, int]]:
    """Sizes of pictures; where one tells none, all that cannot be read are named."""
    try:
        return {path: image_size(path) for path in files}
    except ValueError:
        wrong = [text for path in files if (text := _unread(path))]
    shown = "".join(f"\n  {text}" for text in (*wrong[:_LISTED], *["..."] * (len(wrong) > _LISTED)))
    raise ValueError(f"{len(wrong)} of {len(files)} files are no readable images:{shown}")


def _unread(path: Path) -> str:
    """What is wrong with a picture; empty where it can be read."""
    try:
        read_image(path)
    except ValueError as error:
        return str(error)
    return ""


def _check_sizes(pairs: Sequence[PairFile]) -> None:
    """Refuse pictures of several sizes; two cameras that have one each are told as such."""
    sizes = _sizes([path for pair in pairs for path in pair])
    left, right = ({sizes[path] for path in side} for side in zip(*pairs, strict=True))
    if len(pairs) > 1 and len(left) == len(right) == 1 and left != right:
        (a, b), (c, d) = *left, *right
        remedy = "set both cameras to one size and take them again"
        raise ValueError(f"left pictures are {a}x{b}, right ones {c}x{d}: {remedy}")
    one_size(sizes)


def _check_turns(pairs: Sequence[PairFile]) -> None:
    """Refuse pictures of one camera of which EXIF turns some: its middle and its lens would lie elsewhere in them."""
    for files in zip(*pairs, strict=True):
        turns = [image_orientation(path) for path in files]
        usual = max(sorted(set(turns)), key=turns.count)
        if odd := [path for path, turn in zip(files, turns, strict=True) if turn != usual]:
            raise ValueError(
                f"{_names(odd)} in {odd[0].parent}: EXIF turns {'them' if len(odd) > 1 else 'it'} unlike the other "
                f"pictures of that camera, and all must be the same way up: take the orientation out of the EXIF of all"
            )


def turned_by_exif(files: Iterable[Path]) -> str:
    """Tell which pictures were turned as they were read, and what helps if that was wrong.

    Parameters
    ----------
    files : iterable of Path

    Returns
    -------
    str
        Empty where none was.
    """
    turns = {path: image_orientation(path) for path in files}
    if not (turned := [path.name for path, turn in turns.items() if turn != 1]):
        return ""
    how = " or ".join(_TURNS.get(turn, "mirrored") for turn in sorted(set(turns.values()) - {1}))
    were, them = ("were", "them") if len(turned) > 1 else ("was", "it")
    said = f"{listed(turned, _FEW)} {were} {how} as the EXIF in {them} says"
    return f"{said}: if that is the cause, take the orientation out of it"


def _both_sides(source: str, every: int | None) -> list[PairFile]:
    """Pairs of one folder, pattern or video."""
    if _is_video(source):
        return [PairFile(*files) for files in unpack_videos([Path(source)], every)]
    if folders := _side_folders(Path(source)):
        named_left, named_right = map(_by_key, _pictures(*folders), folders)
        return _matched(named_left, named_right)
    (files,) = _pictures(source)
    if all(_side(path) is None for path in files):
        if all(width >= WIDE * height for width, height in _sizes(files).values()):
            return [PairFile(*halves) for halves in unpack_halves(files)]
        raise ValueError(
            f"{source} holds {counted(len(files), 'picture')} whose names tell no side ({_names(files)}), and they are "
            f"not both sides beside each other: name them left01.png, right01.png, or give two folders"
        )
    pairs, unclear = pair_sides(files, source)
    if unclear:
        raise ValueError(f"{_names(unclear)} in {source}: neither of the left nor of the right camera by name")
    return pairs


def _is_video(path: str | PathLike[str]) -> bool:
    return Path(path).suffix.lower() in VIDEOS


def _side_folders(folder: Path) -> tuple[str, str] | None:
    there = {path.name.lower(): str(path) for path in folder.iterdir() if path.is_dir()} if folder.is_dir() else {}
    return next(((there[a], there[b]) for a, b in _FOLDERS if {a, b} <= set(there)), None)


def _pictures(*sources: str) -> list[list[Path]]:
    """Pictures of each folder, pattern or file, and nothing else."""
    import cv2

    found = [_without_scans(_files(source)) for source in sources]
    for path in (path for files in found for path in files):
        check_name(path)
    wrong = [[path for path in files if not cv2.haveImageReader(str(path))] for files in found]
    if any(wrong):  # then those that begin as pictures do are named as well
        wrong = [[path for path in files if _unread(path)] for files in found]
        others = "; in ".join(f"{source}: {_names(bad)}" for source, bad in zip(sources, wrong, strict=True) if bad)
        raise ValueError(
            f"files that are no readable images, in {others}. Expected only pictures (JPEG, PNG, ...): move the others "
            f"away, copy damaged ones again"
        )
    return found


def _without_scans(files: list[Path]) -> list[Path]:
    """What stands beside a laser's recordings, or these where there is nothing else."""
    return [path for path in files if path.suffix.lower() != _SCAN] or files


def _files(source: str) -> list[Path]:
    folder = Path(source)
    if folder.is_dir():
        files = _there(folder)
        if not _hold_pictures(files) and (below := _recordings_below(folder)):
            raise ValueError(f"{source} itself holds no pictures: did you mean {' or '.join(map(str, below))}?")
        if not files:
            raise ValueError(f"{source} is empty: expected the pictures of a camera")
        return files
    if folder.is_file():
        return [folder]
    if files := sorted(path for path in map(Path, glob.glob(source)) if path.is_file()):
        return files
    if glob.has_magic(source):
        raise ValueError(f"{source}: no file has such a name")
    raise ValueError(
        f"{source}: no such file or folder: expected pictures, a folder of them, a pattern in quotes, or a video"
    )


def _hold_pictures(files: Sequence[Path]) -> bool:
    """Whether there are pictures or videos among some files, by their names or, of rarer kinds, by how they begin."""
    import cv2

    by_name = any(path.suffix.lower() in (*PICTURES, *VIDEOS) for path in files)
    return by_name or any(cv2.haveImageReader(str(path)) for path in files)


def _recordings_below(folder: Path) -> list[Path]:
    """Folders in a folder that hold the pictures which were looked for in itself."""
    inside = [path for path in sorted(folder.iterdir()) if path.is_dir() and not path.name.startswith(".")]
    return [path for path in inside if _side_folders(path) or _hold_pictures(_there(path))][:_GUESSES]


def _words(path: Path) -> list[str]:
    return [word.lower() for word in _WORDS.findall(path.stem)]


def _side(path: Path) -> int | None:
    """0 if the name tells the left side, 1 the right, None neither (or both)."""
    words = _words(path)
    told = {_SIDES[word] for word in words if word in _SIDES}
    told = told or {_SIDES[side] for word in words for side in ("left", "right") if word.startswith(side)}
    told = told or {_SIDES[side] for word in words for side in ("left", "right") if word.endswith(side)}
    return told.pop() if len(told) == 1 else None


def _key(path: Path) -> _Key:
    """What is left of a name without the words of a side; numbers count as numbers."""
    words = (re.sub("left|right", "", word) for word in _words(path) if word not in _SIDES)
    return tuple((True, int(word), "") if word.isdecimal() else (False, 0, word) for word in words if word)


def _by_key(files: Iterable[Path], source: str) -> tuple[str, dict[_Key, Path]]:
    found: dict[_Key, list[Path]] = {}
    for path in files:
        found.setdefault(_key(path), []).append(path)
    if twice := [path for paths in found.values() if len(paths) > 1 for path in paths]:
        raise ValueError(f"{_names(twice)} cannot be told apart by name: expected one number or name for each picture")
    return source, {key: paths[0] for key, paths in found.items()}


def _matched(
    left: tuple[str, dict[_Key, Path]],
    right: tuple[str, dict[_Key, Path]],
    sides: Sequence[str] | None = None,
) -> list[PairFile]:
    """Pairs by equal keys; what stays alone is named, with those it might belong to."""
    (where_left, a), (where_right, b) = left, right
    are_in_order = sides is None and set(a).isdisjoint(b)  # as by time stamps
    if are_in_order and len(a) == len(b):
        return [PairFile(a[one], b[other]) for one, other in zip(sorted(a), sorted(b), strict=True)]
    where = sides or (f"in {where_left}", f"in {where_right}")
    lonely = [[mine[key] for key in sorted(set(mine) - set(other))] for mine, other in ((a, b), (b, a))]
    alone = [
        f"without a partner {there}: {listed((_guess(path, others) for path in these), _FEW)}"
        for these, others, there in zip(lonely, lonely[::-1], where[::-1], strict=True)
        if these
    ]
    if alone:
        as_many = f", or as many on both sides (not {len(a)} and {len(b)})" if are_in_order else ""
        raise ValueError(
            f"pictures {'; '.join(alone)}. Expected the same names or numbers on both sides, as 01.png in each folder, "
            f"or left01.png and right01.png{as_many}: add the partner or move the odd one away"
        )
    return [PairFile(a[key], b[key]) for key in sorted(a)]


def _guess(path: Path, others: Sequence[Path]) -> str:
    """A lonely picture's name, with the likeliest of the other side's lonely ones, or with what is missing there."""
    nearest = difflib.get_close_matches(path.name, [other.name for other in others], n=_GUESSES, cutoff=0.5)
    if nearest or others:
        return f"{path.name} ({' or '.join(nearest)}?)" if nearest else path.name
    missing = _WORDS.sub(lambda word: _other_side(word[0]), path.stem) + path.suffix
    return f"{path.name} ({missing} is missing)"


def _other_side(word: str) -> str:
    """A word of a name as the other side's picture has it."""
    other = _OTHER.get(word.lower(), word)
    return other.upper() if word.isupper() else other.title() if word.istitle() else other


def _names(files: Iterable[Path]) -> str:
    return listed(path.name for path in files)
