"""Errors of other programs in one line."""

from __future__ import annotations

import pytest

from conevo.errors import in_a_line


def test_an_error_without_words_has_the_statement_that_raised_it() -> None:
    with pytest.raises(ZeroDivisionError) as raised:
        raise ZeroDivisionError
    assert in_a_line(raised.value) == "ZeroDivisionError: raise ZeroDivisionError"
    assert in_a_line(ZeroDivisionError()) == "ZeroDivisionError"
    assert in_a_line(ZeroDivisionError("two\nlines")) == "ZeroDivisionError: two lines"
