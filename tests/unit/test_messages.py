"""Messages: what is valid passes in MessagePack and JSON, all else is refused with a reason."""

import re
from itertools import chain
from pathlib import Path

import msgspec
import pytest
from phototaxis.geometry.arena import Arena
from phototaxis.runtime.options import field_help
from phototaxis.wire import document, messages
from phototaxis.wire.codec import Decoder, Refused, encode
from phototaxis.wire.messages import SCHEMA, AgentLog, Command, Control, Message, SensorsLog

GOOD = {"run": "r", "tick": 3, "author": "a", "left": 0.5, "right": -1.0}
decode = Decoder(Command, 200)
MESSAGES = [kind for kind in vars(messages).values() if isinstance(kind, type) and issubclass(kind, Message)]
PAGE = Path(__file__).parents[2] / "docs" / "wire.md"


def packed(**changes) -> bytes:
    return msgspec.msgpack.encode({**GOOD, **changes})


def test_messagepack_and_json_give_the_same_message():
    command = Command(run="r", tick=3, author="a", left=0.5, right=-1.0)
    assert decode(encode(command)) == command
    assert decode(msgspec.json.encode(command)) == command
    assert decode(msgspec.json.encode(GOOD)) == command


@pytest.mark.parametrize(
    ("payload", "reason"),
    [
        (packed(left=float("nan")), "invalid"),
        (packed(left=1.01), "invalid"),
        (packed(left=float("inf")), "invalid"),
        (packed(tick=-1), "invalid"),
        (packed(wheels=3), "invalid"),
        (packed(schema=SCHEMA + 1), f"schema: theirs is {SCHEMA + 1}, ours {SCHEMA}"),
        (msgspec.msgpack.encode({"schema": 9, "something": "else"}), "schema: theirs is 9"),
        (packed(author="x" * 300), "oversized"),
        (packed(author="x" * 65), "invalid"),
        (b"", "malformed"),
        (b"\xc1garbage", "malformed"),
        (b'{"run": "r", "tick"', "malformed"),
        (b"\x93\x01\x02\x03", "malformed"),
        (b"\x81" * 150, "malformed"),
    ],
)
def test_what_is_not_a_command_is_refused(payload, reason):
    with pytest.raises(Refused, match=reason):
        decode(payload)


@pytest.mark.parametrize("seed", [-1, 2**53 + 1])
def test_a_seed_that_cannot_be_one_is_refused_at_the_door(seed):
    with pytest.raises(Refused, match="seed"):
        Decoder(Control, 1000)(encode(Control(verb="begin", seed=seed)))


def test_a_log_whose_columns_do_not_fit_its_ticks_is_refused():
    good = msgspec.to_builtins(AgentLog(
        run="r", seq=0, writer="w", learner="mine", percept="camera", tick=[0, 1], state=[0, 0], action=[4, 4],
        reward=[0.0] * 2, td_error=[0.0] * 2, temperature=[1.0] * 2,
    ))  # fmt: skip
    assert Decoder(AgentLog, 10_000)(msgspec.msgpack.encode(good)).percept == "camera"
    for change in ({"reward": [0.0]}, {"tick": [], "state": []}, {"tick": [-1, 0]}, {"tick": [0, 2**63]}):
        with pytest.raises(Refused, match="invalid"):
            Decoder(AgentLog, 10_000)(msgspec.msgpack.encode({**good, **change}))
    readings = SensorsLog(
        run="r", seq=0, writer="w", sonar_model="built-in", light_model="built-in", tick=[0], sonar=[1.0] * 16,
        light=[0.5] * 2,
    )  # fmt: skip
    broken = {**msgspec.to_builtins(readings), "sonar": [1.0] * 15}
    with pytest.raises(Refused, match="sonar has 15 values for 1 ticks"):
        Decoder(SensorsLog, 10_000)(msgspec.msgpack.encode(broken))


@pytest.mark.parametrize("kind", MESSAGES)
def test_the_fields_of_a_message_are_given_by_keyword(kind):
    with pytest.raises(TypeError, match="Extra positional arguments"):
        kind("r")


@pytest.mark.parametrize("kind", document.structs(*MESSAGES))
def test_each_field_has_a_sentence_of_its_own(kind):
    texts = field_help(kind)
    assert texts.keys() == {field.name for field in msgspec.structs.fields(kind)}
    assert len({*texts.values()}) == len(texts)
    for name, text in texts.items():
        assert re.fullmatch(r"[A-Z].{14,}[.]", text, re.DOTALL), f"{name}: {text}"


def test_the_structs_of_an_arena_are_among_the_parts_of_messages():
    assert set(document.structs(Arena)) < set(document.structs(*MESSAGES))


def test_the_page_about_the_wire_format_is_up_to_date_and_has_no_empty_cell():
    page = PAGE.read_text(encoding="utf-8")
    assert page == document.page()
    rows = [line for line in page.splitlines() if line.startswith("|")]
    cells = [*chain.from_iterable(row.strip("|").split("|") for row in rows)]
    assert len(cells) > 500
    assert all(cell.strip() for cell in cells)
