"""ReloPush (Ahn and Mavrogiannis, arXiv 2409.18231): its scenes, instances and planner.

The planner is the program of its authors, compiled as it is (``make relopush``). Only ROS 1 is
replaced, to which it publishes markers and its path: ``ros1.h``.
"""
