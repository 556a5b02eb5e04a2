"""Configuration of the documentation site; ``make docs`` builds it into build/docs.

Pages about the command line, the parameters, the messages of errors and Python are generated from
the code at every build, into docs/generated.
"""

import sys
from importlib.metadata import version as version_of
from pathlib import Path

from sphinx.application import Sphinx

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))

# beside this file, on the path from here on
from site_pages import link_project_pages, write_pages  # noqa: E402

project = "Caribou"
author = "the Caribou authors"
release = version = version_of("caribou-auv")
extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.mathjax", "numpydoc"]
html_theme = "pydata_sphinx_theme"
html_title = "Caribou"
html_theme_options = {
    "show_toc_level": 2,
    "navigation_depth": 2,
    "header_links_before_dropdown": 6,
    "show_prev_next": False,
    "footer_end": [],
}
html_sidebars = {"quickstart": []}  # has no pages below it
html_show_sourcelink = False
html_copy_source = False
smartquotes = False  # would turn the two hyphens of an option into a dash
exclude_patterns = ["performance", "site_pages.py", "reference_pages.py"]
myst_heading_anchors = 3
nb_execution_mode = "off"  # the notebook holds its outputs: python -m tests.notebook
myst_enable_extensions = ["colon_fence"]
autodoc_typehints = "none"  # numpydoc's sections name the types
numpydoc_show_class_members = False


def setup(app: Sphinx) -> None:
    """Write the generated pages, and replace links that leave the site."""
    write_pages(HERE / "generated")
    app.connect("source-read", _replace_links)


def _replace_links(app: Sphinx, page: str, source: list[str]) -> None:
    """Replace the links of one page."""
    source[0] = link_project_pages(source[0])
