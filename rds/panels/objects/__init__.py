"""The panel of objects: lines, quadrilaterals, arcs, cones and points by their numbers, to a part program."""
