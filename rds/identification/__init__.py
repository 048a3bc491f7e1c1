"""Model structures, and their parameters from logs: estimates with their uncertainty, model files, designs."""

from rds.core.face import face

__getattr__, __dir__ = face(
    __name__,
    {
        "bode_picture": "fit.frequency_plot",
        "distributions": "robustness.plots",
        "linear_axis_of": "fit.design",
        "linear_axis_of_machine": "fit.design",
        "relay_gains": "robustness.relay",
        "sentences": "robustness.summary",
        "tracking_design": "robustness.tracking_design",
        "tracking_system": "fit.design",
    },
)
