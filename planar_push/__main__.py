"""``python -m planar_push``."""

from planar_push.entry import command

command()
