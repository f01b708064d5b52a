"""The C header compiles without a warning, and refuses what would change its results."""

import subprocess
from pathlib import Path

import numpy as np
import pytest

import conevo
from conevo.controllers.registry import controller
from conevo.export.c_header import to_c
from conevo.export.files import export
from conevo.export.networks import KINDS
from export.needed import compiler
from export.replayed import STRICT, recorded

LIGHT = Path(__file__).resolve().parents[2] / "examples" / "light.py"


@pytest.fixture(params=KINDS)
def team(request):
    world = conevo.world(f"{LIGHT}:dark-1", iterations=2)
    return recorded(world, controller(request.param, world=world))[0]


def compiled(folder, text, *flags, name="gcc", kind="c"):
    """Return the exit code and the messages of a compiler."""
    source = folder / f"main.{kind}"
    source.write_text(text)
    command = [compiler(name), *STRICT, *flags, "-o", str(folder / "main"), str(source)]
    done = subprocess.run(command, capture_output=True, text=True)
    return done.returncode, done.stderr


def test_two_robots_in_one_program_without_libraries(team, tmp_path):
    text = ""
    for stem in ("robot-1", "2nd robot"):
        export(team, tmp_path / f"{stem}.h")
        text += f'#include "{stem}.h"\n#include "{stem}.h"\n'
    text += (
        "int main(void) {\n"
        "    static robot_1_state one; static _2nd_robot_state two;\n"
        "    float seen[robot_1_robots * robot_1_sensors] = {0};\n"
        "    float outputs[robot_1_robots * robot_1_outputs];\n"
        "    robot_1_step(&one, seen, outputs); _2nd_robot_step(&two, seen, outputs);\n"
        "    return robot_1_sigmoid(outputs[0]) < 0.0f;\n}\n"
    )
    assert compiled(tmp_path, text, "-std=c99") == (0, "")  # without -lm
    assert compiled(tmp_path, text, "-std=c++11", name="g++", kind="cpp") == (0, "")
    assert subprocess.run([tmp_path / "main"]).returncode == 0


def test_flags_that_reorder_additions_are_refused(team, tmp_path):
    export(team, tmp_path / "team.h")
    text = '#include "team.h"\nint main(void) { return 0; }\n'
    assert compiled(tmp_path, text, "-O2", "-ffp-contract=off") == (0, "")
    code, message = compiled(tmp_path, text, "-O2", "-ffast-math")
    assert code != 0
    assert "compile without -ffast-math: the order of additions matters" in message


def test_texts_of_a_world_cannot_end_the_comment(team, tmp_path):
    team.about["run"] = "NAME */ int x; /*"
    text = to_c(team, "team").decode()
    assert '"NAME * / int x; / *"' in text
    (tmp_path / "team.h").write_text(text)
    main = '#include "team.h"\nint main(void) { return 0; }\n'
    assert compiled(tmp_path, main) == (0, "")


def test_every_weight_is_read_as_the_same_float(team, tmp_path):
    net = team.network
    text = to_c(team, "team").decode()
    name, values = next(iter(net.weights.items()))
    written = text.partition(f"team_{name}[")[2].partition("=")[2].partition(";")[0]
    numbers = [one.strip("{}\n ") for one in written.split(",")]
    assert all(one.endswith("f") and ("." in one or "e" in one) for one in numbers)
    found = np.array([float(one[:-1]) for one in numbers], np.float32)
    assert found.tobytes() == values.tobytes()
