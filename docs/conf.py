"""Sphinx configuration of the documentation site in this folder: `python scripts/bootstrap.py docs`.

The site is self-contained: it needs no network, and opens from a folder.
"""

from __future__ import annotations

import sys
import tomllib
from pathlib import Path

DOCS = Path(__file__).resolve().parent
ROOT = DOCS.parent
sys.path[:0] = [str(ROOT / "addon"), str(ROOT / "scripts"), str(DOCS)]

_manifest = tomllib.loads((ROOT / "blender_manifest.toml").read_text(encoding="utf-8"))

project = "Rigid Motion"
author = _manifest["maintainer"]
version = release = _manifest["version"]

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "numpydoc",
    "sphinx_copybutton",
    "extensions.commands",
    "extensions.excerpts",
    "extensions.mathml",
    "extensions.mode_pages",
    "extensions.module_map",
    "extensions.names",
    "extensions.repository",
    "extensions.videos",
]
templates_path = ["templates"]
exclude_patterns = ["**/__pycache__", "extensions", "templates"]
nitpicky = True
nitpick_ignore_regex = [
    ("py:.*", r"(collections|np|numpy|typing)\..*"),
    ("py:class", r"rigid_motion\.motion\.(cleaning|segments)\..*"),
    ("py:class", r"rigid_motion_batch\.recordings\..*"),
]
"""Names without links: those documented by other projects, which would need a network, and those no caller needs."""

myst_enable_extensions = ["attrs_block", "attrs_inline", "colon_fence", "deflist", "dollarmath"]
myst_fence_as_directive = ["math"]
myst_heading_anchors = 4

autodoc_typehints = "signature"
autodoc_member_order = "bysource"
autodoc_preserve_defaults = True
default_role = "name"
numpydoc_show_class_members = False
add_module_names = False
python_use_unqualified_type_names = True
toc_object_entries = False

root_of_project = str(ROOT)

html_theme = "furo"
html_title = "Rigid Motion"
html_static_path = ["static"]
html_css_files = ["site.css"]
html_js_files = ["site.js"]
html_copy_source = False
html_show_sphinx = html_show_copyright = False
html_math_renderer = "mathml"
html_theme_options = {
    "light_css_variables": {
        "color-brand-primary": "#0b62a4",
        "color-brand-content": "#0b62a4",
    },
    "dark_css_variables": {
        "color-brand-primary": "#56b4e9",
        "color-brand-content": "#56b4e9",
    },
}
copybutton_exclude = ".linenos, .gp, .go"
