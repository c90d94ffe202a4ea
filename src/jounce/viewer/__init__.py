"""The web view: a mechanism or a robot in the browser, on this machine only, with arrows, plots and live parameters."""

from jounce.viewer.server import View as View, view as view
