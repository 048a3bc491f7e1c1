"""Sphinx's settings for the help pages. They fetch nothing: no fonts, no scripts from elsewhere."""

project = "RDS"
author = "the RDS authors"
copyright = "MIT licence"
extensions = ["myst_parser"]

myst_heading_anchors = 4
html_theme = "furo"
html_title = "RDS"
_FONTS = {"font-stack": "system-ui, 'DejaVu Sans', Arial, sans-serif"}
html_theme_options = {
    "light_css_variables": _FONTS,
    # as the panels have theirs
    "dark_css_variables": {
        "color-background-primary": "#14181d",
        "color-background-secondary": "#1e242b",
        "color-background-border": "#3d4650",
        "color-foreground-primary": "#e8edf2",
        "color-foreground-secondary": "#a9b4bf",
        "color-brand-primary": "#4db4ec",
        "color-brand-content": "#4db4ec",
    },
}
pygments_dark_style = "github-dark"
html_static_path = ["static"]
html_css_files = ["pictures.css"]
html_js_files = ["colours.js"]
html_copy_source = False
html_show_sourcelink = False
suppress_warnings = ["misc.highlighting_failure"]
