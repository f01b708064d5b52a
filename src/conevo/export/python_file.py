"""A Python file that runs a team with numpy alone, bit for bit as the kernels."""

from __future__ import annotations

import base64
import io
import pprint
import textwrap
from typing import Any

import numpy as np

from conevo.export.arithmetic import DENOMINATOR, NUMERATOR, sigmoid_limit
from conevo.export.team import EvolvedTeam

__all__ = ["to_python"]

# Indented, so that its class is not taken for one of this package.
TEMPLATE = textwrap.dedent('''\
    """{title}

    It needs numpy alone::

        team = Team()                    # once per epoch, or team.reset()
        outputs = team(observations)     # [{r}, {o}] from [{r}, {s}], once per iteration

    Or with the context, [{r}, {c}] zeros at first, in your hands::

        outputs, context = step(observations, context)

    Sensors and outputs are named in ABOUT. An output is any real number; sigmoid(outputs) lies
    between 0 and 1. All operations are those of the simulator, in float32 and in the same order,
    and so are the results, bit for bit.
    """

    import base64
    import io

    import numpy as np

    ABOUT = {about}
    CONTEXT = {c}

    F = np.float32
    LIMIT = F({limit})
    NUMERATOR = {numerator}
    DENOMINATOR = {denominator}


    def polynomial(coefficients, x):
        """Return a polynomial of x, whose coefficients begin with the lowest power."""
        total = F(coefficients[-1])
        for coefficient in coefficients[-2::-1]:
            total = F(coefficient) + x * total
        return total


    def sigmoid(a):
        """Return the logistic function by a rational approximation, error below 1e-6."""
        h = np.clip(a * F(0.5), -LIMIT, LIMIT)
        q = h * h
        return F(0.5) + F(0.5) * ((h * polynomial(NUMERATOR, q)) / polynomial(DENOMINATOR, q))


    def weighted(weights, values, start):
        """Return start + w_0 v_0 + w_1 v_1 + ..., added from left to right: the order matters."""
        total = start + weights[:, 0] * values[:, :1]
        for j in range(1, weights.shape[1]):
            total += weights[:, j] * values[:, j, None]
        return total


    def step(observations, context):
        """Return the outputs [{r}, {o}] and the next context [{r}, {c}]."""
        observations, context = np.asarray(observations, F), np.asarray(context, F)
        if observations.shape != ({r}, {s}) or context.shape != ({r}, {c}):
            raise ValueError(f"shapes {{observations.shape}}, {{context.shape}}: not ({r}, {s}), ({r}, {c})")
    {lines}
        return {results}


    class Team:
        """The team, which remembers its context."""

        def __init__(self):
            self.reset()

        def reset(self):
            """Forget everything, as at the start of an epoch."""
            self.context = np.zeros(({r}, {c}), F)

        def __call__(self, observations):
            """Return the outputs [{r}, {o}] for observations [{r}, {s}]."""
            outputs, self.context = step(observations, self.context)
            return outputs


    DATA = """
    {data}
    """
    with np.load(io.BytesIO(base64.b85decode(DATA.replace("\\n", "")))) as archive:
        W = {{name: archive[name] for name in archive.files}}
''')  # noqa: E501


class PythonText:
    """Writes one line of Python for each operation; a value is the name of a variable."""

    def __init__(self) -> None:
        self.lines: list[str] = []

    def _line(self, name: str, text: str) -> str:
        self.lines.append(f"{name} = {text}")
        return name

    def weight(self, name: str) -> str:
        """Return weights."""
        return f'W["{name}"]'

    def number(self, value: float) -> str:
        """Return a number."""
        return f"F({value:g})"

    def join(self, name: str, first: str, second: str) -> str:
        """Write the columns of both."""
        return self._line(name, f"np.concatenate([{first}, {second}], axis=1)")

    def columns(self, name: str, values: str, first: int, last: int) -> str:
        """Write some columns."""
        return self._line(name, f"{values}[:, {first or ''}:{last}]")

    def weighted(self, name: str, weights: str, values: str, start: str) -> str:
        """Write the sum."""
        return self._line(name, f'weighted(W["{weights}"], {values}, {start})')

    def sigmoid(self, name: str, values: str) -> str:
        """Write the sigmoid."""
        return self._line(name, f"sigmoid({values})")

    def each(self, name: str, first: str, sign: str, second: str) -> str:
        """Write the sum, difference, product or quotient."""
        return self._line(name, f"{first} {sign} {second}")


def to_python(team: EvolvedTeam) -> bytes:
    """Return the content of a ``.py`` file."""
    net = team.network
    text = PythonText()
    results = net.equations(text, "observations", "context")
    archive = io.BytesIO()
    np.savez_compressed(archive, **net.weights)  # type: ignore[arg-type]
    data = base64.b85encode(archive.getvalue()).decode()
    written: dict[str, Any] = {
        "title": team.title.replace("\\", "/").replace('"', "'"),
        "r": net.n_robots,
        "s": net.n_inputs,
        "c": net.n_context,
        "o": net.n_outputs,
        "about": pprint.pformat(team.about, width=98, sort_dicts=False, compact=True),
        "limit": sigmoid_limit,
        "numerator": pprint.pformat(NUMERATOR),
        "denominator": pprint.pformat(DENOMINATOR),
        "lines": "\n".join(f"    {line}" for line in text.lines),
        "results": ", ".join(results),
        "data": "\n".join(data[k : k + 98] for k in range(0, len(data), 98)),
    }
    return TEMPLATE.format(**written).encode()
