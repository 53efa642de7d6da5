"""Studies: whole runs in one process, seeded trials, summaries."""
