"""The control and status ports of a unit, laid out as registers that a block in front of it would have."""

from typing import Any

WORD = 4
"""Bytes of a register of up to 32 bits."""


def registers(ports: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """The register map of a unit from the ports of its manifest; empty for a unit without control ports.

    Strobes share one register, narrow status another; every other port has one of its own, 64 bits wide where it has
    more than 32. A register is name, meaning, offset in bytes, width, fields; a field is name, meaning, kind ("strobe",
    "control" or "status"), lowest bit, width, names of values.
    """
    strobes, controls, read = (
        [port for port in ports if port["role"] in roles]
        for roles in (("strobe",), ("control",), ("status", "counter"))
    )
    status = [port for port in read if port["width"] <= 8]
    wide = [port for port in read if port["width"] > 8]
    out: list[dict[str, Any]] = []
    if strobes:
        out.append(_register(out, "control", "What happens once when a bit is written as 1", strobes, "strobe"))
    if status:
        out.append(_register(out, "status", "What the unit says of itself", status, "status"))
    for port in controls:
        out.append(_register(out, port["name"], port["meaning"], [port], "control"))
    for port in wide:
        out.append(_register(out, port["name"], port["meaning"], [port], "status"))
    return out


def size(found: list[dict[str, Any]]) -> int:
    """Bytes that a register map takes."""
    return found[-1]["offset"] + found[-1]["width"] // 8 if found else 0


def _register(
    before: list[dict[str, Any]], name: str, meaning: str, ports: list[dict[str, Any]], kind: str
) -> dict[str, Any]:
    fields: list[dict[str, Any]] = []
    for port in ports:
        low = sum(field["width"] for field in fields)
        fields.append(
            {
                "name": port["name"],
                "meaning": port["meaning"].replace('"', "'"),
                "kind": kind,
                "low": low,
                "width": port["width"],
                "values": port.get("values", {}),
            }
        )
    bits = sum(field["width"] for field in fields)
    if bits > 64:
        raise ValueError(
            f"register {name}: {bits} bits of {', '.join(port['name'] for port in ports)} are more than 64"
        )
    width = 32 if bits <= 32 else 64
    offset = -(-size(before) // (width // 8)) * (width // 8)
    return {"name": name, "meaning": meaning, "offset": offset, "width": width, "fields": fields}
