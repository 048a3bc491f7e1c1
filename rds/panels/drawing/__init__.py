"""The drawing panel: cells or a picture, to an outline, to a part program."""
