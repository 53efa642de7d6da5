"""The predictive controllers by name: one file each, and a line here. Others: MODULE:ATTRIBUTE."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from push_model.kinematics import DifferentialDrive
from push_model.outside import from_outside
from push_model.settings import SettingsError
from push_mpc.contact_force_mpc import ContactForceMpc
from push_mpc.controller import PredictiveController
from push_mpc.ltv_mpc import LtvMpc
from push_mpc.settings import ContactForceSettings, MpcSettings


@dataclass(frozen=True)
class ControllerKind:
    """settings: the dataclass that configures it; make: from such settings and a drive."""

    settings: type[Any]
    make: Callable[[Any, DifferentialDrive], PredictiveController]


CONTROLLERS: dict[str, ControllerKind] = {
    "ltv": ControllerKind(MpcSettings, LtvMpc),
    "contact_force": ControllerKind(ContactForceSettings, ContactForceMpc),
}


def controller_kind(name: str) -> ControllerKind:
    """The controller of this name, or the one that ``MODULE:ATTRIBUTE`` names.

    Raises
    ------
    SettingsError: no such controller.
    """
    if ":" in name:
        found = from_outside(name, "controller")
        if not isinstance(found, ControllerKind):
            raise SettingsError(f"controller: '{name}' is {found!r}, which is no ControllerKind")
        return found
    if name not in CONTROLLERS:
        raise SettingsError(
            f"unknown controller '{name}'; expected one of: {', '.join(sorted(CONTROLLERS))}, "
            "or MODULE:ATTRIBUTE"
        )
    return CONTROLLERS[name]
