"""The numbers of the page of public questions are those that jounce computes."""

import pathlib
import re

import pytest

from tests.docs.questions import ANSWERS

PAGE = (pathlib.Path(__file__).parents[2] / "docs" / "questions.md").read_text()
ROWS = {int(row[0]): row for row in re.findall(r"^\| (\d+) \| (.+) \| (.+) \| (.+) \|$", PAGE, re.MULTILINE)}
NUMBER = re.compile(r"(?<![\^\w.])-?\d+(?:\.\d+)?")


def test_there_are_thirty_questions_each_with_its_source():
    assert sorted(ROWS) == sorted(ANSWERS) == list(range(1, 31))
    assert all(re.search(r"\]\(https?://", row[1]) for row in ROWS.values())


@pytest.mark.slow
@pytest.mark.parametrize("number", ANSWERS)
def test_the_answer_on_the_page_is_that_of_jounce(number):
    stated, found = NUMBER.findall(ROWS[number][3]), ANSWERS[number]()
    for text, value in zip(stated, found, strict=True):
        digits = len(text.partition(".")[2])
        assert abs(float(text) - value) <= 0.51 * 10.0**-digits, ROWS[number][1]
