"""Swarm pushing, chapter 4: coverage of a moving density drives an object. Cores know no ROS."""
