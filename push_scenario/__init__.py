"""Scenario and map files: what is in the world, where it starts, what shall happen. No ROS here."""
