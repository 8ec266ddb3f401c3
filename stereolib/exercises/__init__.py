"""Exercises that answer: each student gets numbers of his own, and a wrong answer is told what it probably came from.

`exercise` gives one of them by its number, a module a chapter says what they ask. The answers are computed from the
numbers that were drawn, and so are the usual wrong ones: nothing is typed that a notebook or a reader could copy.
"""

import lazy_loader as _lazy

__getattr__, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)
