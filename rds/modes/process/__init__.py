"""The processes of a run: the target with its loop, the recorder, the host that watches; timing and its verdict."""
