"""What a panel says: HTML whose hidden label has no title.

ipywidgets gives the label of a widget without a tooltip the title "null".
"""

from __future__ import annotations

import ipywidgets as widgets
import traitlets


class Html(widgets.HTML):
    """As `ipywidgets.HTML`."""

    tooltip = traitlets.Unicode("", allow_none=True).tag(sync=True)
