"""The settings in which other authors measured their methods."""
