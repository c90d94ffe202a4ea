"""The viewer: a local page for a mechanism or a robot, from a file or from Python."""

from __future__ import annotations

import time
from collections.abc import Iterable, Sequence
from os import PathLike, fspath
from pathlib import Path
from typing import Any, NamedTuple

from jounce.errors import JounceError
from jounce.kinematics import PlateCam
from jounce.mechanism import Mechanism
from jounce.robot import Robot
from jounce.viewer.page.local_server import AccessControl, check_installed, check_port, quiet_server, stop_silently

MECHANISM_FILES = (".yaml", ".yml", ".toml", ".json")


class View:
    """A served page.

    Parameters
    ----------
    subject : Subject
        The viewed object.
    port : int, default 0
        Port of this machine; 0 chooses a free one.
    order : int, default 4
        Highest derivative.
    playing : bool, default True
        Whether the motion plays at once.

    Attributes
    ----------
    url : str
        Address of the page, with the token required to view and control it.
    page : Page
        The page.
    panel, arrows, forces, plots
        Controls of the page.
    """

    def __init__(self, subject: Any, *, port: int = 0, order: int = 4, playing: bool = True):
        check_port(port)
        access = AccessControl()
        server = quiet_server(port, label=subject.name, access=access)
        try:
            from jounce.viewer.page.page import Page  # needs the extra ``viewer``

            self.page = Page(server, subject, order)
            self._lay_out(subject, playing)
        except BaseException:
            stop_silently(server)
            raise
        self.url = f"http://127.0.0.1:{server.get_port()}/?token={access.token}"

    def _lay_out(self, subject: Any, playing: bool) -> None:
        from jounce.viewer.page.panel import Panel
        from jounce.viewer.page.plots import Plots
        from jounce.viewer.page.tabs import ArrowsTab, ForcesTab
        from jounce.viewer.subjects.slopes import SlopesFolder, can_be_differentiated

        gui = self.page.server.gui
        gui.configure_theme(control_width="medium", show_logo=False, show_share_button=False, brand_color=(0, 90, 140))
        gui.main_panel.dock_right()
        gui.main_panel.set_width(330)
        self.panel = Panel(self.page)
        tabs = gui.add_tab_group()
        with tabs.add_tab("Parameters"):
            self.panel.add_parameters()
            self.slopes = SlopesFolder(self.page) if can_be_differentiated(subject) else None
        with tabs.add_tab("Arrows"):
            self.arrows = ArrowsTab(self.page)
        with tabs.add_tab("Forces"):
            self.forces = ForcesTab(self.page, subject.loaded)
        with tabs.add_tab("Export"):
            self.panel.add_exports()
        self.plots = Plots(self.page)
        self.page.observers += [self.panel, self.arrows, self.plots, *([self.slopes] if self.slopes else [])]
        self.plots.on_frame(self.page.frame)
        self.page.player.begin()
        self.panel.set_playing(playing)

    def wait(self) -> None:
        """Serve until interrupted (Ctrl-C), then close."""
        try:
            while True:
                time.sleep(3600)
        except KeyboardInterrupt:
            pass
        finally:
            self.close()

    def close(self) -> None:
        """Stop serving the page."""
        self.page.close()

    def __enter__(self) -> View:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def view(
    subject: Any,
    trajectory: Any = None,
    *,
    port: int = 0,
    order: int = 4,
    open_page: bool = True,
    playing: bool = True,
    allow: Iterable[str | PathLike[str]] = (),
    modes: bool = False,
    without: Sequence[str] = (),
    hold: str | Sequence[str] = (),
) -> View:
    """Show a moving mechanism or robot in the browser, with arrows, plots, forces and live parameters.

    The page is served on this machine only and uses no network. It ends with `View.close`, or with the process.

    Parameters
    ----------
    subject : Mechanism, Robot, PlateCam, or path of a file of a mechanism or a robot
        A mechanism (.yaml, .yml, .toml or .json) with a time grid, which is solved, or simulated if it has initial
        conditions. A robot (.urdf, .sdf, or .xml for MJCF), shown with the shapes of its file if it has any.
    trajectory : JointTrajectory, or path of a file, optional
        Motion of a robot; by default each joint swings within its limits.
    port : int, default 0
        Port of this machine; 0 chooses a free one.
    order : int, default 4
        Highest derivative of arrows and plots.
    open_page : bool, default True
        Open the page in the browser of the user.
    playing : bool, default True
        Whether the motion plays at once.
    allow
        Further folders allowed for samples and meshes named in the file.
    modes : bool, default False
        Show the modes about the equilibrium instead of a motion; a slider chooses one.
    without : sequence of str, optional
        Drivers of a mechanism to omit for the equilibrium.
    hold : sequence of str, or "all", optional
        Joints of a robot to lock for the equilibrium.

    Returns
    -------
    View
        The view, with its address `View.url`; `View.wait` serves until Ctrl-C.

    Raises
    ------
    JounceError
        If viser is not installed, the file cannot be read, the mechanism has no motion, or the port is taken.

    Examples
    --------
    >>> import jounce as jn
    >>> from jounce.viewer import view
    >>> with view("examples/four_bar.yaml", open_page=False) as page:
    ...     page.url.startswith("http://127.0.0.1:")
    True
    """
    check_installed()
    chosen = ModesChoice(modes, tuple(without), hold)
    view_shown = View(subject_of(subject, trajectory, allow, chosen), port=port, order=order, playing=playing)
    if open_page:
        import webbrowser

        webbrowser.open(view_shown.url)
    return view_shown


