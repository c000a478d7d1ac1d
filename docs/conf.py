"""How Sphinx builds the site; `make docs` (docs/make_site.py) gathers the pages and hands them over."""

from __future__ import annotations

import importlib.util
import os
from typing import Any

from site_pages import docstrings

import bug_gym
from bug_gym.files import released

project = "bug_gym"
author = "The bug_gym developers"
copyright = author  # noqa: A001
release = bug_gym.__version__

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx_copybutton",
    "sphinx_design",
]
if os.environ.get("BUG_GYM_DOCS_ONLINE"):  # the inventories of others are fetched: not without a network
    extensions.append("sphinx.ext.intersphinx")
    intersphinx_mapping = {
        "gymnasium": ("https://gymnasium.farama.org", None),
        "numpy": ("https://numpy.org/doc/stable", None),
        "python": ("https://docs.python.org/3", None),
    }

myst_enable_extensions = ["colon_fence", "attrs_inline"]
myst_heading_anchors = 4
myst_links_external_new_tab = False

nb_execution_mode = os.environ.get("BUG_GYM_DOCS_NOTEBOOKS", "force")
nb_execution_in_temp = True
nb_execution_timeout = 300
nb_execution_raise_on_error = True
nb_merge_streams = True

autodoc_member_order = "bysource"
autodoc_typehints = "description"
autodoc_typehints_description_target = "documented"
autodoc_mock_imports = [name for name in ("stable_baselines3", "minari") if importlib.util.find_spec(name) is None]
default_role = "code"

html_theme = "furo"
html_title = f"bug_gym {released(release)}"
html_static_path = ["site_static"]
html_css_files = ["site.css"]
html_copy_source = False
html_show_sourcelink = False
copybutton_exclude = ".linenos, .gp, .go"
pygments_style = "friendly"
pygments_dark_style = "monokai"


def setup(app: Any) -> None:
    """Docstrings are read as they are written here."""
    app.connect("autodoc-process-docstring", docstrings.prepare)
