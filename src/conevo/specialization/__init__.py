"""Specialization: how a robot divides its work among actions, and what that makes of the team."""

from conevo.specialization.activity import shares
from conevo.specialization.individual import castes, degree, label

__all__ = ["castes", "degree", "label", "shares"]
