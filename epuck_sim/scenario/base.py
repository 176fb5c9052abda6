"""The base of all sections of a scenario, the kinds of numbers in them, and messages about values that they refuse.

Throughout `scenario`, every line of an error message begins with an `origin`, and files are looked for first in a
`folder`, that of the scenario's file, and then in the working directory.
"""

import re
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any, ClassVar, Self, get_args

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError, model_validator
from pydantic_core import PydanticCustomError

from epuck_sim.errors import EpuckSimError, ScenarioError
from epuck_sim.util.messages import comma_list, nearest_name, short_yaml


def _reject_bool(value: object) -> object:
    if isinstance(value, bool):
        raise ValueError("a number, not true or false")  # noqa: TRY004 pydantic gathers ValueErrors
    return value


Number = Annotated[float, BeforeValidator(_reject_bool)]
WholeNumber = Annotated[int, BeforeValidator(_reject_bool)]
MOST_TOLD = 10  # most mistakes in a file that are told one by one
LARGEST = 1e6  # largest number that keys without a limit of their own may have

Positive = Annotated[Number, Field(gt=0, le=LARGEST)]
Length = Annotated[Number, Field(ge=1e-6, le=LARGEST)]  # in cm; the square of a much shorter one would be 0


def _row_of(*names: str) -> BeforeValidator:
    def check(given: object) -> object:
        if not isinstance(given, list | tuple) or len(given) != len(names):
            raise PydanticCustomError("row", "a row", {"names": ", ".join(names)})
        return given

    return BeforeValidator(check)


Corner = Annotated[tuple[Number, Number], _row_of("x_cm", "y_cm")]
Pose = Annotated[tuple[Number, Number, Number], _row_of("x_cm", "y_cm", "heading_rad")]
Mount = Annotated[tuple[Number, Number, Number], _row_of("x_cm", "y_cm", "direction_deg")]


def check_range(key: str, value: float | None, least: float, most: float, why: str = "") -> None:
    """Raise ValueError unless a value, if there is one, is within limits that follow from other keys."""
    if value is not None and not least <= value <= most:
        shown = f"{value:.7g}" if abs(value) <= sys.float_info.max else short_yaml(value)
        raise ValueError(f"{key} is {shown}; allowed: {least:.7g} to {most:.7g}{why}")


class ConfigModel(BaseModel):
    """A section of a scenario: it has no unknown keys and no NaN, and cannot be changed.

    Defaults that are sections are made by `model_construct`: so only the scenario's validator has to be built.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, defer_build=True)

    later_keys: ClassVar[tuple[str, ...]] = ()
    """Keys added later; seeds of resamples leave them out at their defaults, so that old folders keep their numbers."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        self._check_together()
        return self

    def _check_together(self) -> None:
        """Raise ValueError if values that are allowed one by one do not go together."""

    @classmethod
    def keys_in_files(cls, values: Mapping[str, Any], folder: Path | None) -> dict[str, Sequence[str]]:  # noqa: ARG003
        """Return the keys (names of parameters) that files named by these values add, by field of the section."""
        return {}

    def later_defaults(self) -> dict[str, Any]:
        """Return the `later_keys` at their defaults, of this section and of those in it, as pydantic's `exclude`."""
        found: dict[str, Any] = {}
        for key, field in type(self).model_fields.items():
            value = getattr(self, key)
            if key in self.later_keys and value == field.get_default(call_default_factory=True):
                found[key] = True
            elif inner := _later_defaults_in(value):
                found[key] = inner
        return found


def _later_defaults_in(value: object) -> dict[str, Any] | dict[int, Any]:
    if isinstance(value, tuple):
        return {place: inner for place, item in enumerate(value) if (inner := _later_defaults_in(item))}
    return value.later_defaults() if isinstance(value, ConfigModel) else {}


@contextmanager
def refused_at(origin: str) -> Iterator[None]:
    """Turn an EpuckSimError or ValueError of the block into a ScenarioError that begins with `origin`."""
    try:
        yield
    except (EpuckSimError, ValueError) as error:
        raise ScenarioError(f"{origin}: {error}") from error


TAGS = ("kind", "shape")  # keys whose value selects one of several classes of a section

