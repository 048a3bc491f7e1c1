"""Words and promises: types, contracts, errors. Imports nothing of the rest of rds."""
