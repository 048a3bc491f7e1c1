"""From drawings to part programs: pockets, contours with tabs, holes, faces and engravings, tool by tool."""
