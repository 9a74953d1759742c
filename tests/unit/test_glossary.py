"""The glossary: each term has one plain sentence, and each name of code that it claims exists."""

import importlib
import re
from pathlib import Path

import pytest

PAGE = Path(__file__).parents[2] / "docs" / "glossary.md"
ROWS = [
    [cell.strip() for cell in line.strip("|").split("|")]
    for line in PAGE.read_text("utf-8").splitlines()
    if line.startswith("| ")
][1:]


def found(name: str) -> object:
    """What a dotted name stands for: a module, or something in one."""
    module, _, rest = name.rpartition(".")
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError:
        holder = found(module)
    return getattr(holder, rest) if hasattr(holder, rest) else holder.__annotations__[rest]


@pytest.mark.parametrize(("term", "sentence", "code"), ROWS, ids=[row[0] for row in ROWS])
def test_a_term_has_one_sentence_and_its_code_exists(term: str, sentence: str, code: str):
    assert re.fullmatch(r"[A-Z][^.]*\.", sentence), f"{term}: one sentence"
    names = re.findall("`([^`]+)`", code)
    assert names
    for name in names:
        assert found(name) is not None


def test_terms_stand_once_and_in_order():
    terms = [term for term, _, _ in ROWS]
    assert terms == sorted(set(terms))
    assert len(terms) > 40


def test_a_name_that_does_not_exist_is_found_out():
    with pytest.raises(KeyError):
        found("phototaxis.wire.messages.State.magic")
