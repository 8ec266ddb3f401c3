"""Sphinx' settings of the site. `build_site.py` beside this file lays out what Sphinx reads, and calls it."""

from __future__ import annotations

import posixpath
from pathlib import Path
from typing import Any

import sphinx.application
from docutils import nodes
from docutils.utils.math import MathError
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.util.logging import getLogger

import stereolib

project = author = "stereolib"
version = release = stereolib.__version__
project_copyright = "stereolib developers. Code: BSD-3-Clause; text and figures: CC BY 4.0"

extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.autosummary", "numpydoc"]
templates_path = [str(Path(__file__).resolve().parent / "templates")]
exclude_patterns = ["README.md"]  # its sections are included where they belong
default_role = "py:obj"  # names in docstrings, as numpydoc has them
toc_object_entries = False

# Notebooks are shown with the outputs that they were committed with.
nb_execution_mode = "off"
nb_merge_streams = True
nb_ipywidgets_js: dict[str, Any] = {}  # no script from elsewhere; outputs hold no live widget
myst_enable_extensions = ["colon_fence", "dollarmath"]
myst_all_links_external = True  # taken over as written: `lead_to_pages` leads them to the site's pages
myst_heading_anchors = 3

# The reference: a page a room, of the names that it offers.
autosummary_imported_members = True
autosummary_ignore_module_all = False
autodoc_member_order = "bysource"
autodoc_typehints = "none"  # the docstrings say more: shape, dtype, unit
numpydoc_show_class_members = False

html_theme = "furo"
html_title = "stereolib"
html_static_path = ["static"]
html_css_files = ["site.css"]
html_copy_source = False
html_use_index = html_domain_indices = False  # the search finds names
html_show_sphinx = False
html_math_renderer = "mathml"  # made here, so that no script is needed to show it


def lead_to_pages(app: sphinx.application.Sphinx, tree: nodes.document, name: str) -> None:
    """Turn links between files of the repository into links between pages, also of what a page includes."""
    for link in tree.findall(nodes.reference):
        target, mark, place = str(link.get("refuri", "")).partition("#")
        if not target or ":" in target:
            continue
        written_in = Path(link.source or tree["source"]).resolve().parent.relative_to(Path(app.srcdir).resolve())
        file = posixpath.normpath(posixpath.join(written_in.as_posix(), target))
        page, suffix = posixpath.splitext(file)
        if suffix in app.config.source_suffix:
            file = f"{page}.html"
        link["refuri"] = posixpath.relpath(file, posixpath.dirname(name) or ".") + mark + place


def write_math(translator: Any, node: nodes.math | nodes.math_block) -> None:
    """Write an equation as MathML, which browsers lay out themselves."""
    block = isinstance(node, nodes.math_block)
    tag = "div" if block else "span"
    try:
        translator.body.append(f'<{tag} class="math">{tex2mathml(node.astext(), as_block=block)}</{tag}>')
    except MathError as error:
        getLogger(__name__).warning("%s in the equation %s", error, node.astext(), location=node)
    raise nodes.SkipNode


def setup(app: sphinx.application.Sphinx) -> None:
    """Register both with Sphinx."""
    app.add_html_math_renderer("mathml", (write_math, None), (write_math, None))
    app.connect("doctree-resolved", lead_to_pages)
