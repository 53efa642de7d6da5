"""The problems that the first version of the planner solved (commit 6040054), frozen.

Numbers of ``benchmarks.plan_problems.problems_of(kind, box, count, SEED)``: 80 traps, 60 doors, 60
clutters. That version was run on the same maps, with its own files of robot and box, and had 100 s
for each problem. It solved none of 100 gaps. Trap 11 is left out, for its plan is not valid: it
passes an occupied cell at 10.6 mm instead of ``safety_distance``, 12 mm.
"""

SEED = 2
_TRAP = """
    0 1 2 3 4 5 7 8 10 12 13 14 15 16 17 18 20 22 23 26 27 29 30 31 32 33 34 35 37 38 39 40 41
    42 43 45 46 47 48 49 50 51 54 55 56 57 58 59 60 61 62 63 65 66 68 72 73 75 78
"""
_DOOR = """
    0 2 4 6 7 8 10 11 12 13 15 19 20 21 22 23 24 26 27 29 30 32 33 34 35 36 38 39 40 42 43 45
    47 48 49 50 51 52 53 55 56 57 59
"""
_CLUTTER = """
    0 1 2 4 6 9 10 11 14 16 17 18 19 21 23 25 27 29 30 31 32 33 34 35 36 37 38 39 40 42 45 48
    49 50 51 52 53 54 55 56 58 59
"""
SOLVED = {
    kind: tuple(map(int, numbers.split()))
    for kind, numbers in (("trap", _TRAP), ("door", _DOOR), ("clutter", _CLUTTER))
}
