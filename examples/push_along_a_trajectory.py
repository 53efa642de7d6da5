"""Have a group push its object along the trajectory of its scenario.

``push_along_a_trajectory.py [TEAM [NAMESPACE]]`` runs beside
``planar-push launch group --scenario group-trajectory``. Between the poses of the scenario, the
object follows a spline that begins and ends at rest.
"""

import sys

import numpy as np
from rclpy.action import ActionClient
from scipy.interpolate import CubicSpline

from push_bringup.systems import team_space, teams_of
from push_msgs.action import PushAlong
from push_record.recorder import heard_scenario
from push_ros.latched import visitor
from push_ros.names import Names, space

STEP = 0.1  # [s] between samples


def main(name: str = "", namespace: str = "") -> bool:
    """Whether the object was pushed along the trajectory to its end."""
    teams = {team.name: team for team in teams_of(heard_scenario(namespace))}
    team = teams.get(name)
    if team is None or not team.trajectory:
        print(f"no trajectory of a team '{name}'; the teams: {', '.join(teams)}")
        return False
    times = [point.at - team.trajectory[0].at for point in team.trajectory]
    poses = np.array([point.pose for point in team.trajectory])
    poses[:, 2] = np.unwrap(poses[:, 2])
    time = np.append(np.arange(0.0, times[-1], STEP), times[-1])
    x, y, theta = CubicSpline(times, poses, bc_type="clamped")(time).T
    goal = PushAlong.Goal(time=list(time), x=list(x), y=list(y), theta=list(theta))
    with visitor() as (node, spinner):
        topic = Names("/", space(team_space(namespace, name))).team("push_along")
        client = ActionClient(node, PushAlong, topic)
        if not spinner.until(client.server_is_ready, 20.0):
            print(f"no node serves {topic}; is the system 'group' running?")
            return False
        sent = client.send_goal_async(goal)
        spinner.until(sent.done, 10.0)
        answer = sent.result().get_result_async()
        spinner.until(answer.done, 10.0 * times[-1] + 60.0)
        result = answer.result().result
    away = f"{1e3 * result.position_error:.1f} mm, {result.orientation_error:.3f} rad"
    print(f"{result.error_code}: {result.error_msg or 'at its end'}, {away} from its end")
    return bool(result.error_code == 0)


if __name__ == "__main__":
    sys.exit(not main(*sys.argv[1:]))
