"""The design panel: poles of the tracking controller, and what follows from them."""
