"""Command lines from Structs: a field is an option, its docstring or description the help, its type the check."""

import argparse
import ast
import functools
import inspect
import textwrap
import types
import typing
from collections.abc import Mapping, Sequence
from itertools import pairwise
from types import MappingProxyType
from typing import Any, TypeVar

import msgspec

from phototaxis.errors import UserError

T = TypeVar("T", bound=msgspec.Struct)


@functools.cache
def field_help(struct: type) -> dict[str, str]:
    """The string under each field of a Struct or dataclass, as the attribute docstring it is."""
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

    `defaults` are what the help says in place of the Struct's own. Left out on the command line, a field
    keeps its default. Booleans are flags; lists may be repeated. Values are checked in `parse`, so that the
    messages come from one place.
    """
    texts = field_help(struct)
    for item in msgspec.structs.fields(struct):
        plain, choices = _plain(item.type)
        default = defaults.get(item.name, None if item.default is msgspec.NODEFAULT else item.default)
        hidden = item.name in positional or default is False or default in (None, "")
        shown = "" if hidden else f" (default {default})"
        help_text = (texts.get(item.name, "") + shown).replace("%", "%%")
        flag = "--" + item.name.replace("_", "-")
        metavar = "|".join(choices) if choices else item.name.upper()
        if item.name in positional:
            optional: dict[str, Any] = {} if item.required else {"nargs": "?", "default": argparse.SUPPRESS}
            parser.add_argument(item.name, help=help_text, metavar=metavar, **optional)
        elif plain is bool:
            parser.add_argument(flag, help=help_text, action="store_true", default=argparse.SUPPRESS)
        elif typing.get_origin(plain) is list:
            parser.add_argument(flag, help=help_text, action="append", default=argparse.SUPPRESS, metavar=metavar)
        else:
            parser.add_argument(flag, help=help_text, default=argparse.SUPPRESS, metavar=metavar)


def _plain(kind: Any) -> tuple[Any, list[str]]:
    """The type inside Annotated and Optional, and the choices of a Literal."""
    while typing.get_origin(kind) is typing.Annotated:
        kind = typing.get_args(kind)[0]
    if typing.get_origin(kind) in (typing.Union, types.UnionType):
        kind = next(k for k in typing.get_args(kind) if k is not type(None))
        return _plain(kind)
    if typing.get_origin(kind) is typing.Literal:
        return str, [str(choice) for choice in typing.get_args(kind)]
    return kind, []


def convert(struct: type[T], values: dict[str, Any]) -> T:
    """A Struct from option texts; what does not fit is one line that names the option.

    Raises
    ------
    UserError
        when a value is of the wrong type or out of range.
    """
    known = {item.name for item in msgspec.structs.fields(struct)}
    given = {key: value for key, value in values.items() if key in known}
    for item in msgspec.structs.fields(struct):
        if item.name in given:
            flag, choices = item.name.replace("_", "-"), _plain(item.type)[1]
            if choices and given[item.name] not in choices:
                raise UserError(f"--{flag} {given[item.name]}: no such {flag}; there are: {', '.join(choices)}")
            try:
                msgspec.convert(given[item.name], item.type, strict=False)
            except msgspec.ValidationError as error:
                raise UserError(f"--{flag} {given[item.name]}: {error}") from None
    return msgspec.convert(given, struct, strict=False)


class Parser(argparse.ArgumentParser):
    """argparse whose errors are one line and whose long options may not be abbreviated."""

    def __init__(self, *args: Any, **kwargs: Any):
        super().__init__(*args, allow_abbrev=False, **kwargs)

    def error(self, message: str) -> typing.NoReturn:
        raise UserError(f"{message} (see {self.prog} --help)")


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
) -> list[Any]:
    """Read a command line into several Structs, shown under their titles in the help.

    `defaults` take the place of the Structs' own.
    """
    parser = Parser(prog=prog, description=about)
    for title, struct in structs.items():
        add_options(parser.add_argument_group(title) if title else parser, struct, positional, defaults)
    values = {**defaults, **vars(parser.parse_args(argv))}
    return [convert(struct, values) for struct in structs.values()]


def peek(argv: Sequence[str], flag: str, default: str) -> str:
    """The value of one option before the rest is known (which options there are may depend on it)."""
    value = default
    for here, following in pairwise([*argv, ""]):
        if here == flag:
            value = following
        elif here.startswith(flag + "="):
            value = here.partition("=")[2]
    return value


def flags(struct: Any) -> list[str]:
    """A Struct as command-line flags, for a child process; what equals the default is left out."""
    words: list[str] = []
    for item in msgspec.structs.fields(struct):
        value = getattr(struct, item.name)
        flag = "--" + item.name.replace("_", "-")
        if value == item.default or (item.default is msgspec.NODEFAULT and value in ([], {})):
            continue
        if isinstance(value, bool):
            words.append(flag)
        elif isinstance(value, list):
            words += [f"{flag}={one}" for one in value]
        else:
            words.append(f"{flag}={value}")
    return words
