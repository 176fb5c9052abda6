"""Checks the names that a controller's code uses of its sensors, memory, actuators and parameters, without running it.

Compiled and interpreted controllers thus get the same message, even for code that is seldom reached. The same goes for
sensors in files of their own. The names that a controller may read in `sensors` depend on the sensors of its robots.
"""

import ast
import re
from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence, Set
from functools import lru_cache
from pathlib import Path
from types import FunctionType, ModuleType

import numpy as np

from epuck_sim.control.interface import ACTUATORS, Controller, RobotCode, Sensor, Sensors, World
from epuck_sim.errors import ControllerError
from epuck_sim.user_files import PythonFile
from epuck_sim.util.messages import comma_list, nearest_name

ARGUMENTS: Mapping[str, tuple[str, ...]] = {
    "step": ("sensors", "memory", "actuators", "parameters", "random"),
    "start": ("memory", "parameters", "random"),
    "sense": ("world", "robot", "readings", "parameters", "random"),
    "check": ("parameters",),
}
"""Arguments of a controller's functions, and of a sensor's, in this order."""

FIXED: Mapping[type, Sequence[str]] = {Sensor: ("world", "robot", "parameters"), Controller: ("parameters", "sensors")}
"""Arguments that code must not set: a sensor would change outcomes, a controller its group's values, or traces."""

GENERATORS = re.compile(r"random|numpy\.random(\..*)?")
"""Modules of random generators: their numbers do not come from a robot's stream, nor repeat without a seed."""

DRAW = "draw by epuck_sim.util.rng.uniform(random)"
"""Advice for controllers and sensors whose random numbers do not follow from the trial's seed."""

CHANGING = re.compile("append|extend|insert|remove|pop|clear|sort|reverse|update|setdefault|popitem|add|discard")
"""Methods that change lists, dictionaries and sets."""

SEEN_OF_ROBOTS = ("x", "y", "heading", "radius_cm", "ring_on", "present", "number")
"""Fields of a robot's record that a sensor sees."""


def check_own_names(user: Controller | Sensor) -> None:
    """Raise ControllerError, with line, for names that memory, actuators, readings, world and so on lack."""
    own: dict[str, Sequence[str]] = {"parameters": tuple(user.parameters), "random": ()}
    if isinstance(user, Sensor):
        role, record = "readings", user.readings
        own |= {"world": World._fields, "robot": SEEN_OF_ROBOTS}
    else:
        role, record = "memory", user.memory
        own |= {"actuators": ACTUATORS.names or ()}
    own[role] = record.names or ()
    _check_names(user, own, {(role, name) for name in own[role] if record[name].shape}, FIXED[type(user)])


@lru_cache
def check_sensed(controller: Controller, readings: tuple[str, ...] = ()) -> None:
    """Raise ControllerError, with line, for names of sensors that are neither built in nor among `readings`."""
    _check_names(controller, {"sensors": (*Sensors._fields, *readings)})


def _check_names(
    user: RobotCode,
    known: Mapping[str, Sequence[str]],
    several: Collection[tuple[str, str]] = (),
    fixed: Sequence[str] = (),
) -> None:
    """Check the names used of arguments with these roles, also in functions to which such arguments are passed on.

    Other names assigned to them are not followed. Fields of `several` numbers, by role and name, must not be set as a
    whole: numba copies whatever lies there. Nothing with a role in `fixed` may be set, even under another name.
    """
    definitions = _definitions(user)
    todo: list[tuple[object, tuple[str | None, ...]]] = [
        (getattr(user, name), arguments) for name, arguments in ARGUMENTS.items() if hasattr(user, name)
    ]
    done = set()
    while todo:
        function, roles = todo.pop()
        if not isinstance(function, FunctionType) or (function, roles) in done:
            continue
        done.add((function, roles))
        code = function.__code__
        definition = definitions.get((code.co_filename, code.co_name, code.co_firstlineno))
        if definition is not None:
            nodes = [*ast.walk(definition)]
            bound = _bound(nodes)
            names = _names_of_arguments(definition, bound, roles)
            mistakes = [*_mistakes(nodes, names, known, several, fixed, bound, function.__globals__)]
            if function in (getattr(user, "step", None), getattr(user, "sense", None)):
                mistakes += _returned(definition)
            for line, said in mistakes:
                raise ControllerError(f"{code.co_filename}:{line}: {said}")
            for node in nodes:
                if isinstance(node, ast.Call):
                    given = tuple(names.get(each.id) if isinstance(each, ast.Name) else None for each in node.args)
                    todo.append((_value_of(node.func, function.__globals__), given))


