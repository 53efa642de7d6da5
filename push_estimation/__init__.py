"""From measurements to what may be acted on. No ROS here."""
