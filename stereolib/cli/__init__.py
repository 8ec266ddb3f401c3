"""The command line ``stereolib COMMAND``, one file a command. A new command is one more `Command` in ``COMMANDS``."""

import lazy_loader as _lazy

__getattr__, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)
