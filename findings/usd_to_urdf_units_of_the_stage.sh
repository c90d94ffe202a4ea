#!/usr/bin/env bash
# nvidia-srl-usd-to-urdf 1.0.3: a USD stage in centimeters becomes a URDF whose lengths are 100 times too large.
#
# metersPerUnit of a USD stage says what its lengths mean, and by default they are centimeters; lengths of URDF are in
# meters. One would expect a converter to scale lengths and moments of inertia, or to refuse units that it does not
# scale. The numbers are written as they are: the same arm of 0.5 m, once in meters and once in centimeters, gets its
# next joint at 0.5 m and at 50 m, moments of 0.1 and 1000 kg m^2, and limits of 0.3 and 30 m. The message is that it was
# converted. Output seen: "stage in m: 0.5 m, 0.1 kg m^2; in cm: 50 m, 1000 kg m^2". Exits with 1 if that is no longer
# so.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet "nvidia-srl-usd-to-urdf==1.0.3" "usd-core==25.11" numpy
cat > "$folder/stages.py" <<'PY'
import sys

from pxr import Gf, Usd, UsdGeom, UsdPhysics


def write(path, meters_per_unit):
    stage = Usd.Stage.CreateNew(path)
    UsdGeom.SetStageMetersPerUnit(stage, meters_per_unit)
    root = UsdGeom.Xform.Define(stage, "/robot")
    stage.SetDefaultPrim(root.GetPrim())
    UsdPhysics.ArticulationRootAPI.Apply(root.GetPrim())
    unit = 1 / meters_per_unit
    for name, place in (("base", 0.0), ("arm", 0.1), ("tip", 0.6)):
        body = UsdGeom.Xform.Define(stage, f"/robot/{name}")
        body.AddTranslateOp().Set(Gf.Vec3d(place * unit, 0, 0))
        UsdPhysics.RigidBodyAPI.Apply(body.GetPrim())
        mass = UsdPhysics.MassAPI.Apply(body.GetPrim())
        mass.CreateMassAttr(2.0)
        mass.CreateDiagonalInertiaAttr(Gf.Vec3f(0.1, 0.2, 0.25) * unit**2)
        mass.CreatePrincipalAxesAttr(Gf.Quatf(1))
        mass.CreateCenterOfMassAttr(Gf.Vec3f(0.3 * unit, 0, 0))
    hinge = UsdPhysics.RevoluteJoint.Define(stage, "/robot/arm/hinge")
    slide = UsdPhysics.PrismaticJoint.Define(stage, "/robot/tip/slide")
    slide.CreateLowerLimitAttr(0.0)
    slide.CreateUpperLimitAttr(0.3 * unit)
    for joint, parent, child, place in ((hinge, "base", "arm", 0.1), (slide, "arm", "tip", 0.5)):
        joint.CreateBody0Rel().SetTargets([f"/robot/{parent}"])
        joint.CreateBody1Rel().SetTargets([f"/robot/{child}"])
        joint.CreateAxisAttr("X")
        joint.CreateLocalPos0Attr(Gf.Vec3f(place * unit, 0, 0))
        joint.CreateLocalRot0Attr(Gf.Quatf(1))
        joint.CreateLocalRot1Attr(Gf.Quatf(1))
    stage.Save()


write(sys.argv[1] + "/m.usda", 1.0)
write(sys.argv[1] + "/cm.usda", 0.01)
PY
"$folder/venv/bin/python" "$folder/stages.py" "$folder"
for unit in m cm; do
    "$folder/venv/bin/usd_to_urdf" "$folder/$unit.usda" -o "$folder/$unit.urdf" --log-level error
done
"$folder/venv/bin/python" - "$folder" <<'PY'
import importlib.metadata
import sys
import xml.etree.ElementTree

print("nvidia-srl-usd-to-urdf", importlib.metadata.version("nvidia-srl-usd-to-urdf"))
found = {}
for unit in ("m", "cm"):
    robot = xml.etree.ElementTree.parse(f"{sys.argv[1]}/{unit}.urdf")
    slide = robot.find("joint[@name='slide']")
    place = float(slide.find("origin").get("xyz").split()[0])
    moment = float(robot.find("link[@name='arm']/inertial/inertia").get("ixx"))
    found[unit] = place, moment, float(slide.find("limit").get("upper"))
    print(f"stage in {unit}: {place:g} m, {moment:g} kg m^2, limit {found[unit][2]:g} m")
assert all(abs(a - b) < 1e-6 for a, b in zip(found["m"], (0.5, 0.1, 0.3)))
assert all(abs(a / b - 1) < 1e-5 for a, b in zip(found["cm"], (50, 1000, 30))), "units of the stage count now"
PY
