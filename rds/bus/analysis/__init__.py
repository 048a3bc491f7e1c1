"""What a bus will do before it runs: message tables, load, and worst-case response times."""
