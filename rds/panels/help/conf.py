"""Sphinx's settings for the help pages. They fetch nothing: no fonts, no scripts from elsewhere."""

from pathlib import Path
from typing import Any

project = "RDS"
author = "the RDS authors"
copyright = "MIT licence"
extensions = ["myst_parser"]

myst_heading_anchors = 4
html_theme = "alabaster"
html_theme_options = {
    "description": "Rapid development of machine-tool axis control",
    "fixed_sidebar": True,
    "page_width": "960px",
    "sidebar_width": "210px",
    "show_powered_by": False,
    "font_family": "system-ui, 'DejaVu Sans', Arial, sans-serif",
    "head_font_family": "system-ui, 'DejaVu Sans', Arial, sans-serif",
}
html_sidebars = {"**": ["about.html", "searchbox.html", "navigation.html"]}
html_static_path = ["static"]
html_css_files = ["pygments-dark.css", "colours.css"]
html_js_files = ["colours.js"]
html_copy_source = False
html_show_sourcelink = False
suppress_warnings = ["misc.highlighting_failure"]


def setup(app: Any) -> None:
    """Code in colours for the dark, beside sphinx's own for the light (static/colours.js says which)."""
    app.connect("build-finished", _write_dark)


def _write_dark(app: Any, error: Exception | None) -> None:
    from pygments.formatters import HtmlFormatter  # type: ignore[import-untyped]

    if error is None:
        rules = HtmlFormatter(style="github-dark").get_style_defs(':root[data-colours="dark"] .highlight')
        Path(app.outdir, "_static", "pygments-dark.css").write_text(rules, encoding="utf-8")
