"""From several stations to one map: objects and walls brought together, poses refined, files and a view.

A station is a place where the rig stood and what it measured there. Maps are written as meshes, clouds and grids.
"""

import lazy_loader as _lazy

__getattr__, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)
