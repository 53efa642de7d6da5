"""Scenario and map files: bodies, start poses, goals and events. No ROS here."""
