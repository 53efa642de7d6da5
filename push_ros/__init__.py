"""What nodes share: names, QoS, validation, conversion, parameters, diagnostics, actions, poses,
goals, start and stop."""
