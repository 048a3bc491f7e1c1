"""The documentation as pages to read offline and to search, built from `docs/` with sphinx."""
