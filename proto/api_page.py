"""Makes the page about the contract from the comments in its .proto files.

    api_page.py DESCRIPTOR_SET OUT

DESCRIPTOR_SET: `protoc --include_source_info --descriptor_set_out` of the files of sightline.v1.
"""
import pathlib
import re
import sys

from google.protobuf import descriptor_pb2

Field = descriptor_pb2.FieldDescriptorProto
ORDER = ("camera_control", "session", "shot", "scene", "settings", "camera", "errors", "server", "diagnostics", "recording")
SCALARS = {Field.TYPE_DOUBLE: "double", Field.TYPE_FLOAT: "float", Field.TYPE_INT32: "int32", Field.TYPE_INT64: "int64",
           Field.TYPE_UINT32: "uint32", Field.TYPE_UINT64: "uint64", Field.TYPE_FIXED32: "fixed32", Field.TYPE_FIXED64: "fixed64",
           Field.TYPE_SFIXED32: "sfixed32", Field.TYPE_SFIXED64: "sfixed64", Field.TYPE_SINT32: "sint32", Field.TYPE_SINT64: "sint64",
           Field.TYPE_BOOL: "bool", Field.TYPE_STRING: "string", Field.TYPE_BYTES: "bytes"}
INTRODUCTION = """# The contract

Generated from the comments in `sightline/v1/*.proto`; a test keeps it current. [SETTINGS.md](SETTINGS.md) lists the settings with ranges and
defaults, and [COMPATIBILITY.md](../deploy/COMPATIBILITY.md) says what may change. Fields in one *oneof* exclude each other.
"""


class File:
    def __init__(self, proto):
        self.proto = proto
        self.prefix = f".{proto.package}."
        self.comments = {tuple(l.path): l.leading_comments for l in proto.source_code_info.location}

    def comment(self, *path):
        return re.sub(r"\s+", " ", self.comments.get(path, "")).strip()


def anchor(name):
    return name.lower().replace(".", "")


def type_of(field, file):
    name = SCALARS.get(field.type)
    if not name:
        short = field.type_name.removeprefix(file.prefix)
        name = f"[{short}](#{anchor(short)})" if short != field.type_name else f"`{field.type_name.lstrip('.')}`"
    return ("repeated " if field.label == Field.LABEL_REPEATED else "optional " if field.proto3_optional else "") + name


def cell(text):
    return text.replace("|", "\\|")


def messages(file, protos, path, scope=""):
    for i, message in enumerate(protos):
        at, name = (*path, i), scope + message.name
        yield f"### {name}\n\n{file.comment(*at)}\n"
        if message.field:
            yield "| field | type | meaning |\n|---|---|---|"
            for k, field in enumerate(message.field):
                choice = ""
                if field.HasField("oneof_index") and not field.proto3_optional:
                    choice = f" (oneof `{message.oneof_decl[field.oneof_index].name}`)"
                yield f"| `{field.name}` | {type_of(field, file)} | {cell(file.comment(*at, 2, k))}{choice} |"
            yield ""
        yield from messages(file, [m for m in message.nested_type if not m.options.map_entry], (*at, 3), f"{name}.")
        yield from enums(file, message.enum_type, (*at, 4), f"{name}.")


def enums(file, protos, path, scope=""):
    for i, enum in enumerate(protos):
        at = (*path, i)
        yield f"### {scope}{enum.name}\n\n{file.comment(*at)}\n\n| value | number | meaning |\n|---|--:|---|"
        for k, value in enumerate(enum.value):
            yield f"| `{value.name}` | {value.number} | {cell(file.comment(*at, 2, k))} |"
        yield ""


def services(file):
    for i, service in enumerate(file.proto.service):
        yield f"### {service.name}\n\n{file.comment(6, i)}\n\n| RPC | request | response | what it does |\n|---|---|---|---|"
        for k, rpc in enumerate(service.method):
            sides = [("stream " if stream else "") + f"[{name.removeprefix(file.prefix)}](#{anchor(name.removeprefix(file.prefix))})"
                     for name, stream in ((rpc.input_type, rpc.client_streaming), (rpc.output_type, rpc.server_streaming))]
            yield f"| `{rpc.name}` | {sides[0]} | {sides[1]} | {cell(file.comment(6, i, 2, k))} |"
        yield ""


def page(descriptors):
    files = {pathlib.PurePath(f.name).stem: File(f) for f in descriptors.file if f.package == "sightline.v1"}
    assert sorted(files) == sorted(ORDER), "a .proto file is missing in ORDER"
    parts = [INTRODUCTION]
    for name in ORDER:
        file = files[name]
        parts.append(f"## {name}.proto\n")
        parts += services(file)
        parts += messages(file, file.proto.message_type, (4,))
        parts += enums(file, file.proto.enum_type, (5,))
    return re.sub(r"\n{3,}", "\n\n", "\n".join(parts)).rstrip() + "\n"


if __name__ == "__main__":
    descriptors = descriptor_pb2.FileDescriptorSet.FromString(pathlib.Path(sys.argv[1]).read_bytes())
    pathlib.Path(sys.argv[2]).write_text(page(descriptors), encoding="utf-8")
