"""Sphinx: ``make docs`` builds these pages, offline, into ``build/docs``."""

import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE / "_ext"), str(HERE.parent)]

project = "planar-push"
author = "the planar-push authors"
copyright = "the planar-push authors; Apache-2.0"
extensions = ["myst_parser", "sphinx.ext.autodoc", "docstrings", "site_pages"]
exclude_patterns = ["_ext"]
html_theme = "furo"
html_title = "planar-push"
html_show_sourcelink = False
myst_heading_anchors = 4
myst_enable_extensions = ["dollarmath", "deflist"]
autodoc_member_order = "bysource"
autodoc_typehints = "description"
autodoc_default_options = {"members": True, "show-inheritance": True}
suppress_warnings = ["ref.python"]  # names that several modules export
