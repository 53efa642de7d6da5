"""A few robots push one object (chapter 3): where, with which forces, and how well. No ROS."""

from push_model import kernel_cache as kernel_cache  # before any file with kernels
