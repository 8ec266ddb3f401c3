"""Lines of code in the browser, with a button that copies them."""

from __future__ import annotations

from pathlib import Path

import anywidget
import traitlets


class CodeBlock(anywidget.AnyWidget):
    """Code to take away.

    Attributes
    ----------
    code : str
    """

    _esm = Path(__file__).with_name("code_block.js")
    code = traitlets.Unicode().tag(sync=True)
