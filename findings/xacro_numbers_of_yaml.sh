#!/usr/bin/env bash
# xacro 2.1.1: twice the mass 1e-3 of a YAML file is the text 1e-31e-3, and Drake 1.51.1 reads a mass of 1e-31 kg.
#
# Robots keep masses and lengths in YAML files that xacro.load_yaml reads, and xacro makes a URDF of them. A property
# <xacro:property name="m" value="1e-3"/> is a number: ${2*m} is 0.002. One would expect the same of "m: 1e-3" in YAML,
# or an error. It is text, as YAML 1.1 wants a decimal point in numbers with an exponent, and twice a text is the text
# twice; for "m: 1.0e-3" it is 0.002. Nothing says so. Of the URDF, Drake takes the leading part that is a number,
# Pinocchio 4.1.0 leaves the mass out, with an error on the terminal, MuJoCo 4.0.0 refuses it. Output seen: "property
# 0.002, YAML 1e-31e-3, with a point 0.002; Drake 1e-31 kg, Pinocchio 0 kg, MuJoCo refuses it". Exits with 1 if that is
# no longer so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "xacro==2.1.1" "pin==4.1.0" "mujoco==4.0.0" "drake==1.51.1" numpy
"$folder/venv/bin/python" - "$folder" <<'PY'
import importlib.metadata
import pathlib
import sys

import mujoco
import pinocchio
import xacro
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

folder = pathlib.Path(sys.argv[1])
(folder / "masses.yaml").write_text("plain: 1e-3\npoint: 1.0e-3\n")
(folder / "robot.xacro").write_text(
    '<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:property name="m" value="1e-3"/>'
    f"""<xacro:property name="masses" value="${{xacro.load_yaml('{folder}/masses.yaml')}}"/>"""
    """<link name="base"/><link name="arm"><inertial><mass value="${2*masses['plain']}"/><inertia ixx="0.1" iyy="0.1"
    izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link><joint name="j" type="continuous"><parent link="base"/>
    <child link="arm"/></joint><gazebo><a value="${2*m}"/><a value="${2*masses['point']}"/></gazebo></robot>"""
)
text = xacro.process_file(str(folder / "robot.xacro")).toxml()
values = [part.split('"')[0] for part in text.split('value="')[1:]]
print(*(f"{name} {importlib.metadata.version(name)}" for name in ("xacro", "pin", "mujoco", "drake")))
print(f"property {values[1]}, YAML {values[0]}, with a point {values[2]}")
assert values == ["1e-31e-3", "0.002", "0.002"], values
plant = MultibodyPlant(0.0)
Parser(plant).AddModelsFromString(text, "urdf")
plant.Finalize()
of_drake = plant.CalcTotalMass(plant.CreateDefaultContext())
of_pinocchio = pinocchio.buildModelFromXML(text).inertias[1].mass
print(f"Drake {of_drake:g} kg, Pinocchio {of_pinocchio:g} kg")
assert of_drake == 1e-31 and of_pinocchio == 0
try:
    mujoco.MjModel.from_xml_string(text)
except ValueError as error:
    print("MuJoCo refuses it:", str(error).split("\n")[0])
else:
    raise AssertionError("MuJoCo reads it now")
PY
