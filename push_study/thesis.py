"""Figures printed in the thesis, beside which ours are shown."""

TABLE_2_1 = {  # Table 2.1: mean and worst position [m] and orientation [rad] error
    "env1-target1": (0.0130, 0.0200, 0.0456, 0.0622),
    "env1-target2": (0.0269, 0.0585, 0.0698, 0.0985),
    "env1-target3": (0.0114, 0.0292, 0.0365, 0.0476),
    "env2-target1": (0.0216, 0.0268, 0.0120, 0.0284),
    "env2-target2": (0.0313, 0.0333, 0.0090, 0.0126),
    "env2-target3": (0.0195, 0.0246, 0.0099, 0.0168),
    "env3-target1": (0.0045, 0.0065, 0.0261, 0.0402),
    "env3-target2": (0.0193, 0.0254, 0.0461, 0.0566),
    "env3-target3": (0.0092, 0.0150, 0.0117, 0.0314),
}

SWARM_REAL = {"time": 902.0, "std": 17.0, "delta": 50.4, "lambda": 16.3}
"""Section 4.3.2: [s], [s], [s] a length of the object; lambda of 7.15 m at 0.129 m/s."""

SWARM_RIVALS = {"one global input [1]": (111.2, 5.6), "Gibbs random field": (81.8, 12.0)}
"""delta [s] and lambda: Shahrokhi et al. 2018 on kilobots of 1 cm/s, as the thesis reckons it;
Rezeck et al., twenty robots of 6 cm/s."""
