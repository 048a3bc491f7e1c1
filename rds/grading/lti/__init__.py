"""LTI 1.3: a learning platform opens the hand-in page of an assignment, and gets the points back."""
