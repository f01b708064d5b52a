"""Specialization: how robots divide their work among actions, and the measures of a team."""

from conevo.specialization.activity import shares
from conevo.specialization.individual import castes, degree, label

__all__ = ["castes", "degree", "label", "shares"]
