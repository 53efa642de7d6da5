"""For colcon, which builds ament_python packages by this file; all is said in pyproject.toml."""

from setuptools import setup

setup()
