"""A planar world: rigid bodies with Coulomb contacts, compiled."""

from push_model import kernel_cache as kernel_cache  # before any file with kernels
