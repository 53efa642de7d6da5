"""GCo, a learned method for groups, beside our group in the simulator of its authors.

Its program needs PyTorch and another MuJoCo than ours, so it runs in a process and an environment
of its own (``make gco``).
"""
