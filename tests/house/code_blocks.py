#!/usr/bin/env python3
"""The code in documents, to be compiled and run.

    code_blocks.py cpp SOURCE_ROOT PROGRAM.cpp SNIPPETS.cpp

writes the C++ of the documents: the one block with a main() as a program of its own, and all others as bodies of functions. The compiler
reports errors at the line of the document.
"""
import collections
import pathlib
import re
import sys

# Documents whose code is checked. (Their other pages hold formats and results.)
DOCUMENTS = ("README.md", "client/README.md", "deploy/README.md", "deploy/METRICS.md", "deploy/KUBERNETES.md", "deploy/TROUBLESHOOTING.md", "deploy/SIZING.md", "deploy/SECURITY.md", "deploy/WALKS.md",
             "server/README.md", "tests/README.md", "scenes/README.md",
             "client/cpp/README.md", "client/python/README.md", "client/node/README.md", "client/go/README.md", "client/rust/README.md", "client/csharp/README.md", "client/engines/README.md",
             "client/CONCEPTS.md", "client/TUNING.md", "client/SAMPLING.md", "client/engines/levels.md", "client/recordings/README.md",
             "tests/conformance/README.md", "client/cpp/sightline_client.h")

Block = collections.namedtuple("Block", "path line language text")  # line: of the first line of the text, from 1

FENCE = re.compile(r"^(```+)\s*(\w*)\s*\n(.*?)^\1\s*$", re.M | re.S)
# In a header: lines of a comment that are indented by three spaces or more.
INDENTED_COMMENT = re.compile(r"(?:^//   +\S.*\n)+", re.M)

# A function around each snippet of sightline_client.h; the snippet may use its parameters.
SNIPPET = """
Status snippet_{number}([[maybe_unused]] std::span<const std::byte> bytes, [[maybe_unused]] const v1::OpenSession& open,
                        [[maybe_unused]] const v1::Tick& tick, [[maybe_unused]] const v1::Settings& settings) {{
#line {line} "{path}"
{text}
  return {{}};
}}
"""


def blocks_of(root, path):
    text = pathlib.Path(root, path).read_text(encoding="utf-8")
    if path.endswith(".md"):
        for found in FENCE.finditer(text):
            yield Block(path, text.count("\n", 0, found.start(3)) + 1, found.group(2), found.group(3))
    else:
        for found in INDENTED_COMMENT.finditer(text):
            code = re.sub(r"^//", "  ", found.group(0), flags=re.M)
            yield Block(path, text.count("\n", 0, found.start()) + 1, "cpp", code)


def all_blocks(root):
    return [block for path in DOCUMENTS for block in blocks_of(root, path)]


def write_cpp(root, program, snippets):
    blocks = [block for block in all_blocks(root) if block.language == "cpp"]
    mains = [block for block in blocks if "int main(" in block.text]
    if len(mains) != 1:
        sys.exit(f"expected one C++ program in {', '.join(DOCUMENTS)}, found {len(mains)}")
    pathlib.Path(program).write_text(f'#line {mains[0].line} "{mains[0].path}"\n{mains[0].text}')
    bodies = [SNIPPET.format(number=i, line=b.line, path=b.path, text=b.text) for i, b in enumerate(blocks) if b is not mains[0]]
    pathlib.Path(snippets).write_text('#include <cstdio>\n\n#include "client/cpp/camera.h"\n#include "client/cpp/live_camera.h"\n#include "client/cpp/sightline_client.h"\n\nnamespace sightline {\n'
                                      + "".join(bodies) + "\n}  // namespace sightline\n")


if __name__ == "__main__":
    if len(sys.argv) != 5 or sys.argv[1] != "cpp":
        sys.exit(__doc__)
    write_cpp(*sys.argv[2:])
