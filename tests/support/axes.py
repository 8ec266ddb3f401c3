"""What axes show."""

from __future__ import annotations

import numpy as np


def rendered(ax):
    """Pixels of the axes' inside, as (H, W, 3)."""
    canvas = ax.figure.canvas
    canvas.draw()
    box = ax.get_window_extent()
    picture = np.asarray(canvas.buffer_rgba())[..., :3]
    height = picture.shape[0]
    return picture[height - int(box.y1) : height - int(box.y0), int(box.x0) : int(box.x1)]
