"""interpolators."""
