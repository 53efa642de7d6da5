"""The protocol between predictive controllers and the tracker."""

from dataclasses import dataclass
from typing import Protocol

from push_model.arrays import Array
from push_model.kinematics import DifferentialDrive
from push_model.stable_push import CurvatureLimits
from push_mpc.line_contact import LineContact


@dataclass(frozen=True)
class Held:
    """A reference for commands that are held until the next one, which is sooner than a step of the
    horizon.

    last: [m/s], [rad/s] mean of v_d and omega_d since the last command. acceleration: [m/s^2],
    [rad/s^2] from there to the mean until the next one.
    """

    last: tuple[float, float]
    acceleration: tuple[float, float]


@dataclass(frozen=True)
class Reference:
    """The reference over the horizon.

    pose: ``(p + 1, 3)`` world frame; twist: ``(p + 1, 3)`` v_d, w_d, omega_d of that frame, in it.
    held: v_d and omega_d about now, as commands can follow them; None: as in the first step.
    """

    pose: Array
    twist: Array
    held: Held | None = None


@dataclass(frozen=True)
class Contact:
    """The present contact of object and bumper.

    limits: stable curvatures. line: where the forces act; None if unknown.
    """

    limits: CurvatureLimits
    line: LineContact | None = None


@dataclass(frozen=True)
class MpcResult:
    """acceleration: (a, epsilon) to apply now; solve_time [s] CPU.

    slack: greatest violation of a soft constraint as a fraction of what is allowed.
    solved is False if the acceleration must not be used; reason says why. late: the only reason
    is that the solution came after its deadline.
    """

    acceleration: tuple[float, float]
    solved: bool
    slack: float
    solve_time: float
    reason: str
    late: bool = False


class PredictiveController(Protocol):
    """Finds accelerations of one robot; may remember its last solution."""

    @property
    def drive(self) -> DifferentialDrive:
        """Kinematics of the robot."""
        ...

    @property
    def horizon(self) -> int:
        """p, number of predicted steps."""
        ...

    @property
    def step(self) -> float:
        """[s] length of a predicted step."""
        ...

    @property
    def max_obstacles(self) -> int:
        """Greatest number of circles that it takes."""
        ...

    def solve(
        self, error: Array, reference: Reference, contact: Contact | None, circles: Array
    ) -> MpcResult:
        """One step.

        Parameters
        ----------
        error: ``(5,)`` of (2.37): e_x, e_y, e_theta, e_v, e_omega.
        reference: over the horizon, first sample now.
        contact: in a push; None when the robot moves alone.
        circles: ``(m, 3)`` x, y, least distance of the axle midpoint; m <= max_obstacles.
        """
        ...

    def warm_up(self) -> None:
        """Compile and solve once, so that the first command does not wait."""
        ...

    def reset(self) -> None:
        """Forget the previous solution."""
        ...
