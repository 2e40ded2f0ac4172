"""The ports of a loop's diagram: by which it stands in a larger one."""

from collections.abc import Mapping

from pydrake.systems.framework import DiagramBuilder, OutputPort

from flipdiagram.plants.cell import DrakeCell
from flipdiagram.plants.handle import Cell

FORCES = ("applied_generalized_force", "applied_spatial_force")
"""Input ports of Drake's plant that need no source."""


def export_ports(builder: DiagramBuilder, signals: Mapping[str, OutputPort | int], cell: Cell) -> None:
    """Export what a larger diagram may read, and what it may disturb; nothing of it must be connected.

    Output ports: the figure's `signals` by their names (those that are sizes come from outside); of the cell `block`,
    `poses` and `contact_wrench`, see `handle.Cell`.  With Drake's engine also `query_object` of its SceneGraph, and as
    input ports those of its MultibodyPlant by their names there: `applied_generalized_force` [N m], one per velocity of
    the plant, and `applied_spatial_force`, unless the scenario's push is connected to it.
    """
    outputs: dict[str, OutputPort | int] = {
        **signals,
        "block": cell.block,
        "poses": cell.poses,
        "contact_wrench": cell.contact_wrench,
    }
    if isinstance(cell, DrakeCell):
        outputs["query_object"] = cell.scene_graph.get_query_output_port()
        for name in FORCES:
            port = cell.robot.GetInputPort(name)
            if not builder.IsConnectedOrExported(port):
                builder.ExportInput(port, name)
    for name, output in outputs.items():
        if not isinstance(output, int):
            builder.ExportOutput(output, name)
