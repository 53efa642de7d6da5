"""Area clearing, a task of Bench-Push: a wide robot pushes ten boxes out of an area.

The package ``benchnpin`` asks for versions that ours exclude, so its rooms run in a process and an
environment of their own (``make benchpush``).
"""
