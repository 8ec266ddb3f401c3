"""`best` and its rival on two more pairs of photographs with a measured truth, for who has them.

``python benchmarks/photographs.py FOLDER``

The folder holds aloeL.jpg, aloeR.jpg and aloeGT.png from ``samples/data`` of OpenCV 4.10 (github.com/opencv/opencv) and
left_rgb.tif, right_rgb.tif and Cones_LEFT_GT.tif from ``notebooks/data`` of Pandora 1.9 (github.com/CNES/Pandora): both
pairs are of Middlebury's benchmarks. Aloe is made smaller by three, so that its truth in whole pixels is one in thirds;
that of Cones is one in quarters. They are no blind test: two steps of "best" were changed after they had shown what
these did to them; every setting is chosen on virtual scenes. The range that both matchers search is that of the truth.
Half a minute.
"""

from __future__ import annotations

import argparse
import hashlib
from pathlib import Path

import cv2
import numpy as np
from bench_pipeline import ROOMS, honesty
from common import loaded, save
from virtual_pairs import Pair

Array = np.ndarray
_THIRD = 3
SHA256 = {
    "aloeL.jpg": "cce5736808efe80d9f04b118dbb978c344d4345672b332718c3e039a3eeb8eee",
    "aloeR.jpg": "9b23100df31a846bc6e6a6545563b2b4120b948c9835c7d36cde00af77f4503e",
    "aloeGT.png": "39ce4f3cb48d797d1091c5152f93361d8104298c337f8a1c134d87dda3442c04",
    "left_rgb.tif": "a595cef06d6d96e2371ae159b0b378330b234fa4386a3915e79358a042722d20",
    "right_rgb.tif": "8514db7fde480169387d37af495e409b8a2af806516ddea3364f5e1ed78eb9d7",
    "Cones_LEFT_GT.tif": "e24f67ada270d46778a084ae889d7d9ad6e49979c42036ace3c62e14d488c31e",
}


def read(folder: Path, name: str) -> Array:
    """A file as it is known, (H, W) or (H, W, 3), of its own dtype."""
    data = (folder / name).read_bytes()
    if hashlib.sha256(data).hexdigest() != SHA256[name]:
        raise SystemExit(f"{folder / name} is another file than the one that was measured: take it from that release")
    return np.asarray(cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED))


def aloe(folder: Path) -> Pair:
    """In a third of its size, 427 x 370 px."""
    left, right, truth = (read(folder, name).astype(np.float32) for name in ("aloeL.jpg", "aloeR.jpg", "aloeGT.png"))
    height, width = (n // _THIRD * _THIRD for n in truth.shape)
    size = width // _THIRD, height // _THIRD
    small = (cv2.resize(a[:height, :width], size, interpolation=cv2.INTER_AREA) for a in (left, right))
    middle = truth[_THIRD // 2 : height : _THIRD, _THIRD // 2 : width : _THIRD]
    known = np.where(middle == 0, np.float32(np.nan), middle / np.float32(_THIRD))
    return Pair("aloe", *(a.round().astype(np.uint8) for a in small), known)


def cones(folder: Path) -> Pair:
    """As it is, 450 x 375 px."""
    left, right, truth = (read(folder, name) for name in ("left_rgb.tif", "right_rgb.tif", "Cones_LEFT_GT.tif"))
    return Pair("cones", left.astype(np.uint8), right.astype(np.uint8), np.where(truth == 0, np.float32(np.nan), truth))


def main() -> None:
    """Write ``results/photographs.json``."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    folder = parser.parse_args().folder
    if missing := [name for name in SHA256 if not (folder / name).is_file()]:
        raise SystemExit(f"{folder} lacks {', '.join(missing)}; --help says where they come from")
    cv2.setNumThreads(1)
    pairs = [cones(folder), aloe(folder)]
    found = honesty(pairs, (1 / 4, 1 / _THIRD))
    each = {row.pop("pair"): row for row in found.pop("each")}
    save("photographs", found | each, {*loaded(ROOMS), "matching/std_laws.json"})


if __name__ == "__main__":
    main()
