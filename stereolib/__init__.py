"""A stereo-vision and laser-ranging paper, reproduced step by step.

Each room below has one subject and offers its public names; the ones met first stand here too. All are loaded on
first use, so that ``import stereolib`` stays fast::

    import stereolib

    rig = stereolib.paper_rig()
    left, right = rig.rectify().rectify(*stereolib.read_pair("left.jpg", "right.jpg"))
"""

import lazy_loader as _lazy

__version__ = "0.1.0"

__getattr__, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)