@lru_cache(maxsize=8)
def _definitions(user: RobotCode) -> dict[tuple[str, str, int], ast.FunctionDef]:
    """Return the trees of functions in the user's Python files, by file, name and first line as in code objects.

    They are cached: names of sensors are checked after the user's own names, and for each set of sensors.
    """
    found = {}
    for path, source in user.sources.items():
        for node in ast.walk(ast.parse(source)) if path.suffix == ".py" else ():
            if isinstance(node, ast.FunctionDef):
                line = min([node.lineno, *(decorator.lineno for decorator in node.decorator_list)])
                found[str(path), node.name, line] = node
    return found


def _bound(nodes: Sequence[ast.AST]) -> Counter[str]:
    """Return how often each name is an argument, or is set or deleted, in a function or one within it."""
    names = (node for node in nodes if isinstance(node, ast.Name) and not isinstance(node.ctx, ast.Load))
    return Counter([*(node.id for node in names), *(node.arg for node in nodes if isinstance(node, ast.arg))])


def _names_of_arguments(
    definition: ast.FunctionDef, bound: Mapping[str, int], roles: Sequence[str | None]
) -> dict[str, str]:
    """Return the roles (sensors, memory and so on) of a function's arguments, by name; not of those assigned to."""
    arguments = [each.arg for each in (*definition.args.posonlyargs, *definition.args.args)]
    return {name: role for name, role in zip(arguments, roles, strict=False) if role and bound[name] == 1}


def _mistakes(
    nodes: Sequence[ast.AST],
    names: Mapping[str, str],
    known: Mapping[str, Sequence[str]],
    several: Collection[tuple[str, str]],
    fixed: Sequence[str],
    bound: Mapping[str, int],
    values: Mapping[str, object],
) -> Iterator[tuple[int, str]]:
    """Yield line and message of each mistake in a function; `names` has the roles of its arguments by name.

    `bound` has the names that are its own, and `values` the global ones of its file.
    """
    parts = [node for node in nodes if isinstance(node, ast.Attribute | ast.Subscript)]
    also_named, own = dict(names), "readings" if "world" in fixed else "memory"
    stays = f"its value would stay from trial to trial; use {own}"
    for node in nodes:
        if isinstance(node, ast.Global):
            yield node.lineno, f"{ast.unparse(node)}: {stays}"
        if isinstance(node, ast.Assign | ast.For):  # of a part of something with a role, to a name that it alone sets
            part, targets = (node.iter, [node.target]) if isinstance(node, ast.For) else (node.value, node.targets)
            if role := also_named.get(_root(part)):
                also_named |= {each.id: role for each in targets if isinstance(each, ast.Name) and bound[each.id] == 1}
    for node in sorted(parts, key=lambda node: (node.lineno, node.col_offset)):
        is_set, root = not isinstance(node.ctx, ast.Load), _root(node)
        is_changed = isinstance(values.get(root), list | dict | set) and CHANGING.fullmatch(getattr(node, "attr", ""))
        if root in values and root not in bound and (is_set or is_changed):
            yield node.lineno, f"changes {ast.unparse(node)}: {stays}"
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id in names:
            role = names[node.value.id]
            kind = {"sensors": Sensors, "world": World}.get(role, np.record)  # whose own attributes are allowed, too
            if role in known and node.attr not in known[role] and not hasattr(kind, node.attr):
                yield node.lineno, unknown_name(role, node.attr, known[role])
            if (role, node.attr) in several and is_set:
                said = ast.unparse(node)
                yield node.lineno, f"sets {said}, which is several numbers; set {said}[:] instead"
        if is_set and also_named.get(root) in fixed:
            setter, may = ("sensor", "its readings") if own == "readings" else ("controller", "memory and actuators")
            yield node.lineno, f"sets {ast.unparse(node)}; a {setter} may set only {may}"


