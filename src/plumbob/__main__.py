"""``python -m plumbob`` is the command line."""

import sys

from plumbob.cli.main import main

sys.exit(main())
