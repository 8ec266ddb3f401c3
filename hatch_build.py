"""Build hook of the wheel: the chapter that `stereolib report` runs goes in without outputs, which are made anew."""

from __future__ import annotations

import json
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

CHAPTER = "notebooks/11_your_own_rig.ipynb"


class WithoutOutputs(BuildHookInterface[Any]):
    """Takes the place of the file that the configuration would copy."""

    PLUGIN_NAME = "custom"

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Write the chapter with empty outputs, and have it included."""
        if version == "editable":  # which reads the repository's own
            return
        chapter = json.loads((Path(self.root) / CHAPTER).read_text(encoding="utf-8"))
        for cell in chapter["cells"]:
            if cell["cell_type"] == "code":
                cell |= {"outputs": [], "execution_count": None}
        self.folder = TemporaryDirectory()
        bare = Path(self.folder.name) / Path(CHAPTER).name
        bare.write_text(json.dumps(chapter, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
        build_data["force_include"][str(bare)] = f"stereolib/data/{CHAPTER}"

    def finalize(self, *_: Any) -> None:
        """Take what was written away again."""
        if hasattr(self, "folder"):
            self.folder.cleanup()
