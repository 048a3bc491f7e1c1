"""The jog panel: axes moved by hand."""
