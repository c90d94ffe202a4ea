"""What a step of a slider makes of a peak, against differences of refined peaks."""

import pytest

import jounce as jn
from jounce.errors import JounceError
from jounce.reporting.peaks import peaks
from jounce.viewer import View
from jounce.viewer.subjects.mechanisms import MechanismSubject
from jounce.viewer.subjects.slopes import can_be_differentiated, peak_slopes, slopes_html
from tests.problems.mechanisms import example

FOUR_BAR = jn.load(example("four_bar"))


@pytest.mark.slow
@pytest.mark.parametrize("name, order", [("C_x", 3), ("psi", 4)])
def test_slopes_are_differences_of_peaks(name, order):
    def height(length):
        found = [p for p in peaks(jn.solve(FOUR_BAR.with_parameters(BC=length), order=4)) if p.output == name][order]
        return max(-found.minimum, found.maximum)

    found, step, length = peak_slopes(jn.solve(FOUR_BAR, order=4), name, order), 1e-5, 0.1423
    assert found.peak == pytest.approx(height(length), rel=1e-9)
    slope = (height(length + step) - height(length - step)) / (2 * step)
    assert found.slopes["BC"] == pytest.approx(slope, rel=1e-4)
    assert set(found.slopes) == set(FOUR_BAR.parameters)


@pytest.mark.slow
def test_the_page_tells_them_and_follows_a_slider():
    with View(MechanismSubject(FOUR_BAR), port=0, order=2, playing=False) as view:
        view.slopes.output.value = "psi"
        assert view.page.session.wait(120.0)
        assert "BC +1 mm: " in view.slopes.text.content
        assert "tau +1 %: " in view.slopes.text.content
        before = view.slopes.text.content
        view.page.session.request({"BC": 0.15})
        assert view.page.session.wait(120.0)
        assert view.slopes.text.content.startswith("peak ")
        assert view.slopes.text.content != before


@pytest.mark.slow
def test_what_has_no_slopes():
    motion = jn.solve(FOUR_BAR, [0.0, 0.1], order=1)
    with pytest.raises(JounceError, match="psi"):
        peak_slopes(motion, "pis", 1)
    assert can_be_differentiated(MechanismSubject(FOUR_BAR))
    assert not can_be_differentiated(MechanismSubject(jn.load(example("double_pendulum"))))
    pressed = MechanismSubject(jn.load(example("servo_press"))).solve({}, 1)
    assert slopes_html(pressed, next(iter(pressed.solution.outputs)), 1).startswith("No slopes: ")
