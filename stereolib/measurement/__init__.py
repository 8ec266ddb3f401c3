"""From a rectified pair, and a scan, to objects: height, length, width, volume, each with a standard deviation.

The floor is found as a plane, upright faces and their edges over it, the laser's lines beside them; both are brought
together into measured objects. What cannot be measured is refused with its reason.
"""

import lazy_loader as _lazy

__getattr__, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)
