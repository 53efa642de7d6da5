"""The bridge to a lab: poses of a real motion capture in, commands to real robots out."""
