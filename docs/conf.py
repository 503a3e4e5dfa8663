"""The documentation as a site: `python -m sphinx -W --keep-going docs docs/_build/html`.

Nothing is fetched: formulas become MathML, and no inventory of another site is read. Tutorials run
as the site is built, and their results are kept (docs/_build/.jupyter_cache); scripts of the
gallery likewise. `DOCS_EXECUTE=off` leaves both out, for a fast look at the pages.
"""

import os
import sys
from importlib import metadata
from pathlib import Path

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE / "_ext"))

EXECUTED = os.environ.get("DOCS_EXECUTE", "on") != "off"
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

project = "amoeboid"
author = "The amoeboid developers"
project_copyright = "The amoeboid developers"
version = release = metadata.version("amoeboid")

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.viewcode",
    "sphinx_copybutton",
    "sphinx_design",
    "sphinx_gallery.gen_gallery",
    "mathml",
    "plain_docstrings",
    "public_names",
    "declared_fields",
]
exclude_patterns = ["_build", "gallery/*.ipynb", "_ext", "_templates", "**/.ipynb_checkpoints"]
templates_path = ["_templates"]
nitpicky = False  # a name in a docstring is a link where it is a public one, see _ext/public_names

# pages in Markdown
myst_enable_extensions = ["amsmath", "colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 4
nb_execution_mode = "cache" if EXECUTED else "off"
nb_execution_raise_on_error = True
nb_execution_show_tb = True
nb_execution_timeout = 600
nb_execution_cache_path = str(HERE / "_build" / ".jupyter_cache")
nb_merge_streams = True
html_math_renderer = "mathml"
suppress_warnings = ["config.cache"]

# the reference, from docstrings
autosummary_generate = True
autosummary_imported_members = False
autodoc_typehints = "signature"
autodoc_typehints_format = "short"
autodoc_member_order = "bysource"
autodoc_default_options = {"exclude-members": "__init__, __new__"}
autodoc_preserve_defaults = True
python_use_unqualified_type_names = True
python_maximum_signature_line_length = 70
default_role = "name"
add_module_names = False
toc_object_entries_show_parents = "hide"

# scripts of ../examples
sphinx_gallery_conf = {
    "examples_dirs": ["../examples"],
    "gallery_dirs": ["gallery"],
    "filename_pattern": r"plot_\w+\.py$" if EXECUTED else r"a^",
    "plot_gallery": EXECUTED,
    "abort_on_example_error": False,
    "only_warn_on_example_error": False,
    "remove_config_comments": True,
    "download_all_examples": False,
    "show_memory": False,
    "write_computation_times": False,
    "show_signature": False,
    "backreferences_dir": None,
    "image_scrapers": ("matplotlib",),
    "within_subsection_order": "FileNameSortKey",
    "copyfile_regex": r"",
}

# looks
html_theme = "pydata_sphinx_theme"
html_title = "amoeboid"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_logo = "_static/logo.svg"
html_favicon = "_static/logo.svg"
html_theme_options = {
    "logo": {"text": "amoeboid"},
    "navigation_with_keys": False,
    "show_prev_next": True,
    "show_toc_level": 2,
    "header_links_before_dropdown": 8,
    "navbar_align": "left",
    "footer_start": ["copyright"],
    "footer_end": [],
    "pygments_light_style": "a11y-high-contrast-light",
    "pygments_dark_style": "a11y-high-contrast-dark",
    "back_to_top_button": False,
}
html_context = {"default_mode": "auto"}  # light or dark, as the system has it
html_sidebars = {"index": []}
html_show_sourcelink = False
html_copy_source = False
copybutton_exclude = ".linenos, .gp, .go"