class ModesChoice(NamedTuple):
    """Whether to show modes instead of a motion, with the omitted drivers or locked joints."""

    requested: bool = False
    without: tuple[str, ...] = ()
    hold: str | Sequence[str] = ()


def subject_of(
    given: Any,
    trajectory: Any = None,
    allow: Iterable[str | PathLike[str]] = (),
    modes: ModesChoice = ModesChoice(),  # noqa: B008 - a constant
) -> Any:
    """Return the subject of a view, from a mechanism, a robot or a file.

    Raises
    ------
    JounceError
        If the argument is none of them, or a trajectory is given with a mechanism.
    """
    from jounce.io import load, load_robot
    from jounce.viewer.subjects.mechanisms import MechanismSubject

    path = None
    if isinstance(given, str | PathLike):
        path = Path(fspath(given))
        given = (load if path.suffix.lower() in MECHANISM_FILES else load_robot)(path, allow=allow)
    if isinstance(given, PlateCam):
        from jounce.viewer.subjects.cams import CamSubject

        if trajectory is not None or modes.requested:
            raise JounceError("a cam turns, and has neither modes nor a trajectory", path=path, name="cam")
        return CamSubject(given)
    if isinstance(given, Robot):
        if modes.requested:
            if trajectory is not None:
                message = "modes are about an equilibrium, not along a trajectory"
                raise JounceError(message, path=path, name="trajectory")
            return modes_subject(given, modes, path, allow)
        return robot_subject(given, trajectory, path, allow)
    if not isinstance(given, Mechanism):
        message = "must be a mechanism, a robot, a cam, or the path of a file of a mechanism or a robot"
        raise JounceError(message, name="subject", value=type(given).__name__)
    if trajectory is not None:
        message = "a mechanism moves by its own drivers; a trajectory is for robots"
        raise JounceError(message, path=path, name="trajectory")
    if modes.requested:
        return modes_subject(given, modes, path)
    try:
        return MechanismSubject(given)
    except JounceError as error:
        raise error.located(path=path) from None


def modes_subject(
    given: Mechanism | Robot, modes: ModesChoice, path: Path | None, allow: Iterable[str | PathLike[str]] = ()
) -> Any:
    """Return the modes of a mechanism or a robot as the subject of a view.

    Raises
    ------
    JounceError
        If there is no equilibrium, nothing can move about it, or an option is for the other kind.
    """
    from jounce.viewer.shapes.robot_appearance import robot_appearance
    from jounce.viewer.subjects.modes import ModesSubject

    try:
        if isinstance(given, Mechanism):
            if modes.hold:
                raise JounceError("is for robots; drivers hold a mechanism", name="hold")
            return ModesSubject(given, {"without": modes.without})
        if modes.without:
            raise JounceError("is for mechanisms; a robot has no drivers, its joints are held", name="without")
        return ModesSubject(given, {"hold": modes.hold}, robot_appearance(given, path, allow))
    except JounceError as error:
        raise error.located(path=path) from None


def robot_subject(
    robot: Robot, trajectory: Any = None, path: Path | None = None, allow: Iterable[str | PathLike[str]] = ()
) -> Any:
    """Return a robot as the subject of a view; a robot with closures moves as a mechanism.

    Parameters
    ----------
    robot : Robot
    trajectory : JointTrajectory, path or None
    path : Path, optional
        The file of the robot, with its shapes.
    allow
        Further folders allowed for meshes.

    Raises
    ------
    JounceError
        If the trajectory cannot be read or does not fit the robot.
    """
    from jounce.io import load_trajectory
    from jounce.viewer.shapes.robot_appearance import robot_appearance
    from jounce.viewer.subjects.closed_loops import ClosedRobotSubject
    from jounce.viewer.subjects.robots import RobotSubject

    if isinstance(trajectory, str | PathLike):
        trajectory = load_trajectory(trajectory, robot=robot)
    kind = ClosedRobotSubject if robot.closures else RobotSubject
    return kind(robot, robot_appearance(robot, path, allow), trajectory)
