"""Words errors plainly: what was expected, without type names, and the nearest name that exists."""

import re
from collections.abc import Iterable
from difflib import get_close_matches
from traceback import extract_tb

WORD = "letters, digits, '.', '_' and '-'"
"""The form of names on the bus."""
FORM = "a text of another form"
"""A placeholder for a regular expression; errors replace it with the `Meta` description of the type."""

_KINDS = {
    "int": "a whole number",
    "float": "a number",
    "bool": "true or false",
    "str": "a text",
    "array": "a list",
    "object": "a table of names and values",
    "null": "nothing",
}
_BOUNDS = {">=": "of at least", "<=": "of at most", ">": "above", "<": "below", None: "of"}


def plain(text: str) -> str:
    """Translate an error text of msgspec into plain words, without type names and regular expressions."""
    text = re.sub(r"`str` matching regex .*?(?=$| - at )", FORM, text)
    text = re.sub(r"`(\w+(?: \| \w+)*)`", lambda found: _kind(found[1]), text)
    text = re.sub(r"of length ([<>]=)? ?(\d+)", lambda found: f"{_BOUNDS[found[1]]} {found[2]} characters", text)
    text = re.sub(r"(a list .*)characters", r"\1entries", text)
    text = re.sub(r" ([<>]=?) (?=[-\d])", lambda found: f" {_BOUNDS[found[1]]} ", text)
    text = re.sub(r"Invalid enum value ('.*')", r"\1 is not one of the choices", text)
    return text.replace("Expected", "expected")


def _kind(names: str) -> str:
    return " or ".join(_KINDS.get(name, name) for name in names.split(" | ") if name != "null")


def nearest(word: str, choices: Iterable[str]) -> str:
    """ "did you mean CHOICE? " for the choice that `word` resembles most; "" when it resembles none."""
    there = {choice.casefold(): choice for choice in choices}
    found = get_close_matches(word.casefold(), there, n=1, cutoff=0.67)
    return f"did you mean {there[found[0]]}? " if found else ""


def known(word: str, choices: Iterable[str]) -> str:
    """A list of the valid choices, after a suggestion of the nearest to `word`."""
    there = list(choices)
    return f"{nearest(word, there)}there are: {', '.join(there) or 'none'}"


def told(error: BaseException, file: str | None = None) -> str:
    """Describe a plug-in's exception in one line: type, text, and the last place in `file`, or else the last place."""
    frames = [frame for frame in extract_tb(error.__traceback__)[1:] if "importlib" not in frame.filename]
    frames = [frame for frame in frames if frame.filename == file] or frames
    place = f" ({frames[-1].filename}, line {frames[-1].lineno})" if frames else ""
    text = " ".join(str(error).split())
    return f"{type(error).__name__}{': ' * bool(text)}{text}{'' if isinstance(error, SyntaxError) else place}"
