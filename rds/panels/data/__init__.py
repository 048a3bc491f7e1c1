"""The data panel: logged data described, a model fitted to them, and validated on others."""
