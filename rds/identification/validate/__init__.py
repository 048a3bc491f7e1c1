"""Whether a model holds on data that it has not seen: errors, tests of the residuals, and a verdict with reasons."""
