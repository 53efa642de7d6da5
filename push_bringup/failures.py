"""Why a suite does not run."""


class DomainInUse(Exception):
    """Another bridge runs where this one was to."""


class SuiteFailed(Exception):
    """The nodes did not come up, or one of them died."""
