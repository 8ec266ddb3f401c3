"""``python -m stereolib``: the same as the command ``stereolib``."""

import sys

from stereolib.cli import main

if __name__ == "__main__":
    sys.exit(main())
