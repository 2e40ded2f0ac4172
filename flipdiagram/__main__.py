"""`python -m flipdiagram`: the command line."""

import sys

from flipdiagram.cli.main import main

if __name__ == "__main__":
    sys.exit(main())
