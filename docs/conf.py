import sys
from pathlib import Path

import taxel

sys.path.insert(0, str(Path(__file__).parent))
import measured

measured.write()

project = "taxel"
author = "The taxel developers"
copyright = "2026, the taxel developers"
release = taxel.__version__
extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.napoleon",
    "sphinx.ext.mathjax",
    "from_program",
]
source_suffix = {".md": "markdown", ".rst": "restructuredtext"}
exclude_patterns = ["_build"]
html_theme = "furo"
html_title = "taxel"
html_static_path = ["_static"]
html_css_files = ["phone.css"]
smartquotes = False  # options begin with two dashes
autosummary_generate = False
autodoc_member_order = "bysource"
autodoc_typehints = "none"
napoleon_google_docstring = False
napoleon_use_rtype = False
napoleon_custom_sections = [("Raises", "params_style")]
myst_enable_extensions = ["dollarmath", "deflist"]
myst_heading_anchors = 3
napoleon_use_ivar = True
# `events` in a docstring is the argument, whichever class has an attribute of that name.
# Links to pages outside docs/ are for GitHub, where tests/test_docs.py follows them; no built page has them.
suppress_warnings = ["ref.python", "myst.xref_missing"]
