"""``python -m planar_push``."""

from planar_push.main import command

command()
