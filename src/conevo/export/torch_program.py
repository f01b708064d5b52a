"""A PyTorch program of a team (``torch.export``), which PyTorch runs without the code here.

As for ONNX, the exact program adds one product after another, and the fast one has matrix products.
"""

from __future__ import annotations

import io
import json
from typing import Any

from conevo.errors import EnvironmentFailure
from conevo.export.arithmetic import DENOMINATOR, NUMERATOR, OPERATORS, sigmoid_limit
from conevo.export.team import EvolvedTeam

__all__ = ["to_torch"]


class TorchTensors:
    """Computes with tensors.

    Args:
        torch: the package.
        weights: tensors by name.
        is_fast: whether results may be rounded otherwise.
    """

    def __init__(self, torch: Any, weights: dict[str, Any], is_fast: bool) -> None:
        self._torch, self._weights, self._is_fast = torch, weights, is_fast

    def weight(self, name: str) -> Any:
        """Return weights."""
        return self._weights[name]

    def number(self, value: float) -> float:
        """Return a number; arithmetic with a float32 tensor rounds it to float32."""
        return value

    def join(self, name: str, first: Any, second: Any) -> Any:
        """Return the columns of both."""
        return self._torch.cat([first, second], 1)

    def columns(self, name: str, values: Any, first: int, last: int) -> Any:
        """Return some columns."""
        return values[:, first:last].clone()

    def weighted(self, name: str, weights: str, values: Any, start: Any) -> Any:
        """Return the sum: one product after another, or one matrix product."""
        w = self._weights[weights]
        if self._is_fast:
            return start + self._torch.bmm(values[:, None], w)[:, 0]
        total = start
        for j in range(w.shape[1]):
            total = total + w[:, j] * values[:, j, None]
        return total

    def sigmoid(self, name: str, values: Any) -> Any:
        """Return the sigmoid."""
        if self._is_fast:
            return self._torch.sigmoid(values)
        h = self._torch.clamp(values * 0.5, -sigmoid_limit, sigmoid_limit)
        q = h * h
        return 0.5 + 0.5 * ((h * _polynomial(NUMERATOR, q)) / _polynomial(DENOMINATOR, q))

    def each(self, name: str, first: Any, sign: str, second: Any) -> Any:
        """Return the sum, difference, product or quotient."""
        return OPERATORS[sign](first, second)


def _polynomial(coefficients: tuple[float, ...], q: Any) -> Any:
    total: Any = coefficients[-1]
    for coefficient in coefficients[-2::-1]:
        total = coefficient + q * total
    return total


def to_torch(team: EvolvedTeam, is_fast: bool = False) -> bytes:
    """Return the content of a ``.pt2`` file.

    Its extra file ``about.json`` contains the facts about the team.

    Args:
        team: to be exported.
        is_fast: matrix products, whose results differ in the last digits.

    Raises:
        EnvironmentFailure: torch is not installed.
    """
    try:
        import torch
    except ImportError as error:
        raise EnvironmentFailure(
            ".pt2 needs PyTorch, which is not installed: pip install torch"
        ) from error
    net = team.network

    class Module(torch.nn.Module):  # type: ignore[misc]
        def __init__(self) -> None:
            super().__init__()
            for name, values in net.weights.items():
                self.register_buffer(name, torch.from_numpy(values.copy()))

        def forward(self, observations: Any, context: Any) -> Any:
            ops = TorchTensors(torch, dict(self.named_buffers()), is_fast)
            outputs, after = net.equations(ops, observations, context)
            return outputs, after.clone() if after is context else after

    example = (torch.zeros(net.n_robots, net.n_inputs), torch.zeros(net.n_robots, net.n_context))
    program = torch.export.export(Module().eval(), example)
    facts = team.about | {"arithmetic": "fast" if is_fast else "exact"}
    file = io.BytesIO()
    torch.export.save(program, file, extra_files={"about.json": json.dumps(facts)})
    return file.getvalue()
