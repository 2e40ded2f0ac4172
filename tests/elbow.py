"""An elbow arm with a finger beside its chain, the same in URDF, SDF and MJCF, for tests of files of one's own."""

import numpy as np

# name, parent, place of the joint in the parent [m], axis, mass [kg]: an elbow arm, and a finger beside the chain
LINKS = [
    ("j1", "base", (0, 0, 0.3), "z", 3.0),
    ("j2", "l1", (0, 0, 0), "y", 3.0),
    ("j3", "l2", (0, 0, 0.26), "y", 2.0),
    ("j4", "l3", (0.2, 0, 0.03), "x", 1.0),
    ("j5", "l4", (0.07, 0, 0), "y", 0.6),
    ("j6", "l5", (0, 0, 0), "x", 0.3),
]
AXES = {"x": (1, 0, 0), "y": (0, 1, 0), "z": (0, 0, 1)}
EFFORT, SPEED, RANGE = 90.0, 6.0, 2.9
LIMITS = {"torque_limits": (EFFORT,) * 6, "speed_limits": (SPEED,) * 6}
HOME = (0.0, 0.3, 0.6, 0.0, -0.9, 0.0)


def xyz(values):
    return " ".join(map(str, values))


def urdf():
    parts = [
        '<robot name="elbow"><link name="world"/><link name="base"/>',
        '<joint name="stand" type="fixed"><parent link="world"/><child link="base"/></joint>',
    ]
    for k, (name, parent, place, axis, mass) in enumerate(LINKS, 1):
        parts.append(f"""<link name="l{k}"><inertial><mass value="{mass}"/>
          <inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>
          <visual><geometry><mesh filename="package://nowhere/l{k}.dae"/></geometry></visual>
          <collision><geometry><box size="1 1 1"/></geometry></collision></link>
        <joint name="{name}" type="revolute"><parent link="{parent}"/><child link="l{k}"/><origin xyz="{xyz(place)}"/>
          <axis xyz="{xyz(AXES[axis])}"/><limit lower="-{RANGE}" upper="{RANGE}" velocity="{SPEED}" effort="{EFFORT}"/></joint>""")
    # z out of the flange: turned by 90 deg about y
    parts.append("""<link name="tcp"/><joint name="tip" type="fixed"><parent link="l6"/><child link="tcp"/>
        <origin xyz="0.05 0 0" rpy="0 1.5707963267948966 0"/></joint>
        <link name="finger"><inertial><mass value="0.1"/><inertia ixx="0.001" iyy="0.001" izz="0.001" ixy="0" ixz="0" iyz="0"/></inertial></link>
        <joint name="grip" type="prismatic"><parent link="l6"/><child link="finger"/><axis xyz="0 1 0"/>
          <limit lower="0" upper="0.04" velocity="1" effort="20"/></joint></robot>""")
    return "".join(parts)


def sdf():
    place = np.zeros(3)
    parts = ['<sdf version="1.9"><model name="elbow"><link name="base"><inertial><mass>1</mass></inertial></link>']
    for k, (name, parent, offset, axis, mass) in enumerate(LINKS, 1):
        place = place + offset
        parts.append(f"""<link name="l{k}"><pose>{xyz(place)} 0 0 0</pose><inertial><mass>{mass}</mass><inertia>
          <ixx>0.01</ixx><iyy>0.01</iyy><izz>0.01</izz></inertia></inertial>
          <collision name="c"><geometry><box><size>1 1 1</size></box></geometry></collision></link>
        <joint name="{name}" type="revolute"><parent>{parent}</parent><child>l{k}</child><axis><xyz>{xyz(AXES[axis])}</xyz>
          <limit><lower>-{RANGE}</lower><upper>{RANGE}</upper><velocity>{SPEED}</velocity><effort>{EFFORT}</effort></limit></axis></joint>""")
    parts.append(f"""<frame name="tcp" attached_to="l6"><pose>0.05 0 0 0 1.5707963267948966 0</pose></frame>
        <link name="finger"><pose>{xyz(place)} 0 0 0</pose><inertial><mass>0.1</mass><inertia><ixx>0.001</ixx><iyy>0.001</iyy><izz>0.001</izz></inertia></inertial></link>
        <joint name="grip" type="prismatic"><parent>l6</parent><child>finger</child><axis><xyz>0 1 0</xyz></axis></joint></model></sdf>""")
    return "".join(parts)


def mjcf():
    text, end = (
        '<mujoco model="elbow"><compiler angle="radian"/><worldbody><body name="base"><geom type="box" size=".01 .01 .01" mass="1"/>',
        "",
    )
    for k, (name, _, place, axis, mass) in enumerate(LINKS, 1):
        text += f"""<body name="l{k}" pos="{xyz(place)}"><joint name="{name}" axis="{xyz(AXES[axis])}" range="-{RANGE} {RANGE}"/>
          <inertial pos="0 0 0" mass="{mass}" diaginertia="0.01 0.01 0.01"/>"""
        end += "</body>"
    text += """<body name="tcp" pos="0.05 0 0" quat="0.70710678118654757 0 0.70710678118654757 0"><inertial pos="0 0 0" mass="1e-9" diaginertia="1e-12 1e-12 1e-12"/></body>
      <body name="finger"><joint name="grip" type="slide" axis="0 1 0"/><inertial pos="0 0 0" mass="0.1" diaginertia="0.001 0.001 0.001"/></body>"""
    actuators = "".join(
        f'<motor name="m{name}" joint="{name}" ctrlrange="-{EFFORT} {EFFORT}" ctrllimited="true"/>'
        for name, *_ in reversed(LINKS)
    )
    return f"{text}{end}</body></worldbody><actuator>{actuators}</actuator></mujoco>"


FORMATS = {"arm.urdf": urdf, "arm.sdf": sdf, "arm.xml": mjcf}
