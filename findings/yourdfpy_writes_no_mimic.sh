#!/usr/bin/env bash
# yourdfpy 0.0.60: a URDF that it writes has no <mimic>: a follower is a joint of its own.
#
# yourdfpy reads <mimic>, and its configurations have no coordinate for a follower. One would expect write_xml_string and
# write_xml_file to write what was read, as they do for masses, limits and damping. The element is left out: a gripper
# that was read and written has two free fingers. <transmission>, <calibration>, <safety_controller> and <gazebo> are
# left out, too. There is no message, and the class has a method that would write it. Output seen: "read: 1 coordinate;
# written and read again: 2 coordinates; mimic in the file: 0". Exits with 1 if that is no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "yourdfpy==0.0.60" numpy
"$folder/venv/bin/python" - "$folder" <<'PY'
import importlib.metadata
import sys

import yourdfpy

source, written = sys.argv[1] + "/source.urdf", sys.argv[1] + "/written.urdf"
LIMIT = '<limit lower="0" upper="0.04" effort="5" velocity="1"/><dynamics damping="0.3"/>'
with open(source, "w") as file:
    file.write(
        '<robot name="r"><link name="hand"/><link name="left"/><link name="right"/><joint name="a" type="prismatic">'
        f'<parent link="hand"/><child link="left"/><axis xyz="0 1 0"/>{LIMIT}</joint><joint name="b" type="prismatic">'
        f'<parent link="hand"/><child link="right"/><axis xyz="0 -1 0"/>{LIMIT}<mimic joint="a"/></joint></robot>'
    )
before = yourdfpy.URDF.load(source)
assert before.validate()
before.write_xml_file(written)
with open(written) as file:
    text = file.read()
after = yourdfpy.URDF.load(written)
print("yourdfpy", importlib.metadata.version("yourdfpy"))
counts = before.num_actuated_joints, after.num_actuated_joints, text.count("mimic")
print("read: {} coordinate; written and read again: {} coordinates; mimic in the file: {}".format(*counts))
assert text.count('damping="0.3"') == 2
assert counts == (1, 2, 0), "followers are written now"
PY
