"""The paper's own numbers and its own steps: what it prints, its height recipe, its pixel-cm relation.

The ledger holds every printed value beside ours. The steps are followed as printed, and stand beside the cure.
"""

import lazy_loader as _lazy

__getattr__, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)
