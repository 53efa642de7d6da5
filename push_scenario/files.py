"""Find scenario files by name or path, and read them."""

import importlib.util
import os
from pathlib import Path
from typing import Any

import yaml

from push_model.settings import SettingsError
from push_model.unique_keys import UniqueKeysLoader

_Dumper: Any = getattr(yaml, "CSafeDumper", yaml.SafeDumper)


def config_directory() -> Path:
    """Folder of the files in config/; PLANAR_PUSH_CONFIG names another one."""
    override = os.environ.get("PLANAR_PUSH_CONFIG")
    if override:
        return Path(override)
    beside = Path(__file__).resolve().parent.parent / "config"
    if beside.is_dir():
        return beside
    spec = importlib.util.find_spec("push_config")
    if spec is not None and spec.submodule_search_locations:
        return Path(next(iter(spec.submodule_search_locations)))
    raise SettingsError("no config folder found; set PLANAR_PUSH_CONFIG")


def parse_yaml(text: str, where: str) -> Any:
    """The contents of YAML text; errors name where it is from."""
    try:
        return yaml.load(text, Loader=UniqueKeysLoader)  # a safe one
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise SettingsError(f"{where}: not valid YAML: {error}") from None


def dump_yaml(values: Any) -> str:
    """YAML text of plain values; repeated values become references."""
    return str(yaml.dump(values, Dumper=_Dumper, sort_keys=False))


def read_yaml(path: Path) -> Any:
    """The contents of a YAML file; errors name the file."""
    try:
        return parse_yaml(path.read_text(encoding="utf-8"), str(path))
    except OSError as error:
        raise SettingsError(f"{path}: cannot be read: {error.strerror}") from None
    except UnicodeDecodeError as error:
        raise SettingsError(f"{path}: not valid YAML: {error}") from None


def find(kind: str, name: str) -> Path:
    """The file of a name in config/<kind>/, or the path that the name is."""
    path = Path(name)
    if path.suffix in (".yaml", ".yml"):
        return path
    candidate = config_directory() / kind / f"{name}.yaml"
    if not candidate.is_file():
        known = sorted(p.stem for p in candidate.parent.glob("*.yaml"))
        listed = ", ".join(known) or f"none, there is no file in {candidate.parent}"
        raise SettingsError(f"no {kind} called '{name}'; known: {listed}")
    return candidate


def read_named(
    kind: str, value: Any, where: str, folder: Path | None
) -> tuple[Any, str, Path | None]:
    """The contents that a value names or is, their source, and the folder that paths start from.

    Parameters
    ----------
    kind: a folder of config/. value: a name, a path relative to ``folder``, or the contents.
    """
    if not isinstance(value, str):
        return value, where, folder
    path = Path(value)
    if path.suffix not in (".yaml", ".yml"):
        try:
            path = find(kind, value)
        except SettingsError as error:
            raise SettingsError(f"{where}: {error}") from None
    elif not path.is_absolute() and folder is not None:
        path = folder / path
    return read_yaml(path), str(path), path.parent


def scenario_names() -> list[str]:
    """Names in config/scenarios."""
    return sorted(p.stem for p in (config_directory() / "scenarios").glob("*.yaml"))
