"""The paper regenerated: notebooks executed, their numbers compared with the committed ones, the report written.

Everything is made beside ``figures/`` and moved there only when no committed number changed, so that an interruption
leaves every file whole. Kernels run with one processor's arithmetic, so that two executions give the same bytes.
"""

import lazy_loader as _lazy

__getattr__, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)
