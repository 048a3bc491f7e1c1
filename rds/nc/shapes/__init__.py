"""Drawings as curves on layers: SVG and DXF files, text, and the centre lines of filled shapes."""
