"""The model files in `urdf/`: where they are, and their text with other numbers filled in.

The files are complete, readable models with the default numbers, each with its source; any reader of URDF or
SDF can load them. What a scenario may change is filled in here, in the parsed XML, so that each default
number is written down only once. All functions are pure: same arguments, same text. SI units.
"""

import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from flipdiagram.errors import InputError
from flipdiagram.robot.own_files import ArmFile, made_ready

DRAKE = "http://drake.mit.edu"
ElementTree.register_namespace("drake", DRAKE)

BLADE_MASS_SHARE = 0.049 / 0.150  # of the spatula's mass; the rest is the handle, see spatula.urdf
HANDLE_RADIUS = 0.008  # [m], as in spatula.urdf


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


def arm_urdf(
    own: ArmFile | None = None,
    *,
    link_inertia_scale: float = 1.0,
    reflected_inertia_scale: float = 1.0,
    speed_scale: float = 1.0,
    torque_scale: float = 1.0,
    link_inertia_scales: Sequence[float] | None = None,
    reflected_inertia_scales: Sequence[float] | None = None,
) -> str:
    """URDF text of the arm with its numbers scaled; `own` is a URDF of the user's own (default: mh3f.urdf).

    link_inertia_scale multiplies mass and inertia of every link, reflected_inertia_scale every rotor inertia,
    speed_scale every velocity limit, torque_scale every effort limit (the peak; friction is a fraction of the
    rated torque, which stays). Numbers without unit, above 0 (reflected_inertia_scale: 0 too).
    link_inertia_scales and reflected_inertia_scales multiply those of the link and rotor of each joint, in order.
    """
    root = _parse(model_path("mh3f.urdf") if own is None else Path(own.path))
    if own is not None:
        made_ready(root, own.base, own.flange, own.path)
    for name, scale, path, attributes in (
        ("link_inertia_scale", link_inertia_scale, "link/inertial/mass", ("value",)),
        ("link_inertia_scale", link_inertia_scale, "link/inertial/inertia", ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")),
        (
            "reflected_inertia_scale",
            reflected_inertia_scale,
            f"transmission/actuator/{{{DRAKE}}}rotor_inertia",
            ("value",),
        ),
        ("speed_scale", speed_scale, "joint/limit", ("velocity",)),
        ("torque_scale", torque_scale, "joint/limit", ("effort",)),
    ):
        if name == "reflected_inertia_scale":
            check_not_negative(name, scale)
        else:
            check_positive(name, scale)
        for element in root.iterfind(path):
            for attribute in attributes:
                if attribute in element.attrib:
                    _scale(element, attribute, scale)
    moving = [joint for joint in root.iterfind("joint") if joint.get("type") != "fixed"]
    for joint, scale in zip(moving, _per_joint("link_inertia_scales", link_inertia_scales, moving), strict=True):
        link = f"link[@name='{_attribute(joint, 'child', 'link')}']/inertial"
        for element in (*root.iterfind(f"{link}/mass"), *root.iterfind(f"{link}/inertia")):
            for attribute in element.attrib:
                _scale(element, attribute, scale)
    scales = _per_joint("reflected_inertia_scales", reflected_inertia_scales, moving)
    for joint, scale in zip(moving, scales, strict=True):
        transmission = f"transmission/joint[@name='{joint.attrib['name']}']/../actuator"
        for element in root.iterfind(f"{transmission}/{{{DRAKE}}}rotor_inertia"):
            _scale(element, "value", scale)
    return ElementTree.tostring(root, encoding="unicode")


def _scale(element: ElementTree.Element, attribute: str, scale: float) -> None:
    element.set(attribute, repr(float(element.attrib[attribute]) * scale))


def _per_joint(name: str, scales: Sequence[float] | None, joints: Sequence[ElementTree.Element]) -> list[float]:
    if scales is None:
        return [1.0] * len(joints)
    if len(scales) != len(joints):
        names = " ".join(joint.attrib["name"] for joint in joints)
        raise InputError(f"{name} = {list(scales)} has {len(scales)} entries; valid is one per joint, {names}")
    return [check_positive(f"{name}[{i}]", scale) for i, scale in enumerate(scales)]


def spatula_urdf(
    *,
    blade_size: Sequence[float] | None = None,
    tool_length: float | None = None,
    mass: float | None = None,
    friction: float | None = None,
) -> str:
    """URDF text of the spatula; None keeps the number of spatula.urdf.

    blade_size: along the handle, across, thickness [m]; tool_length: flange to the centre of the blade's top
    surface [m]; mass: of the whole spatula [kg]; friction: static coefficient on the object. The inertia
    follows: blade = homogeneous box, handle = rod from the flange to the blade.
    """
    root = _parse(model_path("spatula.urdf"))
    size = _size("blade_size", blade_size, _attribute(root, "link/collision/geometry/box", "size"))
    length = (
        float(_attribute(root, "frame", "xyz").split()[0])
        if tool_length is None
        else check_positive("tool_length", tool_length)
    )
    total = float(_attribute(root, "link/inertial/mass", "value")) if mass is None else check_positive("mass", mass)
    handle = length - size[0] / 2
    if handle <= 0:
        raise InputError(
            f"tool_length = {length} m leaves no handle; valid is more than half the blade, {size[0] / 2} m"
        )

    blade_centre = f"{length!r} 0 {-size[2] / 2!r}"
    for path in ("link/visual[@name='blade']", "link/collision"):
        _set(root, f"{path}/origin", xyz=blade_centre)
        _set(root, f"{path}/geometry/box", size=_text(size))
    _set(root, "frame", xyz=f"{length!r} 0 0")
    _set(root, "link/visual[@name='handle']/origin", xyz=f"{handle / 2!r} 0 {-size[2] / 2!r}")
    _set(root, "link/visual[@name='handle']/geometry/cylinder", length=repr(handle))
    _set(root, "link/visual[@name='neck']/origin", xyz=f"{handle - 0.005!r} 0 {-size[2] - 0.002!r}")
    if friction is not None:
        for kind in ("mu_static", "mu_dynamic"):
            _set(root, f".//{{{DRAKE}}}{kind}", value=repr(check_not_negative("friction", friction)))

    blade_mass, handle_mass = BLADE_MASS_SHARE * total, (1 - BLADE_MASS_SHARE) * total
    centre = BLADE_MASS_SHARE * length + (1 - BLADE_MASS_SHARE) * handle / 2
    across = handle_mass / 12 * (3 * HANDLE_RADIUS**2 + handle**2)
    rod = np.array([handle_mass / 2 * HANDLE_RADIUS**2, across, across])
    apart = blade_mass * handle_mass / total * (length - handle / 2) ** 2  # two bodies about their common COM
    ixx, iyy, izz = (float(i) for i in box_inertia(blade_mass, size) + rod + np.array([0.0, apart, apart]))
    _set(root, "link/inertial/origin", xyz=f"{centre!r} 0 {-size[2] / 2!r}")
    _set(root, "link/inertial/mass", value=repr(total))
    _set(root, "link/inertial/inertia", ixx=repr(ixx), iyy=repr(iyy), izz=repr(izz))
    return ElementTree.tostring(root, encoding="unicode")


def block_sdf(
    *,
    size: Sequence[float] | None = None,
    mass: float | None = None,
    friction: float | None = None,
    hydroelastic_modulus: float | None = None,
    hunt_crossley_dissipation: float | None = None,
) -> str:
    """SDF text of the object, a homogeneous box; None keeps the number of block.sdf.

    size: x, y, z [m] in the block's frame (y along the tool's tangent, z the thickness); mass [kg]; friction:
    static coefficient; hydroelastic_modulus [Pa]; hunt_crossley_dissipation [s/m].
    """
    root = _parse(model_path("block.sdf"))
    edges = _size("size", size, _find(root, ".//collision/geometry/box/size").text or "")
    total = float(_find(root, ".//mass").text or "") if mass is None else check_positive("mass", mass)
    _fill(root, {".//box/size": _text(edges), ".//mass": repr(total)})
    _fill(
        root,
        {
            f".//{name}": repr(float(i))
            for name, i in zip(("ixx", "iyy", "izz"), box_inertia(total, edges), strict=True)
        },
    )
    _fill_contact(root, friction)
    if hydroelastic_modulus is not None:
        value = check_positive("hydroelastic_modulus", hydroelastic_modulus)
        _fill(root, {f".//{{{DRAKE}}}hydroelastic_modulus": repr(value)})
    if hunt_crossley_dissipation is not None:
        value = check_not_negative("hunt_crossley_dissipation", hunt_crossley_dissipation)
        _fill(root, {f".//{{{DRAKE}}}hunt_crossley_dissipation": repr(value)})
    return ElementTree.tostring(root, encoding="unicode")


def table_sdf(*, size: Sequence[float] | None = None, friction: float | None = None) -> str:
    """SDF text of the table, a plate of size x, y, z [m] below its frame; None: as in table.sdf."""
    root = _parse(model_path("table.sdf"))
    edges = _size("size", size, _find(root, ".//collision/geometry/box/size").text or "")
    _fill(root, {".//box/size": _text(edges), ".//visual/pose": f"0 0 {-edges[2] / 2!r} 0 0 0"})
    _fill(root, {".//collision/pose": f"0 0 {-edges[2] / 2!r} 0 0 0"})
    _fill_contact(root, friction)
    return ElementTree.tostring(root, encoding="unicode")


def box_inertia(mass: float, size: Sequence[float]) -> np.ndarray:
    """Moments of inertia (3,) [kg m^2] of a homogeneous box about its centre; mass [kg], size x, y, z [m]."""
    x2, y2, z2 = (edge**2 for edge in size)
    return mass / 12 * np.array([y2 + z2, x2 + z2, x2 + y2])


def check_positive(name: str, value: float) -> float:
    """`value` as a float; InputError naming `name` unless it is a finite number above zero."""
    if not np.isfinite(value) or value <= 0:
        raise InputError(f"{name} = {value} is not valid; valid is a number above 0")
    return float(value)


def check_not_negative(name: str, value: float) -> float:
    """`value` as a float; InputError naming `name` unless it is a finite number of at least zero."""
    if not np.isfinite(value) or value < 0:
        raise InputError(f"{name} = {value} is not valid; valid is a number of at least 0")
    return float(value)


def _parse(path: Path) -> ElementTree.Element:
    try:
        return ElementTree.parse(path).getroot()
    except OSError as error:
        raise InputError(f"cannot read the model file '{path}': {error.strerror}") from None
    except ElementTree.ParseError as error:
        raise InputError(f"the model file '{path}' is not valid XML: {error}") from None


def _find(root: ElementTree.Element, path: str) -> ElementTree.Element:
    element = root.find(path)
    if element is None:
        raise InputError(f"the model file has no element '{path}'")
    return element


def _attribute(root: ElementTree.Element, path: str, name: str) -> str:
    return _find(root, path).attrib[name]


def _set(root: ElementTree.Element, path: str, **attributes: str) -> None:
    _find(root, path).attrib.update(attributes)


def _fill(root: ElementTree.Element, texts: Mapping[str, str]) -> None:
    for path, text in texts.items():
        _find(root, path)
        for element in root.iterfind(path):
            element.text = text


def _fill_contact(root: ElementTree.Element, friction: float | None) -> None:
    if friction is not None:
        text = repr(check_not_negative("friction", friction))
        _fill(root, {f".//{{{DRAKE}}}mu_static": text, f".//{{{DRAKE}}}mu_dynamic": text})


def _size(name: str, given: Sequence[float] | None, default: str) -> tuple[float, float, float]:
    edges = [float(edge) for edge in default.split()] if given is None else list(given)
    if len(edges) != 3:
        raise InputError(f"{name} = {edges} is not valid; valid are three lengths [m]")
    x, y, z = (check_positive(f"{name}[{i}]", edge) for i, edge in enumerate(edges))
    return x, y, z


def _text(values: Sequence[float]) -> str:
    return " ".join(repr(float(value)) for value in values)
