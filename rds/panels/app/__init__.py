"""The panels as a web page of their own: a Voilà server on this machine, for this user."""
