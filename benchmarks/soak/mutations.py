"""Mutations at random places of both packages: how many of them do the tests of their room catch?

    python benchmarks/soak/mutations.py [--places 200] [--seed 1] [--under kernels/foliot ...] [--timeout 1200]

Cosmic Ray (pip install cosmic-ray) makes one small change at a time, in a copy of this checkout: another operator,
number or comparison, a loop that does not run. The tests of the room are run on it, up to the first that fails. Those
that live are printed with their diff: each is a missing test, or equivalent, which a person has to say; changes of
mere types are not counted. A place in the kernels takes a minute or two, for its room is compiled anew.
"""

import argparse
import ast
import random
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).parents[2]
PACKAGES = ("kernels", "sweep")
WITHOUT = ("core/RemoveDecorator", "core/NoOp")
"""Operators whose changes mean nothing here: `jit` gives the same bits as plain Python."""


def main():
    arguments = read_arguments()
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / "checkout"
        subprocess.run(["git", "clone", "-q", ROOT, copy], check=True)
        places = sampled(list(all_places(copy, arguments.under)), arguments.places, arguments.seed)
        for room in sorted({tests_of(copy, path) for _, path, _ in places}):
            check_sound(copy, room, arguments.timeout)
        outcomes = [tried(copy, place, arguments.timeout) for place in places]
    caught = outcomes.count("killed")
    judged = len(places) - outcomes.count("annotates")
    print(f"{caught} of {judged} caught, {outcomes.count('survived')} live, seed {arguments.seed}")


def read_arguments():
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--places", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--under", nargs="*", default=PACKAGES, help="folders or files of this checkout")
    parser.add_argument("--timeout", type=float, default=1200.0, help="seconds for the tests of a room")
    return parser.parse_args()


def all_places(copy, under):
    """Every (operator, file, occurrence) that can be changed."""
    from cosmic_ray import plugins
    from cosmic_ray.ast import ast_nodes, get_ast_from_path

    operators = [(name, plugins.get_operator(name)) for name in sorted(plugins.operator_names())]
    operators = [(name, make()) for name, make in operators if name not in WITHOUT and not make.arguments()]
    for name in under:
        start = copy / name
        for path in sorted(start.rglob("*.py")) if start.is_dir() else [start]:
            tree = get_ast_from_path(path)
            for operator_name, operator in operators:
                found = sum(1 for node in ast_nodes(tree) for _ in operator.mutation_positions(node))
                yield from ((operator_name, path.relative_to(copy), k) for k in range(found))


def sampled(places, count, seed):
    """So many of the places, each file's share as large as it is long."""
    return random.Random(seed).sample(places, min(count, len(places)))


def tried(copy, place, timeout):
    """What became of one change: "killed", "survived", "annotates" or "incompetent"."""
    from cosmic_ray.mutating import mutate_and_test
    from cosmic_ray.work_item import MutationSpec

    operator, path, occurrence = place
    spec = MutationSpec(
        module_path=copy / path, operator_name=operator, occurrence=occurrence, start_pos=(0, 0), end_pos=(0, 1)
    )
    result = mutate_and_test([spec], command(copy, tests_of(copy, path), path.stem), timeout)
    outcome = result.test_outcome.value if result.test_outcome else "incompetent"
    if outcome == "survived" and only_annotates(copy / path, operator, occurrence):
        outcome = "annotates"
    print(f"{outcome:12} {path} {operator} {occurrence}", flush=True)
    if outcome == "survived":
        print(result.diff, flush=True)
    return outcome


def only_annotates(path, operator, occurrence):
    """Whether a change leaves everything as it is but what is written of types, which nothing reads."""
    from cosmic_ray import plugins
    from cosmic_ray.mutating import mutate_code

    code = path.read_text()
    return without_types(code) == without_types(mutate_code(code, plugins.get_operator(operator)(), occurrence))


def without_types(code):
    """A module's syntax without the types of arguments and of what functions return."""
    tree = ast.parse(code)
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef):
            node.returns = None
        elif isinstance(node, ast.arg):
            node.annotation = None
    return ast.dump(tree)


def tests_of(copy, path):
    """The tests of the file's room."""
    room = copy / "tests" / Path(*path.parts[:2]).with_suffix("")
    return room if room.is_dir() else copy / "tests" / path.parts[0]


def command(copy, tests, module=""):
    """Runs tests up to the first fault, those named like the module first: of a room of kernels as plain Python,
    compiled, and those of all rooms as plain Python, which CI runs as well."""
    pytest = f"XDG_CACHE_HOME={copy}/cache PYTHONPATH={copy} {sys.executable} -m pytest -q -x"
    own = " ".join(str(path) for path in sorted(tests.rglob(f"test_{module.strip('_')}.py")))
    first = [own] if own else []
    steps = [f"{pytest} {paths}" for paths in (*first, tests)]
    if "kernels" in tests.relative_to(copy).parts:
        plain = f"NUMBA_DISABLE_JIT=1 {pytest}"
        steps = [*(f"{plain} {paths}" for paths in (*first, tests)), *steps, f"{plain} {copy}/tests/kernels"]
    return f"bash -c 'cd {copy} && {' && '.join(steps)}'"


def check_sound(copy, tests, timeout):
    """Ends where tests fail that nothing was changed for: they would catch everything."""
    from cosmic_ray.testing import run_tests

    outcome, output = run_tests(command(copy, tests), timeout)
    if outcome.value != "survived":
        raise SystemExit(f"{tests}: fails without a mutation, or takes more than {timeout:g} s\n{output[-2000:]}")


if __name__ == "__main__":
    if not shutil.which("bash") or subprocess.run([sys.executable, "-c", "import cosmic_ray"]).returncode:
        raise SystemExit("pip install cosmic-ray")
    main()
