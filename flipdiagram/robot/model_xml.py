"""Model files of the user's own, checked before Drake sees them: it takes some faults in silence and dies of others.

One front for arm, tool and object in URDF, SDF and MJCF: bounded XML, every number that moves something, masses and
inertias, names and joints.  Whether joints make a chain is asked in `own_files`, of all formats alike.
"""

import xml.etree.ElementTree as ElementTree
from collections.abc import Callable, Iterator, Mapping
from math import inf
from typing import Any, NamedTuple

from pydrake.multibody.tree import RotationalInertia, SpatialInertia

from flipdiagram.errors import InputError
from flipdiagram.files import read_file

MOST_LINKS = 200
"""Links or bodies that a model may have."""
MOST_ELEMENTS = 20_000
DEEPEST = 250
"""Elements inside each other; a body of MJCF stands inside the one that carries it."""
LARGEST = 1e9
"""Of any number, limits of SDF apart: its square is still a number."""
KINDS = {"robot": "urdf", "sdf": "sdf", "mujoco": "mjcf"}
"""Format by the root element."""
JOINT_TYPES = ("revolute", "continuous", "prismatic", "fixed")
OTHER_TYPES = ("planar", "floating", "ball", "universal", "screw", "revolute2", "gearbox", "free", "hinge", "slide")
MOMENTS = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
NAMED = ("link", "joint", "body", "frame", "model", "robot")


class Rule(NamedTuple):
    """What a number, or several, must be: how many, how they are, and up to which size."""

    counts: tuple[int, ...] = (1,)
    how: str = ""
    most: float = LARGEST
    """Infinity: also that itself; and -1 stands for it, as in SDF."""

    @property
    def valid(self) -> str:
        """In words."""
        what = "a number" if self.counts == (1,) else f"{' or '.join(map(str, self.counts))} numbers"
        return f"{what}{self.how and ' ' + self.how}{'' if self.most == inf else f', none beyond {self.most:g}'}"

    def holds(self, text: str) -> bool:
        """Whether a text is such numbers."""
        try:
            values = [float(word) for word in text.split()]
        except ValueError:
            return False
        if len(values) not in self.counts or "_" in text or any(value != value for value in values):
            return False
        if self.most == inf and values == [-1.0]:
            return True
        return HOW[self.how](values) and max(map(abs, values)) <= self.most


HOW: dict[str, Callable[[list[float]], bool]] = {
    "": lambda values: True,
    "of at least 0": lambda values: min(values) >= 0,
    "above 0": lambda values: min(values) > 0,
    "that are not all 0": lambda values: max(map(abs, values)) > 1e-9,
    "in rising order": lambda values: values[0] <= values[1],
}


def _rules(paths: str, counts: tuple[int, ...] = (1,), how: str = "", most: float = LARGEST) -> dict[str, Rule]:
    return dict.fromkeys(paths.split(), Rule(counts, how, most))


def _drake(names: str) -> str:
    """The paths of elements of Drake's own, as a value of URDF and as a text of SDF."""
    return " ".join(f"{{http://drake.mit.edu}}{name}{end}" for name in names.split() for end in ("@value", ""))


# "element@attribute", or the text of an element: those of URDF, of SDF, of MJCF
RULES = {
    **_rules("origin@xyz origin@rpy inertial@pos body@pos geom@pos body@euler inertial@euler geom@euler", (3,)),
    **_rules("axis@xyz xyz joint@axis body@zaxis", (3,), "that are not all 0"),
    **_rules("body@quat inertial@quat geom@quat body@axisangle", (4,), "that are not all 0"),
    **_rules("body@xyaxes", (6,), "that are not all 0"),
    **_rules("mass@value mass limit@effort limit@rated_effort limit@velocity dynamics@damping", how="of at least 0"),
    **_rules("dynamics@friction damping friction geom@mass geom@density", how="of at least 0"),
    **_rules("joint@armature joint@damping joint@frictionloss", how="of at least 0"),
    **_rules("inertial@mass limit@gear_stiffness", how="above 0"),
    **_rules("limit@lower limit@upper limit@home"),
    **_rules(" ".join(MOMENTS)),
    **_rules(" ".join(f"inertia@{moment}" for moment in MOMENTS)),
    **_rules("inertial@diaginertia", (3,), "of at least 0"),
    **_rules("inertial@fullinertia", (6,)),
    **_rules("velocity effort", how="of at least 0", most=inf),
    **_rules("lower upper", most=inf),
    **_rules("joint@range motor@ctrlrange motor@forcerange", (2,), "in rising order"),
    **_rules("box@size size", (3, 2), "above 0"),
    **_rules("cylinder@radius cylinder@length sphere@radius capsule@radius capsule@length", how="above 0"),
    **_rules("radius length", how="above 0"),
    **_rules("geom@size", (1, 2, 3), "of at least 0"),
    **_rules("pose", (6, 7)),
    **_rules(_drake("rotor_inertia mu_static mu_dynamic hunt_crossley_dissipation"), how="of at least 0"),
    **_rules(_drake("gear_ratio hydroelastic_modulus mesh_resolution_hint"), how="above 0", most=inf),
    **_rules(_drake("point_contact_stiffness"), how="above 0"),
}


