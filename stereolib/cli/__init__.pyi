from .command import Command
from .commands import COMMANDS, main, make_parser

__all__ = ["COMMANDS", "Command", "main", "make_parser"]
