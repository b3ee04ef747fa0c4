"""`python -m server` is `coopnav`."""

import sys

from server.cli import main

sys.exit(main())
