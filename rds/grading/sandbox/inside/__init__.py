"""What runs inside the sandbox: a warm interpreter, the walls around each submission, and the submission's own loop.

Nothing here knows of an assignment, a plant or an answer. It imports the standard library and the few rooms that are
visible inside (`bubblewrap.ROOMS`).
"""
