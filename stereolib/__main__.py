"""``python -m stereolib``: the same as the command ``stereolib``."""

import sys

if __name__ == "__main__":
    try:
        from stereolib.cli import main
    except KeyboardInterrupt:
        sys.exit(130)
    sys.exit(main())
