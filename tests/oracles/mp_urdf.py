"""A reader of URDF that keeps every digit, for the oracles only: decimals become numbers as they stand."""

from xml.etree import ElementTree

from mpmath import mpf

from tests.oracles.mp_robot import Body, Robot, matrices, numbers, transposed, turn, unit


def triple(element, key, default):
    """Return three numbers from an attribute."""
    text = default if element is None else element.get(key, default)
    return numbers(text.split())


def rotation(element):
    """Return the matrix of the rpy angles of an origin: about the fixed axes x, y, z."""
    angles = triple(element, "rpy", "0 0 0")
    x, y, z = (turn(numbers([i == 0, i == 1, i == 2]), angle) for i, angle in enumerate(angles))
    return matrices(z, matrices(y, x))


def inertial(link):
    """Return mass, center of mass and inertia in the axes of the link; nothing where none is given."""
    element = link.find("inertial")
    if element is None:
        return {}
    entries = {key: mpf(value) for key, value in element.find("inertia").attrib.items()}
    tensor = [[entries["i" + "".join(sorted(a + b))] for b in "xyz"] for a in "xyz"]
    origin = element.find("origin")
    turned = rotation(origin)
    tensor = matrices(turned, matrices(tensor, transposed(turned)))
    return {"mass": mpf(element.find("mass").get("value")), "center": triple(origin, "xyz", "0 0 0"), "inertia": tensor}


def load(path):
    """Return the robot of a URDF file; links in depth-first order, fixed joints kept as fixed bodies."""
    root = ElementTree.parse(path).getroot()
    links = {link.get("name"): link for link in root.findall("link")}
    joints = root.findall("joint")
    children = {joint.find("child").get("link") for joint in joints}
    (base,) = [name for name in links if name not in children]
    bodies = []

    def grow(name, index):
        for joint in joints:
            if joint.find("parent").get("link") != name:
                continue
            child, axis = joint.find("child").get("link"), joint.find("axis")
            origin = joint.find("origin")
            made = Body(
                name=child,
                joint=joint.get("name"),
                parent=index,
                type=joint.get("type"),
                position=triple(origin, "xyz", "0 0 0"),
                rotation=rotation(origin),
                axis=unit(triple(axis, "xyz", "1 0 0")),
                **inertial(links[child]),
            )
            bodies.append(made)
            grow(child, len(bodies) - 1)

    grow(base, -1)
    return Robot(tuple(bodies), [mpf(0), mpf(0), mpf("-9.81")])
