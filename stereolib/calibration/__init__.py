"""From pictures of boards to a calibrated rig that knows how good it is, and to the pose of its laser.

Boards are found, lenses and pose are solved in one least squares, standard deviations come with every parameter, and a
diagnosis names what is wrong with the pictures and what mends it.
"""

import lazy_loader as _lazy

__getattr__, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)
