"""What nodes share: QoS, validation, conversion, parameters, diagnostics, actions, start and stop.

Only ``scenario`` and ``pose_tracker`` may be imported without ROS.
"""
