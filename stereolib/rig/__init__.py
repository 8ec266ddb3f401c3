"""The two cameras: one camera with its lens, the pair, the pair after rectification, their pictures and their files.

A `StereoRig` holds what a calibration found; its `rectify` gives the `RectifiedRig` that turns pictures so that rows
match, and disparity into depth. Calibrations are read and written in the formats of OpenCV, ROS, Kalibr and MATLAB.
"""

import lazy_loader as _lazy

__getattr__, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)
