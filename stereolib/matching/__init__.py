"""From a rectified pair to a disparity map: SGBM, filters, whole pipelines, and how good a map is.

The matcher is OpenCV's, with settings that are checked instead of rounded. Filters fill and smooth the map, pipelines
name whole ways, the laser can narrow the search, and scores and sweeps hold the maps against a known truth.
"""

import lazy_loader as _lazy

__getattr__, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)
