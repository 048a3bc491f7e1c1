"""What delay does to control: delay models, links that delay and lose messages, their cost, margins, and clocks."""

from rds.core.face import face

__getattr__, __dir__ = face(
    __name__,
    {
        "circle_error": "clocks",
        "synchronized": "clocks",
    },
)
