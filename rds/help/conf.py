"""Sphinx's settings for the help pages. They fetch nothing: no fonts, no scripts from elsewhere."""

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
html_copy_source = False
html_show_sourcelink = False
suppress_warnings = ["misc.highlighting_failure"]
