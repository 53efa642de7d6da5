"""For colcon, which builds ament_python packages by this file; all is said in pyproject.toml."""

from typing import Any

from setuptools import Distribution, setup


class PlainDistribution(Distribution):
    """Keeps the Python versions as text: colcon reads the set-up as literals, and the object that
    setuptools makes of ``requires-python`` is none."""

    def parse_config_files(self, *args: Any, **kwargs: Any) -> None:
        """As setuptools does."""
        super().parse_config_files(*args, **kwargs)
        for owner in (self, self.metadata):
            if getattr(owner, "python_requires", None):
                owner.python_requires = str(owner.python_requires)


setup(distclass=PlainDistribution)
