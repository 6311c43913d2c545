"""Geometry node groups, built in Python, that animate from the current frame: no script runs during playback."""

from __future__ import annotations

from typing import Any, Literal, cast

import bpy
import numpy as np

from rigid_motion.blender import existing

Socket = bpy.types.NodeSocket


def add_attribute(
    mesh: bpy.types.Mesh, name: str, values: np.ndarray, domain: Literal["POINT", "FACE"] = "POINT"
) -> None:
    """Add an attribute with a number for each point or face. The array's type determines the attribute's."""
    attribute: Any = mesh.attributes.new(name, "INT" if values.dtype == np.int32 else "FLOAT", domain)
    attribute.data.foreach_set("value", values)


def node_of(socket: Socket) -> Any:
    """Return the node of a socket, typed as Any: its attributes depend on its kind."""
    return socket.node


class Group:
    """A geometry node group under construction: `group.add("GeometryNodeFillCurve", curves)` adds a node."""

    def __init__(self, name: str, **inputs: str) -> None:
        """Make a group with a geometry input and then `inputs`: name to the kind of socket ("Float", "Material")."""
        self.tree = cast(Any, bpy.data.node_groups.new(name, "GeometryNodeTree"))
        self.tree.is_modifier = True
        for direction in ("INPUT", "OUTPUT"):
            self.tree.interface.new_socket("Geometry", in_out=direction, socket_type="NodeSocketGeometry")
        for title, kind in inputs.items():
            self.tree.interface.new_socket(title, in_out="INPUT", socket_type=f"NodeSocket{kind}")
        self.inputs = self.tree.nodes.new("NodeGroupInput").outputs

    def add(self, kind: str, *arguments: Any, settings: dict[str, Any] | None = None, **named: Any) -> Socket:
        """Add a node and return its first output.

        Arguments that are sockets are linked, other values are set; None leaves an input unchanged. The settings become
        properties of the node.
        """
        node = self.tree.nodes.new(kind)
        for name, value in (settings or {}).items():
            setattr(node, name, value)
        pairs = [*zip(node.inputs, arguments, strict=False), *((node.inputs[name], v) for name, v in named.items())]
        for socket, value in pairs:
            if isinstance(value, Socket):
                self.tree.links.new(value, socket)
            elif value is not None:
                socket.default_value = value
        return node.outputs[0]

    def math(self, operation: str, *values: Any, clamp: bool = False) -> Socket:
        return self.add("ShaderNodeMath", *values, settings={"operation": operation, "use_clamp": clamp})

    def vector(self, operation: str, *values: Any) -> Socket:
        outputs = node_of(self.add("ShaderNodeVectorMath", *values, settings={"operation": operation})).outputs
        return outputs["Value" if operation in ("DOT_PRODUCT", "DISTANCE", "LENGTH") else "Vector"]

    def attribute(self, name: str) -> Socket:
        """Return a float attribute of the geometry's points."""
        return self.add("GeometryNodeInputNamedAttribute", name, settings={"data_type": "FLOAT"})

    def frame(self) -> Socket:
        """Return the current frame."""
        return node_of(self.add("GeometryNodeInputSceneTime")).outputs["Frame"]

    def finish(self, geometry: Socket) -> bpy.types.NodeTree:
        self.tree.links.new(geometry, self.tree.nodes.new("NodeGroupOutput").inputs[0])
        return cast(bpy.types.NodeTree, self.tree)


def apply_group(obj: bpy.types.Object, group: bpy.types.NodeTree, **inputs: Any) -> bpy.types.NodesModifier:
    """Add a modifier with the group to the object, and set its inputs."""
    modifier: Any = obj.modifiers.new(group.name, "NODES")
    modifier.node_group = group
    for name, value in inputs.items():
        if hasattr(modifier, "properties"):
            getattr(modifier.properties.inputs, _identifier(group, name)).value = value
        else:
            modifier[_identifier(group, name)] = value
    return cast(bpy.types.NodesModifier, modifier)


def input_path(modifier: Any, name: str) -> str:
    """Return the data path, relative to the object, that animates an input. Blender 5.2 moved it."""
    identifier = _identifier(modifier.node_group, name)
    if hasattr(modifier, "properties"):
        return str(getattr(modifier.properties.inputs, identifier).path_from_id("value"))
    return f'modifiers["{modifier.name}"]["{identifier}"]'


def _identifier(group: bpy.types.NodeTree, name: str) -> str:
    items: Any = existing(group.interface).items_tree
    return next(
        item.identifier for item in items if item.item_type == "SOCKET" and item.in_out == "INPUT" and item.name == name
    )
