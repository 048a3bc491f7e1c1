"""nbgrader for a course whose submissions rds grades: what is handed in is any file, and no notebook is run."""

c = get_config()  # noqa: F821  (nbgrader provides it)

c.CourseDirectory.course_id = "axis-control"
c.CourseDirectory.submitted_directory = "submitted"  # <student>/<assignment>/, which `rds grade run` reads
