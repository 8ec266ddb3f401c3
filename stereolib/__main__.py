"""``python -m stereolib``: the same as the command ``stereolib``."""

import sys

if __name__ == "__main__":
    try:
        from stereolib.cli import main

        sys.exit(main())
    except KeyboardInterrupt:  # before the command began
        sys.exit(130)
