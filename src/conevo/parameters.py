"""Parameters: dataclasses that check their values whenever one is made.

A parameter is one field with its type, its bounds and its default. The text below it states its
unit and meaning, as in "(side) the largest step."::

    @parameters("world")
    class LightParams:
        step: Annotated[float, Gt(0), Le(0.1)] = 0.01

``LightParams(step=1)``, ``conevo.world("light/dark-1", step=1)``, ``--set world.step=1``, and a
configuration or plan with ``step = 1`` are refused in the same words.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import fields
from functools import cache
from typing import Any, TypeVar, cast, dataclass_transform

from pydantic import ConfigDict, ValidationError
from pydantic.dataclasses import dataclass, is_pydantic_dataclass

from conevo.errors import UsageError, shown, unknown_name

__all__ = [
    "WrongValue",
    "checked",
    "parameters",
    "refuse_ineffective",
    "refuse_unknown",
    "wrong_values",
]

Part = TypeVar("Part")
LEAST, MOST = 1e-18, 1e18  # sizes of numbers whose squares fit into the 32 bits of a kernel
CONFIG = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False, validate_default=True)


class WrongValue(UsageError):
    """A parameter has a value that it does not allow.

    Attributes:
        key: the parameter's name, empty if the error concerns several values together.
    """

    def __init__(self, key: str, what: str, problem: str) -> None:
        super().__init__(f"{what}: {problem}")
        self.key, self._what, self._problem = key, what, problem

    def at(self, place: str) -> UsageError:
        """Return the error with the place of the value, "on the command line"."""
        return UsageError(f"{self._what} {place}: {self._problem}")


@dataclass_transform(frozen_default=True, kw_only_default=True)
def parameters(section: str) -> Callable[[type[Part]], type[Part]]:
    """Make a class a frozen dataclass that allows only the values that its fields allow.

    Types are strict (but integers are accepted as floats). Numbers are finite, and 0 or of a size
    that a kernel can square. ``UsageError`` names the first unknown key or wrong value.

    Args:
        section: table of a configuration with the fields as keys, "world".
    """

    def decorate(part: type[Part]) -> type[Part]:
        made: Any = dataclass(part, frozen=True, kw_only=True, config=CONFIG)
        return cast("type[Part]", _refusing(made, section))

    return decorate


@cache
def checked(part: type[Any], section: str) -> type[Any]:
    """Return a class of parameters; for a plain dataclass, a subclass that checks its values."""
    if is_pydantic_dataclass(part):
        return part
    config = ConfigDict(**CONFIG, arbitrary_types_allowed=True)
    frozen = part.__dataclass_params__.frozen
    if hasattr(part, "__pydantic_config__"):  # inherited: pydantic would change the class itself
        names = ("__module__", "__qualname__", "__doc__")
        part = type(part.__name__, (part,), {name: getattr(part, name) for name in names})
    return _refusing(dataclass(part, frozen=frozen, config=config), section)


def _refusing(part: type[Any], section: str) -> type[Any]:
    """Make a pydantic dataclass raise conevo's own errors."""
    validate = part.__init__

    def __init__(self: Any, **values: Any) -> None:
        for key in values:
            refuse_unknown(part, section, key)
        try:
            validate(self, **values)
        except ValidationError as error:
            raise wrong_values(error, section)[0] from error
        for key, value in values.items():
            if isinstance(value, float) and not (value == 0 or LEAST <= abs(value) <= MOST):
                problem = (
                    f"must be between {LEAST:g} and {MOST:g} in size (or 0, where it may be 0)"
                )
                raise WrongValue(key, f"{section}.{key} = {shown(value)}", problem)

    part.__init__ = __init__
    return part


def refuse_ineffective(config: Any, *keys: str, unless: str) -> None:
    """Raise WrongValue for the first of a method's ``keys`` that does not have its default.

    Args:
        config: the method's parameters.
        keys: parameters that have no effect here.
        unless: the condition under which they would have one.
    """
    for one in fields(config):
        value = getattr(config, one.name)
        if one.name in keys and value != one.default:
            what = f"method.{one.name} = {shown(value)}"
            raise WrongValue(one.name, what, f"has no effect without {unless}")


def refuse_unknown(
    part: type[Any], section: str, key: str, place: str = "", also: Sequence[str] = ()
) -> None:
    """Raise UsageError if a class of parameters has no ``key``; ``also`` names others like it."""
    known = [field.name for field in fields(part)]
    if key not in known:
        if section == "controller":
            known.append("name")  # the key that chooses the class
        names = [*(f"{section}.{one}" for one in known), *also]
        raise unknown_name("key", f"{section}.{key}", names, place)


def wrong_values(error: ValidationError, section: str) -> list[WrongValue]:
    """Return pydantic's findings as one error for each value."""
    found = []
    for one in error.errors(include_url=False):
        problem = one["msg"].replace("Input should be", "must be").removeprefix("Value error, ")
        if not one["loc"]:  # a check of the class itself
            found.append(WrongValue("", f"[{section}]", problem))
        elif one["type"] == "missing":
            key = str(one["loc"][0])
            found.append(WrongValue(key, f"{section}.{key}", "must be given, it has no default"))
        else:
            key = str(one["loc"][0])
            found.append(WrongValue(key, f"{section}.{key} = {shown(one['input'])}", problem))
    return found
