"""Figures made small enough to stand inside a page, with the text that says what is to be seen in them."""

from __future__ import annotations

import base64
import io
from dataclasses import dataclass
from pathlib import Path

from stereolib.base import read_bytes

_WIDEST_PX, _QUALITY = 900, 60  # fifty figures in 2 MB, their labels still read


@dataclass(frozen=True)
class Embedded:
    """A picture that needs no other file.

    Parameters
    ----------
    address : str
        Its bytes, as an address of a page.
    width, height : int, px
    alt : str
        What there is to see; empty if its file does not say.
    """

    address: str
    width: int
    height: int
    alt: str


def embed(path: Path) -> Embedded:
    """Read a figure; where a WebP of at most 900 columns is smaller than its file, take that.

    Parameters
    ----------
    path : Path
        A PNG, whose ``Description`` says what there is to see (`stereolib.plotting.save_figure`).

    Returns
    -------
    Embedded
    """
    from PIL import Image

    data, kind = read_bytes(path), "png"
    picture = Image.open(io.BytesIO(data))
    alt = str(picture.info.get("Description", ""))
    shown = picture.convert("RGB")
    if shown.width > _WIDEST_PX:
        shown = shown.resize((_WIDEST_PX, round(shown.height * _WIDEST_PX / shown.width)), Image.Resampling.LANCZOS)
    stream = io.BytesIO()
    shown.save(stream, format="webp", quality=_QUALITY, method=4)
    if stream.tell() < len(data):
        data, kind = stream.getvalue(), "webp"
    address = f"data:image/{kind};base64,{base64.b64encode(data).decode('ascii')}"
    return Embedded(address, shown.width, shown.height, alt)