def _returned(definition: ast.FunctionDef) -> Iterator[tuple[int, str]]:
    """Yield line and message of each value that `step` or `sense` returns; functions defined within may return some."""
    nested = [node for node in ast.walk(definition) if isinstance(node, ast.FunctionDef)][1:]
    inner = {each for node in nested for each in ast.walk(node)}
    to = "readings" if definition.name == "sense" else "actuators, as in actuators.ring_on = 1"
    for node in ast.walk(definition):
        if isinstance(node, ast.Return) and node not in inner and ast.unparse(node) not in ("return", "return None"):
            yield node.lineno, f"{ast.unparse(node)}: nothing reads what {definition.name} returns; set {to}"


def check_draws(file: PythonFile, instead: str) -> None:
    """Raise the file's error, with line, for a call in it that draws numbers which follow from no seed of a trial.

    A generator with a seed may draw when the file is loaded, but not in a function: it would go on from trial to trial.
    """
    for path, source in file.sources.items():
        values = vars(file.modules[path])
        run = (part for part in ast.parse(source).body if not isinstance(part, ast.If))  # as a module, not a program
        for call, hidden in (found for part in run for found in _calls(part)):
            if _root(call.func) in (hidden or ()):
                continue
            called = _value_of(call.func, values)
            given = [*call.args, *(keyword.value for keyword in call.keywords)]
            is_none = [isinstance(each, ast.Constant) and each.value is None for each in given]
            is_unseeded = all(is_none) and _is_of_generators(called)
            owner = call.func.value if isinstance(call.func, ast.Attribute) and hidden is not None else None
            drawn_by = getattr(called, "__self__", owner and _value_of(owner, values))
            if is_unseeded or _is_of_generators(type(drawn_by)):
                said = f"calls {ast.unparse(call.func)}, whose numbers ignore the trial's seed; {instead}"
                raise file.error(f"{path}:{call.lineno}: {said}")


def _calls(node: ast.AST, hidden: Set[str] | None = None) -> Iterator[tuple[ast.Call, Set[str] | None]]:
    """Yield calls, with the names that functions around them take or assign, hiding the file's; None outside of any."""
    if isinstance(node, ast.FunctionDef | ast.Lambda):
        hidden = {*_bound([*ast.walk(node)]), *(hidden or ())}
    if isinstance(node, ast.Call):
        yield node, hidden
    for child in ast.iter_child_nodes(node):
        yield from _calls(child, hidden)


def _is_of_generators(made_by: object) -> bool:
    return GENERATORS.fullmatch(getattr(made_by, "__module__", None) or "") is not None


def _root(node: ast.AST) -> str:
    """Return the name before all dots and brackets of an attribute or a part of an array; "" if there is none."""
    while isinstance(node, ast.Attribute | ast.Subscript):
        node = node.value
    return node.id if isinstance(node, ast.Name) else ""


def unknown_name(role: str, name: str, names: Sequence[str]) -> str:
    """Return the message about a name that sensors, memory, actuators, parameters or random do not have."""
    nearest = nearest_name(name, names)
    known = DRAW if role == "random" else f"known: {comma_list(names)}"
    known += "; for more: sensors: [FILE.py]" * (role == "sensors")
    there = f"did you mean {nearest!r}?" if nearest else known
    return f"{role} {'have' if role.endswith('s') else 'has'} no {name!r}; {there}"


def _value_of(node: ast.expr, values: Mapping[str, object]) -> object:
    """Return the value of a name, or of a name in a module; None where that is not known."""
    if isinstance(node, ast.Name):
        return values.get(node.id)
    if isinstance(node, ast.Attribute):
        owner = _value_of(node.value, values)
        return getattr(owner, node.attr, None) if isinstance(owner, ModuleType) else None
    return None


def first_use(name: str, sources: Mapping[Path, bytes]) -> tuple[Path, int] | None:
    """Return file and line of the first use of a name or attribute; None if no file uses it."""
    for path, source in sources.items():
        for node in ast.walk(ast.parse(source)):
            if isinstance(node, ast.expr) and name in (getattr(node, "attr", None), getattr(node, "id", None)):
                return path, node.lineno
    return None
