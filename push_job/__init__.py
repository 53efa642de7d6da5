"""What a job is, whoever does it: the task, what is seen, the method, what it tells. No ROS."""
