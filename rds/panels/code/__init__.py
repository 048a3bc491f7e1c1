"""Code in the page: a controller, model or interpolator written, checked while it is typed, and run; its versions."""
