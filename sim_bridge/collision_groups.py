"""Bullet collision filter groups: bodies stand on feet and wheels, only these touch the floor."""

FLOOR_GROUP, BODY_GROUP = 2, 1
