"""The site: `python -m sphinx -W -b html docs docs/_build/html` (extra `docs`)."""

from __future__ import annotations

import os
import sys
from importlib import metadata
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE), str(HERE.parent)]
# notebooks run in processes of their own, and import the checkout as well
os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, [str(HERE.parent), os.environ.get("PYTHONPATH", "")]))

import make_pages  # noqa: E402

project, author = "foliot", "the foliot developers"
release = metadata.version("foliot")
extensions = ["myst_nb", "numpydoc", "sphinx.ext.autodoc"]
exclude_patterns = ["_build", "_made/notes"]
html_theme = "pydata_sphinx_theme"
html_title = "foliot"
html_context = {"default_mode": "auto"}
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_show_sourcelink = False
html_theme_options = {
    "navbar_end": ["theme-switcher"],
    "secondary_sidebar_items": ["page-toc"],
    "show_prev_next": False,
    "navigation_with_keys": False,
}
html_sidebars = {"index": [], "first_hour": [], "tutorial": [], "accuracy": [], "_made/gallery": []}
html_math_renderer = "mathml"

myst_enable_extensions = ["dollarmath", "colon_fence"]
myst_heading_anchors = 3
nb_execution_mode = "cache"
nb_execution_cache_path = str(HERE / "_build" / "notebooks")
nb_execution_raise_on_error = True
nb_execution_timeout = 600  # a page may compile a kernel first
nb_merge_streams = True

numpydoc_show_class_members = False
numpydoc_xref_param_type = False
autodoc_typehints = "none"
suppress_warnings = ["myst.header"]  # a generated page may begin below its first level


def setup(app: Any) -> None:
    """What is generated, and formulas as MathML, which browsers draw without a script."""
    import mathml

    make_pages.write(HERE / "_made")
    app.add_html_math_renderer("mathml", inline_renderers=(mathml.inline, None), block_renderers=(mathml.block, None))
