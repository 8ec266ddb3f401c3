"""How fast the bench follows a finger: in Chromium, from a slider's event to the new picture on the page.

Each knob is moved 40 times, as fast as its preview comes, and then rests; about three minutes.
"""

from __future__ import annotations

import json
import time
from importlib.util import find_spec
from typing import Any

import numpy as np
from common import asked, save
from support.browser import Page, bench_page, chromium
from tqdm.auto import tqdm

ROOMS = ("base", "rig", "laser", "matching", "measurement", "paper", "virtual", "notebook")
MOVES = 40
KNOBS = {
    "matcher": ("uniqueness (%)", "P1 (per pixel of the block)", "P2 (per pixel of the block)"),
    "method": ("recipe: threshold (px)", "recipe: rows cut off"),
    "scene": ("distance (mm)", "turn (degrees)", "camera pitch (degrees)", "baseline (mm)"),
    "laser": ("turned by (degrees)",),
}
_DRAGS = 8
_MANY = 500


def moved(page: Page, label: str, moves: int) -> tuple[list[float], list[float]]:
    """Previews after each move, and the full picture after the last: ms."""
    handle = page.slider(label)
    previews, full = [], []
    for k in range(moves):
        began = page.press(handle, "ArrowRight" if k % 20 < 10 else "ArrowLeft")
        previews.append(page.painted_after(began, "preview") - began)
        if k % 5 == 4:
            full.append(page.painted_after(began, "full") - began)
    return previews, full


def dragged(page: Page, label: str) -> float:
    """How long after a 2-second drag the last value is on the page, ms."""
    handle, keys = page.slider(label), ("ArrowRight", "ArrowLeft")
    until = time.monotonic() + 2
    began, k = 0.0, 0
    while time.monotonic() < until:
        began = page.press(handle, keys[(k // 15) % 2])
        k += 1
    return page.shown_after(began, label) - began


def main() -> None:
    """Open the page, move, print and save."""
    if "time" not in asked(__doc__):
        return
    if find_spec("playwright") is None or chromium() is None:
        print("left out: without Playwright (`make test-browser` installs it) and Chromium no page can be timed")
        return
    result: dict[str, Any] = {"moves": _MANY}
    with bench_page() as page:
        for group, labels in KNOBS.items():
            found = [moved(page, label, MOVES) for label in tqdm(labels, group, unit="knob")]
            previews, full = (np.concatenate(times) for times in zip(*found, strict=True))
            result[f"{group}_preview_ms"] = {f"p{q}": round(float(np.percentile(previews, q))) for q in (50, 95)}
            result[f"{group}_full_ms"] = {f"p{q}": round(float(np.percentile(full, q))) for q in (50, 95)}
        drags = [dragged(page, label) for label in ("distance (mm)", "recipe: threshold (px)") for _ in range(_DRAGS)]
        result["after_drag_ms"] = {"p50": round(float(np.median(drags))), "max": round(max(drags))}
        before = page.kernel_memory_mb()
        moved(page, "recipe: threshold (px)", _MANY)
        result["memory_mb"] = {"before": round(before), "after": round(page.kernel_memory_mb())}
    print(json.dumps(result, indent=1))
    save("explore", result, ROOMS)


if __name__ == "__main__":
    main()
