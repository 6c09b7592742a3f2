"""``python -m plumbob.core.kernels build``: make the extension."""

import sys

from plumbob.core.kernels.build import BuildError, build
from plumbob.core.kernels.types import UnsupportedError

if __name__ == "__main__":
    try:
        build()
    except (BuildError, UnsupportedError) as error:
        sys.exit(str(error))