ALLOWED = {
    "a finite number": "finite_number",
    "a list": "tuple_type",
    "a mapping of keys to values": "dict_type model_attributes_type model_type",
    "a multiple of {multiple_of:g}": "multiple_of",
    "a number": "float_parsing float_type",
    "a whole number": "int_from_float int_parsing int_type",
    "a whole number with fewer digits": "int_parsing_size",
    "above {gt:.12g}": "greater_than",
    "at least {ge:.12g}": "greater_than_equal",
    "at most {le:.12g}": "less_than_equal",
    "at most {max_length} characters": "string_too_long",
    "at most {max_length} values": "too_long",
    "below {lt:.12g}": "less_than",
    "text": "string_type",
    "text as the key": "invalid_key",
    "text in Unicode": "string_unicode",
    "true or false": "bool_parsing bool_type",
    "[{names}]": "row",
    "{error}": "value_error",
    "{expected}": "literal_error",
    "{min_length} or more characters": "string_too_short",
    "{min_length} or more values": "too_short",
}
"""Pydantic's types of errors by the words for what is allowed; in braces, fields of pydantic's error."""


def section_classes(annotation: Any) -> list[type[ConfigModel]]:
    """Return the classes of sections in the type of a field."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation] if issubclass(annotation, ConfigModel) else []
    return [found for part in get_args(annotation) for found in section_classes(part)]


def tagged(section: type[ConfigModel]) -> tuple[str, tuple[str, ...]]:
    """Return the key whose value selects this class of section, and the values that do; "" and none without a key."""
    for tag in TAGS:
        if tag in section.model_fields and (values := get_args(section.model_fields[tag].annotation)):
            return tag, values
    return "", ()


def keys_of(classes: Sequence[type[ConfigModel]], value: Any, folder: Path | None) -> Iterator[str]:
    """Yield all dotted keys in a value: a section of one of these classes, several of them, or, without any, others."""
    if isinstance(value, ConfigModel):
        classes, value = [type(value)], vars(value)
    parts: Iterable[tuple[Any, Any]] = ()
    if not classes:
        parts = value.items() if isinstance(value, Mapping) else ()
    elif isinstance(value, list | tuple):
        parts = enumerate(value)
    else:
        yield from _keys_of_section(classes, value if isinstance(value, Mapping) else {}, folder)
        return
    for name, part in parts:
        yield str(name)
        yield from (f"{name}.{key}" for key in keys_of(classes, part, folder))


def _keys_of_section(
    classes: Sequence[type[ConfigModel]], given: Mapping[str, Any], folder: Path | None
) -> Iterator[str]:
    section = next((each for each in classes if given.get(tagged(each)[0]) in tagged(each)[1]), classes[0])
    fields = section.model_fields.items()
    defaults = {name: field.get_default(call_default_factory=True) for name, field in fields}
    values = {name: default if given.get(name) is None else given[name] for name, default in defaults.items()}
    own = section.keys_in_files(values, folder)
    for name, field in fields:
        yield name
        inner = () if values[name] is None else keys_of(section_classes(field.annotation), values[name], folder)
        yield from (f"{name}.{key}" for key in dict.fromkeys([*inner, *own.get(name, ())]))


def ends_in(key: str, ending: str) -> bool:
    """Return whether a dotted key is this one, or ends in it, with or without `parameters`: `0.speed_cm_s`."""
    return any(f".{each}".endswith(f".{ending}") for each in (key, key.replace(".parameters.", ".")))


def whole_key_of(ending: str, keys: Sequence[str]) -> str:
    """Return the phrase for the ending of these keys, where whole keys alone are allowed."""
    return f"{ending} is the ending of a key; give the whole key, {' or '.join(keys)}"


def kinds_with(name: str, field: str, classes: Sequence[type[ConfigModel]]) -> Iterator[str]:
    """Yield a phrase for a field, and for each inside it, that has a key with some values of its tag, not with all."""
    have = [each for each in classes if name in each.model_fields]
    if 0 < len(have) < len(classes):
        values = [value for each in have for value in tagged(each)[1]]
        yield f"{field} has it with {tagged(have[0])[0]}: {' or '.join(values)}"
    for each in classes:
        for inner, about in each.model_fields.items():
            yield from kinds_with(name, inner, section_classes(about.annotation))


def guess(name: str, known: Sequence[str], keys: Sequence[str], kinds: Sequence[str] = ()) -> str:
    """Return the phrase for an unknown key, with the known one that was probably meant.

    >>> guess("speed", ["seed"], ["seed", "agents.speed_cm_s"])
    "unknown 'speed', did you mean speed_cm_s (agents.speed_cm_s)?"
    >>> guess("speed_cm_s", ["seed"], ["seed", "agents.speed_cm_s"])
    "unknown 'speed_cm_s' here; the full key is agents.speed_cm_s"
    """
    if "." in name:
        return f"unknown {name!r}: a file has its keys nested, as in robots: [{{parameters: {{speed_cm_s: 3}}}}]"
    same = [key for key in keys if ends_in(key, name)]
    if same:
        return f"unknown {name!r} here; the full key is {' or '.join(same)}"
    if kinds:
        return f"unknown {name!r} here; {', '.join(dict.fromkeys(kinds))}"
    endings = dict.fromkeys(key.rpartition(".")[2] for key in reversed(keys))
    near = nearest_name(name, [*known, *endings])
    if near is not None and near not in known:
        return f"unknown {name!r}, did you mean {near} ({' or '.join(key for key in keys if ends_in(key, near))})?"
    return f"unknown {name!r}" + (f", did you mean {near!r}?" if near else "")


def problems_in(
    kind: type[ConfigModel], error: ValidationError, keys: Sequence[str] = (), others: Sequence[type[ConfigModel]] = ()
) -> Iterator[tuple[str, str]]:
    """Yield the dotted key and the message of each error in a section of class `kind`.

    An unknown key may be meant as one of `keys`, or belong to another model, whose class is one of `others`.
    """
    for number, detail in enumerate(error.errors()):
        if number == MOST_TOLD:
            yield "", f"and {error.error_count() - number:,} more"
            return
        given, wrong, context = detail["input"], detail["type"], detail.get("ctx", {})
        if wrong == "too_short" and len(given) >= context["min_length"]:  # pydantic leaves wrong elements out
            continue
        path, around, classes = _place([str(part) for part in detail["loc"] if part != "[key]"], kind)
        key, tag = ".".join(path), tagged(classes[0])[0] if classes else ""
        words = (words for words, types in ALLOWED.items() if wrong in types.split())
        allowed = next(words, "another kind of value").format(**context)
        near = None
        if tag and wrong in ("union_tag_invalid", "union_tag_not_found", "model_attributes_type"):
            names = [name for each in classes for name in tagged(each)[1]]
            near, allowed = nearest_name(context.get("tag", ""), names), f"a mapping with {tag}: {' or '.join(names)}"
        elif allowed in ("a list", "a mapping of keys to values"):
            allowed += _also(given, key, allowed, around)
        said = f"is {short_yaml(given)}{f', did you mean {near!r}?' if near else ''}; allowed: {allowed}"
        if wrong == "missing":
            said = "is missing"
        elif wrong == "extra_forbidden":
            field = next((part for part in path[-2::-1] if not part.isdecimal()), "")
            kinds = [*kinds_with(path[-1], field, classes if tag else around)]
            if not kinds and (owner := _owner(path, others)):
                yield key, f"{key}: belongs to model: {owner}; give that model, or leave it out"
                continue
            known = list(around[0].model_fields) if around else []
            inside = [each for each in keys if each.startswith("".join(f"{part}." for part in path[:-1]))]
            other = f"; for another {tag}, give the whole section" if tag else ""
            said = f"{guess(path[-1], known, inside, kinds)}; allowed: {comma_list(known)}{other}"
        elif wrong == "value_error" and isinstance(given, dict):  # of a whole section: what is said names the key
            said = allowed
        yield key or said.split()[0], f"{key}: {said}" if key else said


def _also(given: Any, key: str, allowed: str, around: Sequence[type[ConfigModel]]) -> str:
    """Return the end of a phrase for a list or a mapping of keys: null is allowed, too, or something else was meant."""
    field = around[0].model_fields.get(key.rpartition(".")[2]) if around else None
    classes = section_classes(field.annotation) if field else []
    if field and type(None) in get_args(field.annotation):
        return " or null"
    if classes and isinstance(given, Mapping):
        return f", such as [{short_yaml(given)}]"
    is_number = len(classes) == 1 and "count" in classes[0].model_fields and type(given) is int
    section = f"{key}.0" if allowed == "a list" else key
    return f"; for their number, give {section}.count" if is_number else ""


def _owner(path: Sequence[str], kinds: Sequence[type[ConfigModel]]) -> str | None:
    have = [kind for kind in kinds if any(path[-1] in section.model_fields for section in _place(path, kind)[1])]
    return next((model for kind in have for model in get_args(kind.model_fields["model"].annotation)), None)


def _place(
    location: Sequence[str], kind: type[ConfigModel]
) -> tuple[list[str], list[type[ConfigModel]], list[type[ConfigModel]]]:
    """Return the path of an error, the class of the section around it, and the classes of a section on it with a tag.

    Pydantic's location also has the tag of each section that may be of several classes.
    """
    path: list[str] = []
    here, around, several = [kind], [kind], list[type[ConfigModel]]()
    for part in location:
        if re.fullmatch(r"(literal|function-\w+)\[.*\]", part):  # pydantic's name of a type in a union
            continue
        if len(here) > 1 and (chosen := [each for each in here if part in tagged(each)[1]]):
            here = chosen
            continue
        path.append(part)
        if not part.isdecimal():  # numbers are places in a list of sections
            around = here
            field = here[0].model_fields.get(part) if here else None
            here = section_classes(field.annotation) if field else []
            several = here if len(here) > 1 else several
    return path, around, several