class Model(NamedTuple):
    """A checked model file: its root element and its format, of `KINDS`."""

    root: ElementTree.Element
    kind: str

    @property
    def text(self) -> str:
        """Its XML, which begins with the root element."""
        return ElementTree.tostring(self.root, encoding="unicode")


def read_model(field: str, file: str, kinds: tuple[str, ...]) -> Model:
    """The checked file that a field names, of one of these formats.

    Raises InputError, one line: field and file, the element, its value, and what is valid.
    """
    content = read_file(file, f"{field} =", "a URDF, SDF or MJCF" if "mjcf" in kinds else "a URDF or SDF")
    try:
        root = _parsed(content)
        kind = KINDS.get(root.tag, "")
        if kind not in kinds:
            valid = " or ".join(f"<{tag}>" for tag, name in KINDS.items() if name in kinds)
            raise _Refused(f"begins with <{root.tag}>", valid)
        _check_elements(root)
        for element, place in _walk(root):
            if element.tag == "limit":
                _check_range(element, place)
            if element.tag == "inertial":
                _check_inertia(element, place, kind)
        if kind == "urdf":
            _check_names(root)
    except _Refused as fault:
        raise model_error(field, file, *fault.args) from None
    return Model(root, kind)


def model_error(field: str, file: str | None, problem: str, valid: Any) -> InputError:
    """The error of a model file: "arm.file = 'a.urdf' <problem>; valid is …"."""
    return InputError.of(field, file, valid, f"{field} = '{file}' {problem}")


class _Refused(Exception):
    """A fault, and what would be valid."""


class _Bounded(ElementTree.TreeBuilder):
    """A tree without entities, whose size and depth have a bound while it grows."""

    count = depth = 0

    def doctype(self, *_: Any) -> None:
        raise _Refused("has a document type, whose entities may be endless", "XML without <!DOCTYPE>")

    def start(self, tag: Any, attrs: Any) -> ElementTree.Element:
        self.count, self.depth = self.count + 1, self.depth + 1
        if self.count > MOST_ELEMENTS or self.depth > DEEPEST:
            raise _Refused("is too large", f"a model of at most {MOST_ELEMENTS} elements, {DEEPEST} inside each other")
        return super().start(tag, attrs)

    def end(self, tag: Any) -> ElementTree.Element:
        self.depth -= 1
        return super().end(tag)


def _parsed(content: bytes) -> ElementTree.Element:
    try:
        return ElementTree.fromstring(content, ElementTree.XMLParser(target=_Bounded()))
    except (ElementTree.ParseError, LookupError, ValueError) as error:  # an encoding unknown, or of more bytes
        raise _Refused(f"is not valid XML: {error}", "XML in UTF-8 or UTF-16") from None


def _check_elements(root: ElementTree.Element) -> None:
    links = 0
    for element, place in _walk(root):
        if element.tag.rpartition("}")[2] == "include":
            raise _Refused("includes another file", "one file that has all, as its content tells one run from another")
        links += element.tag in ("link", "body")
        if links > MOST_LINKS:
            raise _Refused("has too many links", f"at most {MOST_LINKS}")
        _check_numbers(element, place)
        if element.tag == "joint" and element.get("type", "fixed") not in (*JOINT_TYPES, *OTHER_TYPES):
            raise _Refused(f"has type = '{_short(element.attrib['type'])}' {place}", ", ".join(JOINT_TYPES))


def _check_numbers(element: ElementTree.Element, place: str) -> None:
    texts = {f"{element.tag}@{name}": text for name, text in element.attrib.items()}
    if text := (element.text or "").strip():
        texts[element.tag] = text
    for path, text in texts.items():
        if path in RULES and not RULES[path].holds(text):
            shown = path.rpartition("}")[2].replace("@", " ")
            raise _Refused(f"has {shown} = '{_short(text)}' {place}", RULES[path].valid)


