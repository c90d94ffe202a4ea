"""The main panel of the page: message, time, parameters and exports."""

from __future__ import annotations

import contextlib
from typing import Any

import numpy as np

from jounce.errors import JounceError
from jounce.viewer.page.exports import animation, file_name, picture, table
from jounce.viewer.page.legend import error_box, status_line
from jounce.viewer.page.page import Observer, Page
from jounce.viewer.shapes.recording import Parameter, Recording

SPEEDS = ("0.05", "0.1", "0.25", "0.5", "1", "2", "4")


class Panel(Observer):
    """Controls of time, parameters and exports.

    Parameters
    ----------
    page : Page
        The page.
    """

    def __init__(self, page: Page):
        self.page, self.gui = page, page.server.gui
        self._busy = False
        self._sliders: dict[str, Any] = {}
        self._numbers: dict[str, Any] = {}
        self.message = self.gui.add_html("", visible=False)
        self._add_time()

    def _add_time(self) -> None:
        gui, player = self.gui, self.page.player
        self.time = gui.add_slider("time (s)", *self._interval(), player.start)
        self.time.on_update(lambda event: self._seek(event))
        self.play = gui.add_button("Play", icon="player-play", hint="Play or pause")
        self.play.on_click(lambda _: self.set_playing(not player.playing))
        self.speed = gui.add_dropdown("speed", SPEEDS, initial_value="1")
        self.speed.on_update(lambda _: setattr(player, "speed", float(self.speed.value)))
        self.loop = gui.add_checkbox("loop", True)
        self.loop.on_update(lambda _: setattr(player, "loop", bool(self.loop.value)))
        self.status = gui.add_html("")
        self._say_status()

    def _interval(self) -> tuple[float, float, float]:
        """Return the ends and the step of the time slider, s."""
        player = self.page.player
        return player.start, max(player.stop, player.start + 1e-9), _step(player.stop - player.start)

    def _seek(self, event: Any) -> None:
        if event.client is not None:  # the user, not the player
            self.page.seek(float(self.time.value))

    def set_playing(self, playing: bool) -> None:
        """Play or pause."""
        player = self.page.player
        if playing and not player.loop and player.now >= player.stop:
            player.now = player.start
        player.playing = playing
        self.play.label = "Pause" if playing else "Play"
        self.play.icon = "player-pause" if playing else "player-play"

    def add_parameters(self) -> None:
        """Add a slider for each parameter, number fields for exact values, and dependent parameters."""
        gui, parameters = self.gui, self.page.session.subject.parameters
        if not parameters:
            gui.add_markdown(self.page.session.subject.no_sliders)
            return
        groups = dict.fromkeys(p.group for p in parameters)
        for group in groups:
            with gui.add_folder(group, expand_by_default=len(groups) < 3) if group else contextlib.nullcontext():
                for parameter in parameters:
                    if parameter.group == group and not parameter.derived:
                        self._add_slider(parameter)
        gui.add_button("Reset", icon="rotate", hint="All values as in the file").on_click(lambda _: self._reset())
        with gui.add_folder("Exact values (SI)", expand_by_default=False):
            for parameter in parameters:
                self._add_number(parameter)

    def _add_slider(self, parameter: Parameter) -> None:
        step = 1 if parameter.whole else _step(parameter.high - parameter.low)
        hint = f"{parameter.name}, SI units; {parameter.value:.6g} in the file"
        slider = self._sliders[parameter.name] = self.gui.add_slider(
            parameter.label, parameter.low, parameter.high, step, parameter.value, hint=hint
        )
        slider.on_update(lambda event: self._changed(parameter.name, event))

    def _add_number(self, parameter: Parameter) -> None:
        step = 1 if parameter.whole else _step(abs(parameter.value) or 1.0)
        number = self._numbers[parameter.name] = self.gui.add_number(
            parameter.label, parameter.value, step=step, disabled=parameter.derived
        )
        if not parameter.derived:
            number.on_update(lambda event: self._changed(parameter.name, event))

    def _changed(self, name: str, event: Any) -> None:
        """Apply a value that the user has set with a slider or typed."""
        if event.client is not None:
            self._put(name, float(event.target.value), but=event.target)
            self.page.session.request({name: float(event.target.value)})

    def _put(self, name: str, value: float, but: Any = None) -> None:
        """Show a value of a parameter in all controls but its source, widening the slider if necessary."""
        slider, number = self._sliders[name], self._numbers[name]
        if number is not but:
            number.value = value
        if slider is not but:
            slider.min, slider.max = min(slider.min, value), max(slider.max, value)
            slider.value = value

    def _reset(self) -> None:
        values = {p.name: p.value for p in self.page.session.subject.parameters if not p.derived}
        for name, value in values.items():
            self._put(name, value)
        self.page.session.request(values)

    def add_exports(self) -> None:
        """Add the export buttons."""
        gui = self.gui
        csv = gui.add_button("Table (CSV)", icon="table-export", hint="All outputs with their derivatives")
        csv.on_click(lambda event: self._send(event, ".csv", lambda _: table(self.page.recording)))
        png = gui.add_button("Picture (PNG)", icon="photo", hint="What this browser shows of the scene")
        png.on_click(lambda event: self._send(event, ".png", picture))
        html = gui.add_button("Animation (HTML)", icon="movie", hint="One file that plays in any browser, offline")
        html.on_click(lambda event: self._send(event, ".html", lambda _: animation(self.page.overlay).encode()))

    def _send(self, event: Any, ending: str, make: Any) -> None:
        """Create a file and send it to the browser that requested it."""
        try:
            content = make(event.client)
        except JounceError as error:
            event.client.add_notification("Nothing was exported", str(error), color="red", auto_close_seconds=10)
            return
        event.client.send_file_download(file_name(self.page.recording.title, ending), content, save_immediately=True)

    def on_recording(self, recording: Recording) -> None:
        """Adapt the controls to a new motion."""
        self.message.visible = False
        self.time.min, self.time.max, self.time.step = self._interval()
        self.time.value = self.page.player.now
        for name, number in self._numbers.items():
            if number.disabled and name in recording.values:
                number.value = recording.values[name]
        self._say_status()

    def on_failure(self, error: JounceError) -> None:
        """Show the error of a motion that failed."""
        self.message.content = error_box(str(error))
        self.message.visible = True
        self._say_status()

    def on_busy(self, busy: bool) -> None:
        """Show that the solver works if it takes a while."""
        self._busy = busy
        if not busy or self.page.session.elapsed > 0.3:
            self._say_status()

    def on_time(self, instant: float) -> None:
        """Follow the player."""
        self.time.value = float(np.clip(instant, self.time.min, self.time.max))
        if self.play.label == "Pause" and not self.page.player.playing:  # at the end
            self.set_playing(False)

    def _say_status(self) -> None:
        session = self.page.session
        self.status.content = status_line(self.page.recording, session.elapsed, self._busy)


def _step(duration: float) -> float:
    """Return the step of a slider: a power of ten, at least a thousand of them.

    Examples
    --------
    >>> _step(2.0), _step(0.1321)
    (0.001, 0.0001)
    """
    return float(10.0 ** np.floor(np.log10(duration / 1000 * (1 + 1e-9)))) if duration > 0 else 1e-3
