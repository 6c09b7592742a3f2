"""Builds the kernels in C for an installation, editable or not, and for a wheel."""

import os
import sys
from pathlib import Path

from hatchling.builders.hooks.plugin.interface import BuildHookInterface
from packaging.tags import platform_tags

SOURCE = Path(__file__).parent / "src"
TARGET = os.environ.get("PLUMBOB_TARGET", "")


class Kernels(BuildHookInterface):
    """Makes the extension; without a compiler the kernels run as Python, and say so."""

    PLUGIN_NAME = "custom"

    def dependencies(self):
        """Ask for zig's compiler where the system has none, and for other machines."""
        return ["ziglang>=0.17"] if TARGET or not self.build().compiler() else []

    def initialize(self, version, build_data):
        """Build beside the package, or for the machine that PLUMBOB_TARGET names."""
        if self.target_name == "sdist":
            return
        build = self.build()
        try:
            made = build.build(target=TARGET)
        except build.BuildError as error:
            if TARGET:
                raise
            self.app.display_warning(f"Plumbob's kernels are not built, and will run as Python: {error}")
            return
        build_data["pure_python"] = False
        build_data["tag"] = f"cp311-abi3-{TARGET or next(platform_tags())}"
        if version != "editable":
            build_data["force_include"].update({str(file): f"plumbob/{file.name}" for file in made})

    @staticmethod
    def build():
        """The module that builds, of the sources beside this file."""
        sys.path.insert(0, str(SOURCE))
        os.environ["PLUMBOB_KERNELS"] = "python"
        from plumbob.core.kernels import build

        return build
