"""Controllers: from genotypes (numbers) to networks (behaviour)."""

from conevo.controllers.spec import ControllerSpec

__all__ = ["ControllerSpec"]
