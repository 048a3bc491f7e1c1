"""What panels are made of: fields that refuse beside themselves, progress with a stop button, notices, pictures."""
