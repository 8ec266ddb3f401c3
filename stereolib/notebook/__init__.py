"""What only the notebooks use: sliders, and what they draw.

`explore` puts sliders under a picture; each ``draw_...`` function takes a few numbers and returns a picture and a line
of text, so that what a student moves is one function that can be called, and tested, without a notebook.
"""

import lazy_loader as _lazy

__getattr__, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)
