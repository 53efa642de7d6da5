"""A few robots push one object (chapter 3): where, with which forces, and how well. No ROS."""
