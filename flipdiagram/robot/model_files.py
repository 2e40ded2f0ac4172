"""The model files in `urdf/`: where they are, and their text with other numbers filled in.

The files are complete, readable models with the default numbers, each with its source; any reader of URDF or
SDF can load them. What a scenario may change is filled in here, in the parsed XML, so that each default
number is written down only once. All functions are pure: same arguments, same text. SI units.
"""

import xml.etree.ElementTree as ElementTree
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np

from flipdiagram.arrays import Array
from flipdiagram.errors import InputError
from flipdiagram.robot.arm_spec import one_per_joint
from flipdiagram.robot.model_xml import read_model
from flipdiagram.robot.own_files import prepare_urdf
from flipdiagram.scenario.cell import Arm, Object
from flipdiagram.scenario.scenario import Scenario

DRAKE = "http://drake.mit.edu"
ElementTree.register_namespace("drake", DRAKE)
DRAKE_TAG = f"{{{DRAKE}}}"
ROTOR_INERTIA = f"{DRAKE_TAG}rotor_inertia"
MOMENTS = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")

BLADE_MASS_SHARE = 0.049 / 0.150  # of the spatula's mass; the rest is the handle, see spatula.urdf
HANDLE_RADIUS = 0.008  # [m], as in spatula.urdf
BLADE_MODULUS = 70e9  # [Pa], aluminium


def urdf_directory() -> Path:
    """Folder of the model files: `flipdiagram/urdf` in a wheel, `urdf/` next to the package in a checkout."""
    package = Path(__file__).resolve().parents[1]
    installed = package / "urdf"
    return installed if installed.is_dir() else package.parent / "urdf"


def model_path(name: str) -> Path:
    """Path of one model file, e.g. "mh3f.urdf". Raises InputError if there is none of that name."""
    path = urdf_directory() / name
    if not path.is_file():
        known = sorted(p.name for p in urdf_directory().glob("*df"))
        raise InputError(f"no model file '{name}'; choose from {', '.join(known)}")
    return path


def arm_urdf(arm: Arm) -> str:
    """URDF text of the arm with its numbers scaled."""
    if arm.file is None:
        root = _parse(model_path("mh3f.urdf"))
    else:
        root = read_model("arm.file", arm.file, ("urdf",)).root
        prepare_urdf(root, arm, Path(arm.file).parent)
    joints = [joint for joint in root.iterfind("joint") if joint.get("type") != "fixed"]
    names = [joint.attrib["name"] for joint in joints]
    factors = [
        ("link/inertial/mass", ("value",), arm.link_inertia_scale),
        ("link/inertial/inertia", MOMENTS, arm.link_inertia_scale),
        (f"transmission/actuator/{ROTOR_INERTIA}", ("value",), arm.reflected_inertia_scale),
        ("joint/limit", ("velocity",), arm.speed_scale),
        ("joint/limit", ("effort",), arm.torque_scale),
    ]
    scales = one_per_joint("arm.link_inertia_scales", arm.link_inertia_scales, names)
    for joint, factor in zip(joints, scales, strict=True):
        inertial = f"link[@name='{_find(joint, 'child').attrib['link']}']/inertial"
        factors += [(f"{inertial}/mass", ("value",), factor), (f"{inertial}/inertia", MOMENTS, factor)]
    scales = one_per_joint("arm.reflected_inertia_scales", arm.reflected_inertia_scales, names)
    for name, factor in zip(names, scales, strict=True):
        factors += [(f"transmission/joint[@name='{name}']/../actuator/{ROTOR_INERTIA}", ("value",), factor)]
    for path, attributes, factor in factors:
        for element in root.iterfind(path):
            for attribute in element.attrib.keys() & set(attributes):
                element.set(attribute, repr(float(element.attrib[attribute]) * factor))
    return ElementTree.tostring(root, encoding="unicode")