def _walk(element: ElementTree.Element, place: str = "") -> Iterator[tuple[ElementTree.Element, str]]:
    """An element and all below it, each with the words that say where it stands."""
    if element.tag in NAMED:
        place = f"in {element.tag} '{_short(element.get('name', ''))}'"
    yield element, place
    for child in element:
        yield from _walk(child, place)


def _number(element: ElementTree.Element, name: str, default: float = 0.0) -> float:
    """A number of an element, an attribute or the text of a child."""
    return float((element.get(name) or element.findtext(name) or "").strip() or default)


def _check_range(limit: ElementTree.Element, place: str) -> None:
    lower, upper = _number(limit, "lower", -inf), _number(limit, "upper", inf)
    if lower > upper:
        raise _Refused(f"has limit lower = {lower:g} {place}", f"at most limit upper = {upper:g}")


def _check_inertia(inertial: ElementTree.Element, place: str, kind: str) -> None:
    """As Drake demands: it replaces others, with a warning, or ends the interpreter."""
    mass, inertia = inertial.find("mass"), inertial.find("inertia")
    unsaid = 1.0 if kind == "sdf" else 0.0
    moments: list[float] = []
    if kind == "mjcf":
        kilograms = _number(inertial, "mass")
        moments = [float(word) for word in inertial.get("fullinertia", inertial.get("diaginertia", "")).split()]
    else:
        kilograms = unsaid if mass is None else float((mass.get("value") or mass.text or "").strip() or 0)
        if inertia is not None:
            moments = [_number(inertia, name, unsaid if name[1] == name[2] else 0.0) for name in MOMENTS]
    if kilograms == 0 and not any(moments):
        return  # as a link without this element
    try:
        if not kilograms > 0:
            raise RuntimeError
        SpatialInertia.MakeFromCentralInertia(kilograms, [0.0, 0.0, 0.0], RotationalInertia(*moments or (0.0,) * 3))
    except RuntimeError:
        shown = " ".join(f"{moment:g}" for moment in moments)
        valid = "a mass above 0, moments above 0, none larger than the sum of the two others"
        raise _Refused(f"has mass {kilograms:g} with inertia {shown or 0} {place}", valid) from None


def _check_names(root: ElementTree.Element) -> None:
    """Of a URDF: every link and joint has its own name, every joint a type and two links that there are."""
    links: set[str] = set()
    joints: set[str] = set()
    for kind, names in (("link", links), ("joint", joints), ("frame", set[str]())):
        for element in root.iterfind(kind):
            name = element.get("name", "").strip()
            if not name or name in names:
                fault = f"two {kind}s of the name '{_short(name)}'" if name else f"a {kind} without a name"
                raise _Refused(f"has {fault}", "a name of its own for each")
            names.add(name)
    for joint in root.iterfind("joint"):
        name = _short(joint.attrib["name"])
        if "type" not in joint.attrib:
            raise _Refused(f"has a joint '{name}' without a type", ", ".join(JOINT_TYPES))
        for end in ("parent", "child"):
            ends = [element.get("link", "") for element in joint.iterfind(end)]
            if len(ends) != 1 or ends[0] not in links | ({"world"} if end == "parent" else set()):
                shown = _short(" ".join(ends))
                raise _Refused(f"has a joint '{name}' whose {end} is '{shown}'", "one link of the file")
    for mesh in root.iter("mesh"):
        if "filename" not in mesh.attrib:
            raise _Refused("has a mesh without a filename", "the name of a file, which may be missing")


def check_tree(field: str, file: str | None, joints: Mapping[str, tuple[Any, Any]]) -> None:
    """InputError unless joints, {name: (parent, child)}, make trees: one parent to a link, and no way round."""
    by_child: dict[Any, tuple[str, Any]] = {}
    for name, (parent, child) in joints.items():
        if child in by_child:
            problem = f"is no tree: the joints '{by_child[child][0]}' and '{name}' carry the same link"
            raise model_error(field, file, problem, "one joint to a link")
        by_child[child] = name, parent
    for name, (parent, child) in joints.items():
        seen = {child}
        while parent not in seen:
            seen.add(parent)
            parent = by_child.get(parent, ("", parent))[1]
        if parent == child:
            raise model_error(field, file, f"is no tree: the joint '{name}' carries itself", "a tree of links")


def _short(text: str) -> str:
    return text if len(text) <= 40 else f"{text[:37]}..."
