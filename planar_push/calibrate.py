"""Measure a robot's marker offset and bumper, and an object's frictions, by a turn and pushes."""

import argparse
import sys
from pathlib import Path

from planar_push.arguments import add_namespace, whole
from push_bringup.failures import DomainInUse
from push_bringup.systems import check_namespace
from push_model.settings import SettingsError


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options of this verb."""
    parser.add_argument("--scenario", required=True, help="the scenario of the lab, a file")
    parser.add_argument("--robot", default="", help="which robot; default: the first")
    parser.add_argument("--object", default="", help="which object; default: the first")
    parser.add_argument("--out", default="calibration.yaml", help="file to be written")
    parser.add_argument(
        "--straight", type=whole(3), default=8, help="pushes that end at once; each takes 8 cm"
    )
    parser.add_argument(
        "--curves", type=whole(4), default=6, help="pushes in curves; each takes 13 cm"
    )
    add_namespace(parser)


def run(arguments: argparse.Namespace) -> int:
    """0 if everything was found; 1 if something is missing, which the file names."""
    import os

    import numpy as np

    from lab_bridge.calibration_rig import LabRig, RigFailed
    from lab_bridge.observation import Observer
    from push_estimation.calibration_file import contents, write
    from push_estimation.calibration_runs import Plan, Runs
    from push_estimation.intervals import TooLittle
    from push_model.bumpers import FlatBumper
    from push_ros.claims import OCCUPIED, claim_world
    from push_ros.latched import visitor
    from push_ros.names import space
    from push_scenario.scenario import load_scenario

    check_namespace(arguments.namespace)
    scenario = load_scenario(arguments.scenario)
    if scenario.lab is None or scenario.on != "lab":
        raise SettingsError(f"scenario '{scenario.name}' is not for a lab ('on: lab')")
    robot, spec = scenario.robot(arguments.robot)
    item, kind = scenario.object(arguments.object)
    if spec.kinematics is None:
        raise SettingsError(f"'{robot}' has no wheels; only robots with two wheels are calibrated")
    out = Path(arguments.out)
    if not out.absolute().parent.is_dir():
        raise SettingsError(f"{out}: there is no folder {out.absolute().parent}")
    claim = claim_world(os.environ.get("ROS_DOMAIN_ID") or "0", space(arguments.namespace))
    if claim is None:
        raise DomainInUse(OCCUPIED)
    half = spec.bumper.width / 2.0 if isinstance(spec.bumper, FlatBumper) else 0.0
    plan = Plan(
        spec.push_distance,
        half,
        kind.contact_friction,
        kind.outline,
        com=np.array(kind.com, dtype=np.float64),
        straight=arguments.straight,
        curves=arguments.curves,
        speed=min(0.11, 0.85 * spec.max_speed),
    )
    with claim, visitor() as (node, spinner):
        observer = Observer(node, spinner, scenario)
        try:
            observer.connect([robot])
            observer.watch(5.0)
            rig = LabRig(observer, robot, item)
            troubles = observer.link_troubles()
            if troubles[robot]:
                raise RigFailed(f"{robot}: {troubles[robot]}")
            found = Runs(rig, plan, lambda text: print(text, flush=True)).everything()
        except (RigFailed, TooLittle) as error:
            print(f"error: {error}; planar-push doctor may tell more", file=sys.stderr)
            return 1
        finally:
            observer.close()
    written = contents(found, robot, item, scenario.lab.offset(robot))
    write(out, written)
    for name, value in {**written["values"], **written["robots"][robot]}.items():
        print(f"{name}: {value}")
    for trouble in found.troubles:
        print(f"not found: {trouble}", file=sys.stderr)
    print(f"written to {out}")
    return 1 if found.troubles else 0
