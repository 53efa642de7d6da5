"""Figures printed in the thesis, beside which ours are shown."""

TABLE_2_1 = {  # Table 2.1: mean and worst position [m] and orientation [rad] error
    "env1-target1": (0.0130, 0.0200, 0.0456, 0.0622),
    "env1-target2": (0.0269, 0.0585, 0.0698, 0.0985),
    "env1-target3": (0.0114, 0.0292, 0.0365, 0.0476),
}
