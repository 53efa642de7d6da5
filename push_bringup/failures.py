"""Reasons why a suite does not run."""


class DomainInUse(Exception):
    """Another bridge already runs in the same domain and namespace."""


class SuiteFailed(Exception):
    """The nodes did not come up, or one of them died."""
