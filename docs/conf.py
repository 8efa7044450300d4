from __future__ import annotations

import sys
from pathlib import Path

import robotrue

sys.path.insert(0, str(Path(__file__).parent))

from notebook_pages import write_pages

project = "robotrue"
author = "The robotrue authors"
copyright = "The robotrue authors, Apache-2.0"
release = version = robotrue.__version__
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
myst_enable_extensions = ["colon_fence", "dollarmath"]
myst_heading_anchors = 3
html_theme = "furo"
html_title = "robotrue"
exclude_patterns = ["_build"]
autodoc_typehints = "none"
autodoc_member_order = "bysource"
# Every page copies the contents of all pages: with each name of the API it takes a second more.
toc_object_entries = False
napoleon_google_docstring = True
napoleon_custom_sections = ["Fails when"]
nitpicky = False
suppress_warnings = ["myst.xref_missing"]


def setup(app: object) -> None:
    """Writes the pages of the notebooks before they are read."""
    write_pages()