def spatula_urdf(scenario: Scenario) -> str:
    """URDF text of the spatula with the scenario's numbers; its friction is that of the object.

    The inertia follows: blade = homogeneous box, handle = rod from the flange to the blade.  So does the stiffness with
    which an edge meets the table: a cantilever from the blade's middle, 3 E I / L³.
    """
    root, tool = _parse(model_path("spatula.urdf")), scenario.tool
    length, thickness, mass = tool.reach, tool.blade_thickness, tool.mass
    handle = length - tool.blade_length / 2
    if handle <= 0:
        valid = f"more than half the blade, {tool.blade_length / 2} m"
        raise InputError.of("tool.reach", length, valid, f"tool.reach = {length} m leaves no handle")
    blade_centre = f"{length!r} 0 {-thickness / 2!r}"
    for path in ("link/visual[@name='blade']", "link/collision"):
        _set(root, f"{path}/origin", xyz=blade_centre)
        _set(root, f"{path}/geometry/box", size=spaced(tool.blade_size))
    _set(root, "frame", xyz=f"{length!r} 0 0")
    _set(root, "link/visual[@name='handle']/origin", xyz=f"{handle / 2!r} 0 {-thickness / 2!r}")
    _set(root, "link/visual[@name='handle']/geometry/cylinder", length=repr(handle))
    _set(root, "link/visual[@name='neck']/origin", xyz=f"{handle - 0.005!r} 0 {-thickness - 0.002!r}")
    for kind in ("mu_static", "mu_dynamic"):
        _set(root, f".//{DRAKE_TAG}{kind}", value=repr(scenario.object.friction))
    stiffness = 2 * BLADE_MODULUS * tool.blade_length * (thickness / tool.blade_width) ** 3
    _set(root, f".//{DRAKE_TAG}point_contact_stiffness", value=repr(stiffness))

    blade_mass, handle_mass = BLADE_MASS_SHARE * mass, (1 - BLADE_MASS_SHARE) * mass
    centre = BLADE_MASS_SHARE * length + (1 - BLADE_MASS_SHARE) * handle / 2
    across = handle_mass / 12 * (3 * HANDLE_RADIUS**2 + handle**2)
    rod = np.array([handle_mass / 2 * HANDLE_RADIUS**2, across, across])
    apart = blade_mass * handle_mass / mass * (length - handle / 2) ** 2  # two bodies about their common COM
    moments = (box_inertia(blade_mass, tool.blade_size) + rod + np.array([0.0, apart, apart])).tolist()
    _set(root, "link/inertial/origin", xyz=f"{centre!r} 0 {-thickness / 2!r}")
    _set(root, "link/inertial/mass", value=repr(mass))
    _set(root, "link/inertial/inertia", **dict(zip(MOMENTS, map(repr, moments), strict=False)))
    return ElementTree.tostring(root, encoding="unicode")


def block_sdf(scenario: Scenario) -> str:
    """SDF text of the object, homogeneous, to touch a box, with the scenario's numbers and the mass that it has."""
    block, physics = scenario.object, scenario.simulation
    mass = block.mass * scenario.disturbance.object_mass_scale
    numbers = {
        "mass": mass,
        **dict(zip(MOMENTS, object_inertia(mass, block).tolist(), strict=False)),
        **{f"{DRAKE_TAG}{kind}": block.friction for kind in ("mu_static", "mu_dynamic")},
        f"{DRAKE_TAG}hydroelastic_modulus": physics.hydroelastic_modulus,
        f"{DRAKE_TAG}hunt_crossley_dissipation": physics.dissipation,
    }
    texts = {"box/size": spaced(block.size)} | {tag: repr(number) for tag, number in numbers.items()}
    return _filled("block.sdf", texts)


def table_sdf(friction: float) -> str:
    """SDF text of the table, a plate below its frame, with another friction coefficient than table.sdf."""
    return _filled("table.sdf", {f"{DRAKE_TAG}{kind}": repr(friction) for kind in ("mu_static", "mu_dynamic")})


def table_size() -> Array:
    """Edges (3,) of the table's plate [m]."""
    size = _find(_parse(model_path("table.sdf")), ".//collision/geometry/box/size").text or ""
    return np.array([float(edge) for edge in size.split()])


def object_inertia(mass: float, block: Object) -> Array:
    """Moments of inertia (3,) [kg m^2] of the object about its centre, a box or a disc; mass [kg]."""
    if block.diameter is None:
        return box_inertia(mass, block.size)
    across = mass / 12 * (3 * block.diameter**2 / 4 + block.thickness**2)
    return np.array([across, across, mass * block.diameter**2 / 8])


def box_inertia(mass: float, size: Sequence[float]) -> Array:
    """Moments of inertia (3,) [kg m^2] of a homogeneous box about its centre; mass [kg], size x, y, z [m]."""
    x2, y2, z2 = (edge**2 for edge in size)
    return mass / 12 * np.array([y2 + z2, x2 + z2, x2 + y2])


def _parse(path: Path) -> ElementTree.Element:
    return ElementTree.parse(path).getroot()


def _find(root: ElementTree.Element, path: str) -> ElementTree.Element:
    element = root.find(path)
    if element is None:
        raise InputError(f"the model file has no element '{path}'")
    return element


def _set(root: ElementTree.Element, path: str, **attributes: str) -> None:
    _find(root, path).attrib.update(attributes)


def _filled(name: str, texts: Mapping[str, str]) -> str:
    """The text of an SDF file with other texts in all elements of each path, of which there must be one."""
    root = _parse(model_path(name))
    for path, text in texts.items():
        _find(root, f".//{path}")
        for element in root.iterfind(f".//{path}"):
            element.text = text
    return ElementTree.tostring(root, encoding="unicode")


def spaced(values: Iterable[float]) -> str:
    """Numbers as model files write them, each read back exactly."""
    return " ".join(repr(float(value)) for value in values)
