"""The virtual rig: Table I's two cameras and an XV-11 looking at scenes of boxes on a floor.

Scenes are ray-cast through the exact lenses, a webcam and a laser are put behind them, and the truth is known. The
committed recordings are made here and read back as `recordings`; `emulator` plays the laser onto a port, `walk` and
`laser_boards` are what else was recorded with it. Whatever comes from here is called virtual wherever it is shown.
"""

import lazy_loader as _lazy

__getattr__, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)
