"""A C header of a team, for microcontrollers: one struct, one function, float32, no libraries.

Its results are those of the kernels, bit for bit, if the compiler does not fuse a product and a sum
(``-ffp-contract=off``; GCC fuses by default where the processor can) and does not reorder sums
(``-ffast-math``, which the header refuses).
"""

from __future__ import annotations

import json
import re
from typing import Any, NamedTuple

import numpy as np

from conevo.export.arithmetic import DENOMINATOR, NUMERATOR, sigmoid_limit
from conevo.export.c_template import TEMPLATE
from conevo.export.team import EvolvedTeam

__all__ = ["to_c"]


class CValue(NamedTuple):
    """Text of a pointer to columns, or of a number if there are none."""

    text: str
    columns: int

    @property
    def at_u(self) -> str:
        """The text of column u."""
        return f"{self.text}[u]" if self.columns else self.text


class CLines:
    """Writes a loop for each operation; names of weights have the shapes of these arrays."""

    def __init__(self, weights: dict[str, Any]) -> None:
        self._weights = weights
        self.lines: list[str] = []

    def loop(self, columns: int, text: str) -> None:
        """Write a loop over columns u."""
        self.lines.append(f"for (int u = 0; u < {columns}; u++) {text};")

    def _array(self, name: str, columns: int, text: str) -> CValue:
        self.lines.append(f"float {name}_[{columns}];")
        self.loop(columns, f"{name}_[u] = {text}")
        return CValue(f"{name}_", columns)

    def weight(self, name: str) -> CValue:
        """Return weights."""
        return CValue(f"NAME_{name}[r]", self._weights[name].shape[-1])

    def number(self, value: float) -> CValue:
        """Return a number."""
        return CValue(_literal(value), 0)

    def join(self, name: str, first: CValue, second: CValue) -> CValue:
        """Write the columns of both."""
        n, text = first.columns, f"u < {first.columns} ? {first.at_u} : {second.text}[u - {{}}]"
        return self._array(name, n + second.columns, text.format(n))

    def columns(self, name: str, values: CValue, first: int, last: int) -> CValue:
        """Return some columns."""
        return CValue(f"({values.text} + {first})" if first else values.text, last - first)

    def weighted(self, name: str, weights: str, values: CValue, start: CValue) -> CValue:
        """Write the sum."""
        _, n, columns = self._weights[weights].shape
        total = self._array(name, columns, start.at_u)
        self.lines.append(f"for (int j = 0; j < {n}; j++) {{")
        self.loop(columns, f"{total.at_u} += NAME_{weights}[r][j][u] * {values.text}[j]")
        self.lines.append("}")
        return total

    def sigmoid(self, name: str, values: CValue) -> CValue:
        """Write the sigmoid."""
        return self._array(name, values.columns, f"NAME_sigmoid({values.at_u})")

    def each(self, name: str, first: CValue, sign: str, second: CValue) -> CValue:
        """Write the sum, difference, product or quotient."""
        columns = max(first.columns, second.columns)
        return self._array(name, columns, f"{first.at_u} {sign} {second.at_u}")


def to_c(team: EvolvedTeam, stem: str) -> bytes:
    """Return the content of a ``.h`` file.

    Args:
        team: to be exported.
        stem: of the file's name, with which all names in the file begin.
    """
    net = team.network
    ops = CLines(net.weights)
    ops.lines.append("float *context = state->context[r];" if net.n_context else "(void)state;")
    context = CValue("context", net.n_context)
    outputs, after = net.equations(ops, CValue("observations", net.n_inputs), context)
    ops.loop(net.n_outputs, f"outputs[u] = {outputs.at_u}")
    if after is not context:
        ops.loop(net.n_context, f"context[u] = {after.at_u}")
    name = re.sub(r"\W", "_", stem, flags=re.ASCII)
    name = f"_{name}" if name[:1].isdigit() else name
    arrays = [
        f"static const float NAME_{key}{''.join(f'[{n}]' for n in values.shape)} =\n"
        f"{_nested(values)};"
        for key, values in net.weights.items()
    ]
    about = "\n".join(f"   {key}: {json.dumps(value)}" for key, value in team.about.items())
    text = TEMPLATE.replace("NAME", name).format(
        title=_commented(team.title),
        about=_commented(about),
        r=net.n_robots,
        s=net.n_inputs,
        o=net.n_outputs,
        room=max(net.n_context, 1),
        weights="\n".join(arrays).replace("NAME", name),
        limit=_literal(sigmoid_limit),
        numerator=_polynomial(NUMERATOR),
        denominator=_polynomial(DENOMINATOR),
        lines="\n".join(f"        {line}" for line in ops.lines).replace("NAME", name),
    )
    return text.encode()


def _commented(text: str) -> str:
    """Return a text that neither begins nor ends a comment."""
    return text.replace("*/", "* /").replace("/*", "/ *")


def _literal(value: float) -> str:
    """Return the shortest decimal that a compiler reads as this float32."""
    return f"{np.float32(value)!s}f"


def _nested(values: Any) -> str:
    if values.ndim == 1:
        return "{" + ", ".join(map(_literal, values)) + "}"
    return "{" + ",\n".join(map(_nested, values)) + "}"


def _polynomial(coefficients: tuple[float, ...]) -> str:
    first, *rest = map(_literal, coefficients)
    return first if not rest else f"{first} + q * ({_polynomial(coefficients[1:])})"
