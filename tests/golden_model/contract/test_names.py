"""Names that a language keeps for itself are refused, and the lists of them are those of others."""

import re

import numpy as np
import pytest

from lightloom.golden_model.contract.formats import F4
from lightloom.golden_model.contract.interfaces import Unit
from lightloom.golden_model.contract.names import KEYWORDS, OF_FIELDS, OF_PORTS, OF_REGISTERS, check_name
from tests.needs import need_package

EXAMPLES = {
    "SystemVerilog": ("output", "begin", "logic", "release"),
    "VHDL": ("signal", "register", "range", "release"),
    "SystemRDL": ("field", "signal", "int", "rw", "level"),
    "C": ("register", "int", "restrict", "default"),
    "C++": ("class", "new", "template", "xor"),
    "Python": ("class", "lambda", "is", "pass"),
}


@pytest.mark.parametrize(
    ("language", "name"), [(language, name) for language, names in EXAMPLES.items() for name in names]
)
def test_a_keyword_is_refused(language: str, name: str) -> None:
    with pytest.raises(ValueError, match=rf"^port '{name}': a keyword of .*{re.escape(language)}(,.*)?; choose"):
        check_name("port", name, OF_PORTS)
    for languages in (OF_PORTS, OF_FIELDS, OF_REGISTERS):
        if language in languages:
            with pytest.raises(ValueError, match="a keyword of"):
                check_name("field", name, languages)


@pytest.mark.parametrize("name", ["", "Ready", "two__words", "end_", "_begins", "2nd", "a-b", "größe", "a.b"])
def test_what_is_no_word_everywhere_is_refused(name: str) -> None:
    with pytest.raises(ValueError, match=f"^port {re.escape(repr(name))}: a name is words of a to z"):
        check_name("port", name, OF_PORTS)


@pytest.mark.parametrize("name", ["go", "count_2", "registers", "operand_v0_1", "class_of"])
def test_other_words_are_not(name: str) -> None:
    check_name("port", name, OF_PORTS)


PLAIN, TAKEN = np.dtype([("a", F4)]), np.dtype([("class", F4)])


def test_a_unit_refuses_its_own_name() -> None:
    with pytest.raises(ValueError, match=r"^unit 'buffer': a keyword of VHDL; choose another name$"):
        Unit(name="buffer", summary="", input=PLAIN, output=PLAIN)


@pytest.mark.parametrize(("operands", "results"), [(TAKEN, PLAIN), (PLAIN, TAKEN)])
def test_a_unit_refuses_fields(operands: np.dtype, results: np.dtype) -> None:
    with pytest.raises(ValueError, match=r"^unit sum: field 'class': a keyword of C\+\+, Python; choose another name$"):
        Unit(name="sum", summary="", input=operands, output=results)


# --- the lists --------------------------------------------------------------------------------------------------------


def test_keywords_of_systemverilog_are_those_of_a_maker_of_register_blocks() -> None:
    listed = need_package("peakrdl_regblock.identifier_filter", "pip install peakrdl-regblock")
    assert KEYWORDS["SystemVerilog"] == listed.SV_KEYWORDS


def test_keywords_of_systemrdl_are_those_of_its_compiler() -> None:
    lexer = need_package("systemrdl.parser.SystemRDLLexer", "pip install systemrdl-compiler")
    literals = lexer.SystemRDLLexer.literalNames
    assert KEYWORDS["SystemRDL"] == {text.strip("'") for text in literals if re.fullmatch(r"'[a-z_0-9]+'", text)}


def test_keywords_of_vhdl_hold_those_of_pygments() -> None:
    """It has those of 1993."""
    from pygments.lexers.hdl import VhdlLexer

    words = {word for rule in VhdlLexer.tokens["keywords"] for word in rule[0].words}
    assert len(words) > 90
    assert words <= KEYWORDS["VHDL"]


@pytest.mark.parametrize("language", ["C", "C++"])
def test_keywords_of_c_are_none_of_pygments_names(language: str) -> None:
    from pygments.lexers import get_lexer_by_name
    from pygments.token import Name

    plain = [word for word in KEYWORDS[language] if (Name, word) in get_lexer_by_name(language).get_tokens(word)]
    assert plain == []
