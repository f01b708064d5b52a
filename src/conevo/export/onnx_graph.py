"""An ONNX graph of a team: one for all its robots, with the context as input and output.

The exact graph adds one product after another, like the kernels. The fast one has a matrix product
and ONNX's own sigmoid in their place: a few nodes, but other roundings. Opset 17 and IR version 9
can be read by every onnxruntime since 1.14.
"""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from conevo.errors import EnvironmentFailure
from conevo.export.arithmetic import DENOMINATOR, NUMERATOR, Floats, sigmoid_limit
from conevo.export.team import EvolvedTeam

__all__ = ["to_onnx"]

OPSET, IR_VERSION = 17, 9
KINDS_OF_NODES = {"+": "Add", "-": "Sub", "*": "Mul", "/": "Div"}


class OnnxNodes:
    """Adds a node for each operation; a value is the name of a node's output.

    Args:
        weights: of the network.
        columns: numbers of columns of the graph's inputs, by name.
        is_fast: whether results may be rounded otherwise.
    """

    def __init__(
        self, onnx: Any, weights: dict[str, Floats], columns: dict[str, int], is_fast: bool
    ) -> None:
        self._onnx, self._weights, self._is_fast = onnx, weights, is_fast
        self._n_columns = dict(columns)
        self._constants: dict[str, Any] = {}
        self._has_split: set[str] = set()
        self.nodes: list[Any] = []

    @property
    def constants(self) -> list[Any]:
        """The initializers of the graph: the constants that a node reads."""
        read = {name for node in self.nodes for name in node.input}
        return [
            self._onnx.numpy_helper.from_array(values, name)
            for name, values in self._constants.items()
            if name in read
        ]

    def _constant(self, name: str, values: Any) -> str:
        self._constants.setdefault(name, values)
        return name

    def _add(self, kind: str, name: str, *inputs: str, **attributes: Any) -> str:
        node = self._onnx.helper.make_node(kind, list(inputs), [name], name=name, **attributes)
        self.nodes.append(node)
        return name

    def _split(self, values: str) -> list[str]:
        """Return the columns of a value, each [R, 1]."""
        n = self._n_columns[values]
        names = [f"{values}_{j}" for j in range(n)]
        if values in self._has_split:
            return names
        self._has_split.add(values)
        ones = self._constant(f"ones_{n}", np.ones(n, np.int64))
        make = self._onnx.helper.make_node
        self.nodes.append(make("Split", [values, ones], names, axis=1, name=f"{values}_columns"))
        return names

    def weight(self, name: str) -> str:
        """Return weights."""
        return self._constant(name, self._weights[name])

    def number(self, value: float) -> str:
        """Return a number."""
        return self._constant(f"number_{np.float32(value)!s}", np.array(value, np.float32))

    def join(self, name: str, first: str, second: str) -> str:
        """Add the columns of both."""
        self._n_columns[name] = self._n_columns[first] + self._n_columns[second]
        return self._add("Concat", name, first, second, axis=1)

    def columns(self, name: str, values: str, first: int, last: int) -> str:
        """Add some columns."""
        self._n_columns[name] = last - first
        ends = [self._constant(f"at_{k}", np.array([k], np.int64)) for k in (first, last, 1)]
        return self._add("Slice", name, values, *ends[:2], ends[2])

    def weighted(self, name: str, weights: str, values: str, start: str) -> str:
        """Add the sum: one product after another, or one matrix product."""
        w = self._weights[weights]
        self._n_columns[name] = w.shape[2]
        if self._is_fast:
            axis = self._constant("at_1", np.array([1], np.int64))
            rows = self._add("Unsqueeze", f"{name}_rows", values, axis)
            product = self._add("MatMul", f"{name}_product", rows, self._constant(weights, w))
            total = self._add("Squeeze", f"{name}_total", product, axis)
            return self._add("Add", name, total, start)
        total = start
        if start in self._constants and not self._constants[start].ndim:
            # An array, since onnxruntime leaves out the addition of a number 0: -0 would stay -0.
            whole = np.full((len(w), w.shape[2]), self._constants[start])
            total = self._constant(f"{name}_start", whole)
        for j, column in enumerate(self._split(values)):
            at_j = self._constant(f"{weights}_{j}", np.ascontiguousarray(w[:, j]))
            product = self._add("Mul", f"{name}_product_{j}", at_j, column)
            is_last = j == w.shape[1] - 1
            total = self._add("Add", name if is_last else f"{name}_{j}", total, product)
        return total

    def sigmoid(self, name: str, values: str) -> str:
        """Add the sigmoid."""
        self._n_columns[name] = self._n_columns[values]
        if self._is_fast:
            return self._add("Sigmoid", name, values)
        half = self.number(0.5)
        a = self._add("Mul", f"{name}_half", values, half)
        ends = (self.number(-sigmoid_limit), self.number(sigmoid_limit))
        h = self._add("Clip", f"{name}_h", a, *ends)
        q = self._add("Mul", f"{name}_q", h, h)
        above = self._add("Mul", f"{name}_above", h, self._polynomial(f"{name}_p", NUMERATOR, q))
        below = self._polynomial(f"{name}_d", DENOMINATOR, q)
        share = self._add("Div", f"{name}_share", above, below)
        return self._add("Add", name, half, self._add("Mul", f"{name}_from_half", half, share))

    def _polynomial(self, name: str, coefficients: tuple[float, ...], q: str) -> str:
        total = self.number(coefficients[-1])
        for k in range(len(coefficients) - 2, -1, -1):
            product = self._add("Mul", f"{name}{k}_product", q, total)
            total = self._add("Add", f"{name}{k}", self.number(coefficients[k]), product)
        return total

    def each(self, name: str, first: str, sign: str, second: str) -> str:
        """Add the sum, difference, product or quotient."""
        known = [self._n_columns[one] for one in (first, second) if one in self._n_columns]
        self._n_columns[name] = known[0]
        return self._add(KINDS_OF_NODES[sign], name, first, second)


