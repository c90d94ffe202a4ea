"""Reading files into checked models, beside parsers and other libraries."""

from typing import Any

import jounce as jn
from benchmarks.cases import EXAMPLES, Case, Cases, Contestant, ready


def bare_yaml(path: Any) -> Any:
    """Return ruamel.yaml's safe loader for a file, which checks nothing of what it reads."""
    from ruamel.yaml import YAML

    loader = YAML(typ="safe", pure=True)
    return lambda: loader.load(path)


def by_pinocchio(path: Any) -> Any:
    """Return Pinocchio's reader of URDF."""
    import pinocchio

    return lambda: pinocchio.buildModelFromUrdf(str(path))


def by_mujoco(path: Any) -> Any:
    """Return MuJoCo's reader, which compiles its model too."""
    import mujoco

    return lambda: mujoco.MjModel.from_xml_path(str(path))


def cases(quick: bool) -> Cases:
    """Yield files of mechanisms and of robots."""
    for name in ("four_bar",) if quick else ("four_bar", "stewart_platform", "jansen_leg"):
        path = EXAMPLES / f"{name}.yaml"
        yield Case(
            f"{path.name}, into a checked mechanism",
            [
                Contestant("jounce", ready(lambda path=path: jn.load(path))),
                Contestant("ruamel.yaml alone, safe loader", lambda path=path: bare_yaml(path)),
            ],
        )
    robots = EXAMPLES / "robots"
    for path, peer in (
        (
            robots / "panda.urdf",
            Contestant("Pinocchio", lambda: by_pinocchio(robots / "panda.urdf"), needs="pinocchio"),
        ),
        (
            robots / "human_arm.xml",
            Contestant("MuJoCo", lambda: by_mujoco(robots / "human_arm.xml"), needs="mujoco", extra="mjcf"),
        ),
    ):
        yield Case(
            f"{path.name}, into a checked robot",
            [
                Contestant(
                    "jounce", ready(lambda path=path: jn.load_robot(path)), needs=peer.needs * (path.suffix == ".xml")
                ),
                peer,
            ],
        )
