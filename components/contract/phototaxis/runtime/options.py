"""Makes command lines from Structs: each field is an option, its docstring is the help, its type the check."""

import argparse
import ast
import functools
import inspect
import math
import re
import textwrap
import types
import typing
from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import pairwise
from types import MappingProxyType
from typing import Any, TypeVar, cast

import msgspec

from phototaxis.runtime.errors import UserError
from phototaxis.runtime.phrases import FORM, known, nearest, plain

T = TypeVar("T", bound=msgspec.Struct)


@functools.cache
def field_help(struct: type) -> dict[str, str]:
    """The docstring of each field of a Struct or dataclass, by the field's name."""
    texts: dict[str, str] = {}
    for base in reversed(struct.__mro__[:-1]):
        try:
            body = ast.parse(textwrap.dedent(inspect.getsource(base))).body[0]
        except (OSError, TypeError):
            continue
        statements = getattr(body, "body", [])
        for before, after in pairwise(statements):
            if (
                isinstance(before, ast.AnnAssign)
                and isinstance(before.target, ast.Name)
                and isinstance(after, ast.Expr)
                and isinstance(after.value, ast.Constant)
            ):
                texts[before.target.id] = " ".join(str(after.value.value).split())
    return texts


def add_options(
    parser: Any, struct: type, positional: Sequence[str] = (), defaults: Mapping[str, Any] = MappingProxyType({})
) -> None:
    """Give `parser` (or an argument group) one option for each field of `struct`.

    The help shows `defaults` in place of the Struct's own. An option that is left out keeps its default. Booleans
    are flags (`--no-…` for those that are true by default); options with lists may be repeated. `parse` checks the
    values, so that all error messages come from one place.
    """
    texts = field_help(struct)
    for item in msgspec.structs.fields(struct):
        kind, choices = _inner(item.type)
        default = defaults.get(item.name, None if item.default is msgspec.NODEFAULT else item.default)
        hidden = item.name in positional or default is False or default in (None, "")
        shown = "" if hidden else f" (default {default})"
        help_text = (texts.get(item.name, "") + shown).replace("%", "%%")
        flag = "--" + item.name.replace("_", "-")
        metavar = "|".join(choices) if choices else item.name.upper()
        if item.name in positional:
            optional: dict[str, Any] = {} if item.required else {"nargs": "?", "default": argparse.SUPPRESS}
            parser.add_argument(item.name, help=help_text, metavar=metavar, **optional)
        elif kind is bool:
            action = argparse.BooleanOptionalAction if item.default is True else "store_true"
            parser.add_argument(flag, help=help_text, action=action, default=argparse.SUPPRESS)
        elif typing.get_origin(kind) is list:
            parser.add_argument(flag, help=help_text, action="append", default=argparse.SUPPRESS, metavar=metavar)
        else:
            parser.add_argument(flag, help=help_text, default=argparse.SUPPRESS, metavar=metavar)


def _inner(kind: Any) -> tuple[Any, list[str]]:
    """The type inside Annotated and Optional, and the choices of a Literal."""
    while typing.get_origin(kind) is typing.Annotated:
        kind = typing.get_args(kind)[0]
    if typing.get_origin(kind) in (typing.Union, types.UnionType):
        kind = next(k for k in typing.get_args(kind) if k is not type(None))
        return _inner(kind)
    if typing.get_origin(kind) is typing.Literal:
        return str, [str(choice) for choice in typing.get_args(kind)]
    return kind, []


def convert(struct: type[T], values: dict[str, Any], label: Callable[[str], str] = "--{}".format) -> T:
    """Make a Struct from the texts of options; an error is one line that names the option.

    `label` turns a field's name, with dashes, into the option's name for errors.

    Raises
    ------
    UserError
        when a value is of the wrong type or out of range, or a field without a default is missing.
    """
    fields = msgspec.structs.fields(struct)
    given = {item.name: values[item.name] for item in fields if item.name in values}
    for item in fields:
        name = item.name.replace("_", "-")
        if item.name in given:
            _check(item, name, given[item.name], label(name))
        elif item.required:
            raise UserError(f"{label(name)} is missing")
    try:
        return msgspec.convert(given, struct, strict=False)
    except msgspec.ValidationError as error:  # from the Struct's own __post_init__
        raise UserError(plain(str(error))) from None


