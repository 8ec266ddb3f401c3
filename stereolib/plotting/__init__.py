"""Figures: the only room that imports matplotlib. Functions draw onto axes that they are given and return them."""

import lazy_loader as _lazy

__getattr__, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)