def to_onnx(team: EvolvedTeam, is_fast: bool = False) -> bytes:
    """Return the content of an ``.onnx`` file.

    Args:
        team: to be exported.
        is_fast: the small graph, whose results differ in the last digits.

    Raises:
        EnvironmentFailure: onnx is not installed.
    """
    try:
        import onnx
        from onnx import checker, helper
    except ImportError as error:
        raise EnvironmentFailure(
            ".onnx needs onnx, which is not installed: pip install 'conevo[export]'"
        ) from error
    net = team.network
    columns = {"observations": net.n_inputs, "context": net.n_context}
    after = {"outputs": net.n_outputs, "next_context": net.n_context}
    ops = OnnxNodes(onnx, net.weights, columns, is_fast)
    results = net.equations(ops, "observations", "context")
    for name, result in zip(after, results, strict=True):
        if result != name:
            ops.nodes.append(helper.make_node("Identity", [result], [name], name=name))

    def declared(sizes: dict[str, int]) -> list[Any]:
        kind = onnx.TensorProto.FLOAT
        return [
            helper.make_tensor_value_info(name, kind, (net.n_robots, n))
            for name, n in sizes.items()
        ]

    graph = helper.make_graph(
        ops.nodes, "team", declared(columns), declared(after), ops.constants, team.title
    )
    model = helper.make_model(
        graph,
        opset_imports=[helper.make_opsetid("", OPSET)],
        ir_version=IR_VERSION,
        producer_name="conevo",
        producer_version=team.about["conevo"],
        doc_string=team.title,
    )
    facts = team.about | {"arithmetic": "fast" if is_fast else "exact"}
    helper.set_model_props(
        model, {k: v if isinstance(v, str) else json.dumps(v) for k, v in facts.items()}
    )
    checker.check_model(model, full_check=True)
    content: bytes = model.SerializeToString(deterministic=True)
    return content