def _check(item: msgspec.structs.FieldInfo, name: str, value: Any, label: str) -> None:
    choices = _inner(item.type)[1]
    if choices and value not in choices:
        raise UserError(f"{label} {value}: no such {name}; {known(str(value), choices)}")
    try:
        found = msgspec.convert(value, item.type, strict=False)
        problem = "expected a finite number" if isinstance(found, float) and not math.isfinite(found) else ""
    except msgspec.ValidationError as error:
        problem = re.sub(", got .*", "", plain(str(error)))
    if problem:
        form = next((meta.description for meta in _metas(item.type) if meta.description), FORM)
        raise UserError(f"{label} {value}: {problem.replace(FORM, form)}{_example(item)}")


def _example(item: msgspec.structs.FieldInfo) -> str:
    """A valid value for an error message: an example from the type's `Meta`, else the default."""
    example = next((meta.examples[0] for meta in _metas(item.type) if meta.examples), item.default)
    return f", as in {example}" if example != "" and isinstance(example, (int, float, str)) else ""


def _metas(kind: Any) -> list[msgspec.Meta]:
    """The `Meta` constraints on a type, also on an optional one."""
    found = [meta for one in (kind, *typing.get_args(kind)) for meta in getattr(one, "__metadata__", ())]
    return [meta for meta in found if isinstance(meta, msgspec.Meta)]


class Parser(argparse.ArgumentParser):
    """An argparse parser with one-line errors that suggest the nearest option; long options cannot be abbreviated.

    Parameters
    ----------
    more : further options to suggest, beside its own.
    see : the command whose `--help` lists the options; by default `prog`.
    """

    def __init__(self, *args: Any, more: Iterable[str] = (), see: str = "", **kwargs: Any):
        super().__init__(*args, allow_abbrev=False, **kwargs)
        self._more, self._see = [*more], see or self.prog

    def error(self, message: str) -> typing.NoReturn:
        message = re.sub("^argument (.*): ignored explicit argument (.*)$", r"\1 takes no value, got \2", message)
        raise UserError(f"{message.removeprefix('argument ')} (see {self._see} --help)")

    def read(self, argv: Sequence[str] | None) -> dict[str, Any]:
        """Read the given options, by field name; for an unknown one, raise UserError that suggests the nearest."""
        found, rest = self.parse_known_args(argv)
        if rest:
            word = next((word for word in rest if word.startswith("-")), rest[0]).split("=")[0]
            if not word.startswith("-"):
                self.error(f"'{word}' is one word too many")
            meant = nearest(word, self.option_strings).rstrip()
            self.error(f"no option {word}{'; ' * bool(meant)}{meant}")
        return vars(found)

    @property
    def option_strings(self) -> list[str]:
        """All options that may be given."""
        return [*self._option_string_actions, *self._more]


def parse(struct: type[T], argv: Sequence[str] | None, prog: str, about: str, positional: Sequence[str] = ()) -> T:
    """Read a command line into a Struct."""
    return parse_groups({"": struct}, argv, prog, about, positional)[0]


def parse_groups(
    structs: dict[str, type[Any]],
    argv: Sequence[str] | None,
    prog: str,
    about: str,
    positional: Sequence[str] = (),
    defaults: Mapping[str, Any] = MappingProxyType({}),
    more: Iterable[str] = (),
    see: str = "",
) -> list[Any]:
    """Read a command line into several Structs, shown under their titles in the help.

    `defaults` take the place of the Structs' own; `more` and `see` are the `Parser`'s.
    """
    parser = Parser(prog=prog, description=about, more=more, see=see)
    for title, struct in structs.items():
        add_options(parser.add_argument_group(title) if title else parser, struct, positional, defaults)
    values = {**defaults, **parser.read(argv)}
    label = {name: name.upper() for name in positional}
    return [convert(struct, values, lambda name: label.get(name, f"--{name}")) for struct in structs.values()]


def peek(argv: Sequence[str], flag: str, default: str) -> str:
    """Read one option before the others, because the set of options depends on it (such as `--learner`)."""
    value = default
    for here, following in pairwise([*argv, None]):
        if here == flag and following is not None:
            value = following
        elif here is not None and here.startswith(flag + "="):
            value = here.partition("=")[2]
    return value


def flags(struct: Any) -> list[str]:
    """Turn a Struct into command-line flags for a child process; defaults are left out."""
    words: list[str] = []
    for item in msgspec.structs.fields(struct):
        value = getattr(struct, item.name)
        flag = "--" + item.name.replace("_", "-")
        if value == item.default or (item.default is msgspec.NODEFAULT and value in ([], {})):
            continue
        if isinstance(value, bool):
            words.append(flag if value else f"--no-{flag[2:]}")
        elif isinstance(value, list):
            words += [f"{flag}={one}" for one in cast("list[object]", value)]
        else:
            words.append(f"{flag}={value}")
    return words
