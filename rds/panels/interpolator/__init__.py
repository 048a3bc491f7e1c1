"""The interpolator panel: a path, the methods that take it, and the samples that come out."""
