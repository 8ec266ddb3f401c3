"""Figures: the only room that imports matplotlib. Functions draw onto axes that they are given and return them.

A ``plot_...`` function draws one result, with units on its axes and matplotlib's own defaults whatever the user's are;
`panels` makes the axes, `save_figure` writes the picture, `show_figure` only shows it. The page of a calibration is
written here too.
"""

import lazy_loader as _lazy

__getattr__, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)
