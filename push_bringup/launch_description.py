"""What ``ros2 launch planar_push SYSTEM.launch.py`` starts: what ``planar-push launch`` starts.

The package ``launch`` is part of a ROS installation, not of the wheels. Only ``describe`` needs it.
"""

import atexit
import shutil
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from push_bringup.preparation import check_domain, prepare
from push_bringup.systems import system_of
from push_model.settings import SettingsError
from push_ros.process import prepare_environment
from push_ros.start import command_of


@dataclass(frozen=True)
class Argument:
    """An argument of a launch file, with its default and what it is for."""

    name: str
    default: str
    text: str


@dataclass(frozen=True)
class Process:
    """A node in a process of its own. environment: what is set in addition to the caller's.
    restartable: whether its command can be run again; a recorder's cannot, its folder exists."""

    name: str
    command: list[str]
    environment: dict[str, str]
    restartable: bool


def arguments_of(system: str) -> tuple[Argument, ...]:
    """Arguments of the launch file of a system; a file for any system takes its name too."""
    example = system_of(system).example if system else ""
    own = () if system else (Argument("system", "single", "System, or MODULE:ATTRIBUTE"),)
    default = f"; default: {example}" if example else "; default: the example of the system"
    return (
        *own,
        Argument("scenario", example, f"Name in config/scenarios, or a file{default}"),
        Argument("namespace", "", "Namespace of the whole suite"),
        Argument("record", "", "Folder of the bag to record"),
        Argument("factor", "", "Pace of the simulation, simulated over wall time"),
        Argument("respawn", "false", "Whether a dead node is started again; not the recorder"),
    )


def processes_of(values: Mapping[str, str], folder: Path) -> list[Process]:
    """The processes of a system, after all checks of ``planar-push launch``.

    Parameters
    ----------
    values: of the arguments, with ``system``. folder: for the resolved scenario.

    Raises
    ------
    SettingsError, FileExistsError, DomainInUse: nothing has been started.
    """
    system = values["system"]
    try:
        factor = float(values["factor"]) if values.get("factor") else None
    except ValueError:
        raise SettingsError(f"factor: expected a number, got '{values['factor']}'") from None
    setup = prepare(
        values.get("scenario") or system_of(system).example,
        system=system,
        namespace=values.get("namespace", ""),
        record=values.get("record", ""),
        factor=factor,
    )
    check_domain(setup.namespace)
    environment = prepare_environment({})
    return [
        Process(child.name, command_of(child.module, child.words), environment, child.bag is None)
        for child in setup.write(folder)
    ]


def describe(system: str = "") -> Any:
    """The LaunchDescription of a system; of the one that the argument ``system`` names if empty."""
    from launch.actions import DeclareLaunchArgument, OpaqueFunction

    from launch import LaunchDescription

    found = [
        DeclareLaunchArgument(a.name, default_value=a.default, description=a.text)
        for a in arguments_of(system)
    ]
    return LaunchDescription([*found, OpaqueFunction(function=_start, args=[system])])


def _start(context: Any, system: str) -> list[Any]:
    from launch.actions import ExecuteProcess, Shutdown

    values = {a.name: context.launch_configurations[a.name] for a in arguments_of(system)}
    values.setdefault("system", system)
    respawn = values["respawn"].lower() in ("true", "1", "yes")
    folder = Path(tempfile.mkdtemp("-planar-push"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    actions = []
    for process in processes_of(values, folder):
        ended = None if respawn else Shutdown(reason=f"{process.name} has ended")
        actions.append(
            ExecuteProcess(
                cmd=process.command,
                name=process.name.replace("/", "_"),
                additional_env={
                    k: v for k, v in process.environment.items() if k not in context.environment
                },
                output="screen",
                respawn=respawn and process.restartable,
                respawn_delay=1.0,
                on_exit=ended,
            )
        )
    return actions
