"""Errors of other programs in one line."""

from __future__ import annotations

import pytest

from conevo.cli.main import cli, main
from conevo.errors import in_a_line


def test_an_error_without_words_has_the_statement_that_raised_it() -> None:
    with pytest.raises(ZeroDivisionError) as raised:
        raise ZeroDivisionError
    assert in_a_line(raised.value) == "ZeroDivisionError: raise ZeroDivisionError"
    assert in_a_line(ZeroDivisionError()) == "ZeroDivisionError"
    assert in_a_line(ZeroDivisionError("two\nlines")) == "ZeroDivisionError: two lines"


@pytest.mark.parametrize(
    ("error", "line"),
    [(ValueError("cannot close"), "conevo: error: interrupted\n"), (SystemExit(130), "")],
)
def test_an_error_raised_while_an_interrupt_is_handled_is_the_interrupt(
    error: BaseException,
    line: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """An exit is not: the message has been printed."""

    def invoke(_: object) -> None:
        try:
            raise KeyboardInterrupt
        except KeyboardInterrupt:
            raise error from None

    monkeypatch.setattr(cli, "invoke", invoke)
    with pytest.raises(SystemExit) as ended:
        main(["list", "worlds"])
    assert ended.value.code == 130
    assert capsys.readouterr().err == line
