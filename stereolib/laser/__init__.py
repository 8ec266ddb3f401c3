"""The laser range finder: its protocol, its scans, its error, and what a scan shows.

Bytes of a Neato XV-11 become readings, readings become turns, turns become averaged scans; walls, segments and
footprints are found in them. Everything but `serial_port` works without a sensor.
"""

import lazy_loader as _lazy

__getattr__, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)
