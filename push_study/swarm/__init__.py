"""Studies of swarms by subject: targets in a row, maps with walls, rivals, figures."""
