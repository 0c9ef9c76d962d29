"""The examples in the docstrings of public names run and print what they say."""

from __future__ import annotations

import doctest

import pytest

import schuler

FINDER = doctest.DocTestFinder(recurse=False)
FLAGS = doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS


def examples(name: str) -> list[doctest.DocTest]:
    found = FINDER.find(getattr(schuler, name), name, globs={})
    return [test for test in found if test.examples]


WITH_EXAMPLES = [name for name in schuler.__all__ if examples(name)]


def test_every_public_name_has_an_example() -> None:
    assert set(schuler.__all__) == set(WITH_EXAMPLES)


@pytest.mark.parametrize("name", WITH_EXAMPLES)
def test_examples_run_as_printed(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    runner = doctest.DocTestRunner(optionflags=FLAGS)
    for test in examples(name):
        runner.run(test)
    assert runner.summarize(verbose=False).failed == 0, capsys.readouterr().out
