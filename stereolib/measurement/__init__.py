"""From a pair of pictures, and a scan, to objects: height, length, width, volume, each with a standard deviation.

The floor is found as a plane in the disparity map, what stands on it as regions with upright faces and edges, the
laser's lines beside them; what both sensors show of an object is brought together by its covariances. What cannot be
measured is refused, with the reason and what to do.
"""

import lazy_loader as _lazy

__getattr__, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)
