"""From what was measured to the quantities on which a verdict of the ledger rests.

One file a notebook, one function a claim: it takes maps, scans or sizes and returns the numbers by the names of the
claim's conditions in ``published.toml``. Notebooks hand them to `stereolib.paper.compare_with_paper`; tests hand the
same functions broken data and see the verdict turn.
"""

import lazy_loader as _lazy

__getattr__, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)
