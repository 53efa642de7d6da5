"""The world that stands in for robots and motion capture: PyBullet, pose stream, bridge node."""
