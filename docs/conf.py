"""How Sphinx builds the documentation: `python docs/build.py`, without any network."""

from __future__ import annotations

import logging
import sys
from importlib import metadata
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE / "extensions"), str(HERE / "drawings"), str(HERE.parent)]

project = "sensorless-sandbox"
author = copyright = "The sensorless-sandbox authors"
try:
    release = metadata.version("sensorless-sandbox")
except metadata.PackageNotFoundError:
    release = "source"

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "numpydoc",
    "sphinx_gallery.gen_gallery",
    "mathml",  # this one and the next are files of docs/extensions
    "generated",
    "inline_figures",
    "wide_tables",
]
exclude_patterns = ["_build", "extensions", "drawings", "tutorials/*", "README.md"]
smartquotes = False  # options begin with two dashes
default_role = "literal"
highlight_language = "text"  # of a block that names none
# pages do not say that something was compiled
logging.getLogger("sensorless").setLevel(logging.ERROR)

myst_enable_extensions = ["dollarmath", "colon_fence", "deflist", "attrs_inline"]
myst_heading_anchors = 3

autodoc_typehints = "none"  # the numpydoc text says what is taken and given, with shapes and units
autodoc_member_order = "bysource"
numpydoc_show_class_members = False
numpydoc_validation_checks = set()

sphinx_gallery_conf = {
    "examples_dirs": "tutorials",
    "gallery_dirs": "gallery",
    "filename_pattern": r"plot_",
    "within_subsection_order": "FileNameSortKey",
    "abort_on_example_error": True,
    "download_all_examples": False,
    "show_memory": False,
    "show_signature": False,
    "min_reported_time": 10_000,
    "write_computation_times": False,
    "capture_repr": ("__repr__",),
    "ignore_repr_types": ".*",  # only what is printed
    "image_scrapers": ("returned_figures.scraper",),
    "nested_sections": False,
}

html_theme = "furo"
html_title = "sensorless-sandbox"
html_static_path = ["_static"]
html_css_files = ["pages.css"]
html_copy_source = False
html_show_sourcelink = False
html_theme_options = {"navigation_with_keys": True}
pygments_style = "friendly"
pygments_dark_style = "monokai"
