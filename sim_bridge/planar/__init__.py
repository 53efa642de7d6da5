"""A planar world: rigid bodies with Coulomb contacts, compiled."""
