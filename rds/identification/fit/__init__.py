"""Parameters from logs: the methods, how far their estimates can be trusted, and the model files that come of them."""
