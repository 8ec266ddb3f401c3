"""Where data is found, and how files are read and written: what every other room stands on.

Recordings come from the checkout, from a folder of the user's, from the cache, or by a download that is checked
against its sha256. Files are read whole up to a bound, and written beside their target and then moved over it.
"""

import lazy_loader as _lazy

__getattr__, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)
