"""Colours that colour-blind people can tell apart (Okabe and Ito), for series and bodies."""

SERIES = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00", "#8a7a00", "#7f7f7f")
"""In this order; none of them is black, so that all can be read on a light and a dark ground."""

OBJECT, MANY = "#d55e00", "#0072b2"
"""Of objects, and of robots that are too many for a colour each."""

_ROBOTS = tuple(c for c in SERIES if c != OBJECT)


def robot_colours(names: tuple[str, ...]) -> dict[str, str]:
    """A colour for each robot; the same for all if there are more robots than colours."""
    if len(names) > len(_ROBOTS):
        return dict.fromkeys(names, MANY)
    return dict(zip(names, _ROBOTS, strict=False))
