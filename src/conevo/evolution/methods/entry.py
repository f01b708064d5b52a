"""Registry entries: the facts about a method that are known without loading it."""

from __future__ import annotations

import importlib
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, cast

if TYPE_CHECKING:
    from conevo.evolution.protocol import Method

__all__ = ["MethodEntry"]


@dataclass(frozen=True)
class MethodEntry:
    """One method in the registry.

    ``module`` contains the classes named ``config_name`` (parameters) and ``method_name`` (built
    from parameters, name and title). An entry in a file outside the package leaves it out;
    ``methods.outside`` fills it in, with the file's path, ``files`` (this one first, then the files
    next to it that it imports) and the digest of their texts.

    Attributes:
        name: its name in commands and files.
        title: its name as published.
        summary: a description in one line.
        source: the publication that describes it.
        controllers: the controllers whose genotypes it breeds, its default first; empty for a
            method that breeds those of any controller.
    """

    name: str
    title: str
    summary: str
    source: str
    config_name: str
    method_name: str
    controllers: tuple[str, ...] = ()
    module: str = ""
    file: str = ""
    files: tuple[str, ...] = ()
    digest: str = ""

    @property
    def address(self) -> str:
        """The address that ``resolve`` accepts: its name, or "FILE.py:NAME"."""
        return f"{self.file}:{self.name}" if self.file else self.name

    @property
    def family(self) -> str:
        """The family of the method: "cone" for CONE and its variants, else usually its own name."""
        return self.module.rpartition(".")[2].replace("_", "-") if self.module else self.name

    @property
    def config_class(self) -> type[Any]:
        """The dataclass of its parameters; it refuses values outside their bounds."""
        from conevo.parameters import checked

        return checked(getattr(importlib.import_module(self.module), self.config_name), "method")

    def build(self, config: Any) -> Method:
        """Return the method with the given parameters, an instance of ``config_class``."""
        make = getattr(importlib.import_module(self.module), self.method_name)
        return cast("Method", make(config=config, name=self.name, title=self.title))
