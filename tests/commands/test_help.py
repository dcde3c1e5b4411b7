"""--help: every option has its sentence and its default, each command two examples."""

from importlib import import_module

import pytest

VERBS = ("explain", "simulate", "label", "export", "train")


@pytest.mark.parametrize("verb", VERBS)
def test_every_option_is_explained(verb):
    parser = import_module(f"galileo_jax.commands.{verb}")._parser()
    for action in parser._actions:
        assert action.help, action.option_strings
        if action.option_strings and not action.required and action.dest != "help":
            assert "default" in action.help, action.option_strings


@pytest.mark.parametrize("verb", VERBS)
def test_there_are_two_examples(verb, capsys):
    with pytest.raises(SystemExit):
        import_module(f"galileo_jax.commands.{verb}").main(["--help"])
    text = capsys.readouterr().out
    assert text.split("examples:\n")[1].count(f"  galileo {verb} ") == 2
    assert max(map(len, text.splitlines())) <= 100
