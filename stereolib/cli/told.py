"""What commands tell: of a measured object in numbers for JSON and in words for people; and what takes so long."""

from __future__ import annotations

import math
import sys
import textwrap
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

from stereolib.base import plus_minus

if TYPE_CHECKING:
    from stereolib.measurement import MeasuredObject

_DECIMALS, _WIDTH = 4, 120


def plain(value: float) -> float | None:
    """A number for JSON; None where it is not known."""
    return round(float(value), _DECIMALS) + 0.0 if math.isfinite(value) else None


def object_facts(item: MeasuredObject) -> dict[str, Any]:
    """What is known of an object, ready for JSON: None where a thing is not known."""
    import numpy as np

    facts: dict[str, Any] = {"shape": item.shape}
    for name, size, std in zip(("length", "width", "height"), item.size_mm, item.std_mm, strict=True):
        facts |= {f"{name}_mm": plain(size), f"{name}_std_mm": plain(std)}
    volume, area = item.volume_l, item.surface_m2
    facts |= {"volume_l": plain(volume[0]), "volume_std_l": plain(volume[1])}
    facts |= {"surface_m2": plain(area[0]), "surface_std_m2": plain(area[1])}
    facts["position_mm"] = [plain(value) for value in item.position_mm]
    facts["position_std_mm"] = [plain(value) for value in np.sqrt(np.diag(item.position_covariance))]
    facts |= {"yaw_rad": plain(item.yaw_rad), "yaw_std_rad": plain(item.yaw_std_rad)}
    facts["sources"] = {what: str(source) for what, source in item.sources.items()}
    facts["unsure"] = dict(item.unsure)
    return facts | {"reasons": {what: str(why) for what, why in item.reasons.items()}}


#: What the numbers of `object_sizes` are.
SIZES = "length x width x height, ± one standard deviation"


def object_sizes(name: str, item: MeasuredObject) -> str:
    """Its name, shape and sizes."""
    sizes = " x ".join(plus_minus(size, std) for size, std in zip(item.size_mm, item.std_mm, strict=True))
    return f"{name}  {item.shape}: {sizes} mm"


def object_title(name: str, item: MeasuredObject) -> str:
    """The same, and what its numbers are."""
    return f"{object_sizes(name, item)} ({SIZES})"


def object_details(item: MeasuredObject, place: str) -> list[str]:
    """Its place and turn, volume and surface, what gave them, and what is not known, and why."""
    turned = "" if math.isnan(item.yaw_rad) else f", turned by {math.degrees(item.yaw_rad):.1f} degrees"
    lines, (volume, std) = [place + turned], item.volume_l
    if math.isfinite(volume):
        area, area_std = item.surface_m2
        lines.append(f"volume {plus_minus(volume, std)} l, surface {plus_minus(area, area_std)} m2 (sides and top)")
    if item.sources:
        lines.append("; ".join(f"{what}: {who}" for what, who in item.sources.items()))
    lines += [f"{what} unsure: {why}" for what, why in _together(item.unsure)]
    whole, sizes = item.reasons.get("object"), {what: why for what, why in item.reasons.items() if what != "object"}
    return lines + [f"no {what}: {why}" for what, why in _together(sizes)] + ([str(whole)] if whole else [])


def _together(whys: Mapping[str, object]) -> list[tuple[str, str]]:
    """Sizes of which the same is said, as "length and width", and that."""
    of = dict[str, list[str]]()
    for what, why in whys.items():
        of.setdefault(str(why), []).append(what)
    return [(" and ".join(whats), why) for why, whats in of.items()]


def wrapped(lines: Iterable[str]) -> str:
    """Lines for a terminal, broken where they are too long."""
    broken = (textwrap.wrap(line, _WIDTH, subsequent_indent="     ", drop_whitespace=False) for line in lines)
    return "\n".join(part for line in broken for part in line)


def say_on_a_terminal(text: str) -> None:
    """Tell who waits what takes so long; a file that standard error is sent to has nothing of it."""
    if sys.stderr.isatty():
        print(text, file=sys.stderr, flush=True)
