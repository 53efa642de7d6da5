"""The world that stands in for real robots and motion capture: PyBullet, pose stream, bridge node."""
