"""The command line ``stereolib COMMAND``: one file a command, and one place that turns errors into a line and a code.

A new command is one more `Command` in a file of its own, named in ``commands.COMMANDS``. It imports what it needs when
it runs, so that ``--help`` is quick.
"""

import lazy_loader as _lazy

__getattr__, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)
